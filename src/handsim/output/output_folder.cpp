#include "handsim/output/output_folder.h"

#include <fcntl.h>
#include <fnmatch.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

namespace {

namespace fs = std::filesystem;

/// ` (process 123)`: the process that holds the lock on an open folder; empty if the kernel does not list it.
std::string holder(int folder) {
  struct stat of {};
  if (fstat(folder, &of) != 0) return "";
  const std::string wanted = fmt::format("{:02x}:{:02x}:{}", major(of.st_dev), minor(of.st_dev), of.st_ino);
  std::ifstream locks("/proc/locks");
  for (std::string line; std::getline(locks, line);) {
    std::istringstream words(line);
    std::string number, kind, advisory, mode, process, place;
    words >> number >> kind >> advisory >> mode >> process >> place;
    if (kind == "FLOCK" && place == wanted) return " (process " + process + ")";
  }
  return "";
}

/// The folders of the names, relative: the empty path, and e.g. `plots` for `plots/*.png`.
std::set<fs::path> folders_of(const std::vector<std::string>& names) {
  std::set<fs::path> out = {""};
  for (const std::string& name : names) out.insert(fs::path(name).parent_path());
  return out;
}

/// Sorted names of the entries of a folder; empty if the folder is missing.
std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> out;
  std::error_code failure;
  for (fs::directory_iterator at(folder, failure), end; !failure && at != end; at.increment(failure))
    out.push_back(at->path().filename());
  std::ranges::sort(out);
  return out;
}

void remove_earlier(const fs::path& path) {
  std::error_code failure;
  fs::remove(path, failure);
  if (failure)
    throw output_error(path.string(),
                       fmt::format("a file of an earlier run that cannot be removed ({})", failure.message()),
                       "a folder that can be written");
}

}  // namespace

OutputFolder::OutputFolder(fs::path path, std::vector<std::string> names, const Inputs& inputs)
    : path_(std::move(path)), names_(std::move(names)) {
  make_folder(path_);
  lock();
  try {
    check(inputs);
  } catch (...) {
    close(file_);
    throw;
  }
}

OutputFolder::~OutputFolder() {
  if (file_ >= 0) close(file_);
}

OutputFolder::OutputFolder(OutputFolder&& other) noexcept
    : path_(std::move(other.path_)), names_(std::move(other.names_)), file_(std::exchange(other.file_, -1)) {}

void OutputFolder::lock() {
  file_ = open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file_ < 0)
    throw input_error(path_.string(), fmt::format("a folder that cannot be read ({})", std::strerror(errno)),
                      "a folder that can be read and written");
  if (flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  const std::string who = holder(file_);
  close(file_);
  throw input_error("--out", path_.string() + ", in use by another handsim" + who,
                    "another folder, or wait until that one ends");
}

std::vector<fs::path> OutputFolder::present() const {
  std::vector<fs::path> out;
  for (const fs::path& folder : folders_of(names_))
    for (const fs::path& name : entries(path_ / folder)) {
      const fs::path relative = folder / name;
      const auto is_named = [&](const std::string& pattern) {
        return fnmatch(pattern.c_str(), relative.c_str(), FNM_PATHNAME | FNM_PERIOD) == 0;
      };
      if (std::ranges::any_of(names_, is_named)) out.push_back(relative);
    }
  return out;
}

void OutputFolder::check(const Inputs& inputs) const {
  std::error_code failure;
  std::vector<Problem> problems;
  for (const fs::path& folder : folders_of(names_)) {
    const fs::file_status status = fs::symlink_status(path_ / folder, failure);
    if (!folder.empty() && fs::exists(status) && !fs::is_directory(status))
      problems.push_back({std::nullopt, (path_ / folder).string(), "not a folder",
                          "a folder, or a name that does not exist"});
  }
  const std::vector<fs::path> found = present();
  const std::vector<fs::path> read = inputs && !found.empty() ? inputs() : std::vector<fs::path>();
  for (const fs::path& name : found) {
    const fs::path at = path_ / name;
    const auto is_this = [&](const fs::path& input) { return fs::equivalent(at, input, failure); };
    if (fs::is_symlink(fs::symlink_status(at, failure)))
      problems.push_back(
          {std::nullopt, at.string(), "a link", "a regular file, or a name that does not exist"});
    else if (std::ranges::any_of(read, is_this))
      problems.push_back(
          {std::nullopt, "--out",
           fmt::format("{}: the run would overwrite its own input {}", path_.string(), at.string()),
           "another folder"});
    else
      try {
        file_target(at);
      } catch (const Error& error) {
        problems.insert(problems.end(), error.problems().begin(), error.problems().end());
      }
  }
  if (!problems.empty()) throw Error(std::move(problems));
  // Report a folder that cannot be written now, not after the run.
  const AtomicFile probe(path_ / part_name());
}

void OutputFolder::clear() const {
  for (const fs::path& name : present()) remove_earlier(path_ / name);
  for (const fs::path& folder : folders_of(names_)) {
    for (const fs::path& name : entries(path_ / folder))
      if (is_part_name(name.string())) remove_earlier(path_ / folder / name);
    // Subfolders that are empty now.
    std::error_code ignored;
    if (!folder.empty() && fs::is_directory(path_ / folder, ignored)) fs::remove(path_ / folder, ignored);
  }
}

void check_target(const std::string& option, const fs::path& path, const FileKind& kind,
                  const OutputFolder::Inputs& inputs) {
  const AtomicFile probe(path);
  std::error_code failure;
  if (!fs::exists(path, failure)) return;
  for (const fs::path& input : inputs ? inputs() : std::vector<fs::path>())
    if (fs::equivalent(path, input, failure))
      throw input_error(option, path.string() + ", which is also an input", "another file");
  std::string head(kMarkBytes, '\0');
  head.resize(InputFile(path, kind.name, SIZE_MAX).read(head.data(), head.size()));
  if (!head.empty() && head.find(kind.mark) == std::string::npos)
    throw input_error(option, fmt::format("{}, which exists and is not {}", path.string(), kind.name),
                      fmt::format("the name of a new file, or of {} to replace", kind.name));
}

}  // namespace handsim::output
