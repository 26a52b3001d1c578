#include "handsim/output/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <random>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::output {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPartHead = ".handsim.", kPartEnd = ".part";
constexpr mode_t kMode = 0666;  ///< the user's umask is subtracted

fs::path folder_of(const fs::path& path) { return path.has_parent_path() ? path.parent_path() : "."; }

/// A path through which an open file without a name can be linked.
std::string open_name(int file) { return fmt::format("/proc/self/fd/{}", file); }

const char* described(fs::file_type type) {
  using T = fs::file_type;
  return type == T::directory                       ? "a folder"
         : type == T::block || type == T::character ? "a device"
         : type == T::fifo                          ? "a pipe"
         : type == T::socket                        ? "a socket"
         : type == T::symlink                       ? "a broken link"
                                                    : "no regular file";
}

Error uncreatable(const fs::path& path, const std::string& why) {
  return input_error(path.string(), fmt::format("a file that cannot be created ({})", why),
                     "a path that can be written");
}

bool is_standard_stream(const fs::path& path) {
  struct stat file {};
  if (stat(path.c_str(), &file) != 0) return false;
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    struct stat open {};
    if (fstat(stream, &open) == 0 && open.st_dev == file.st_dev && open.st_ino == file.st_ino) return true;
  }
  return false;
}

}  // namespace

fs::path file_target(const fs::path& path) {
  const auto refuse = [&](const char* got) {
    return input_error(path.string(), got, "the name of a new file, or of a regular file to replace");
  };
  std::error_code failure, ignored;
  const fs::file_type type = fs::status(path, failure).type();
  const bool link = fs::is_symlink(fs::symlink_status(path, ignored));
  if (type == fs::file_type::none) throw uncreatable(path, failure.message());
  if (type == fs::file_type::not_found && !link) return path;
  if (type == fs::file_type::not_found) throw refuse(described(fs::file_type::symlink));
  if (type != fs::file_type::regular) throw refuse(described(type));
  if (is_standard_stream(path)) throw refuse("a file that is a standard stream of this program");
  return link ? fs::canonical(path) : path;
}

std::string part_name() {
  static std::atomic<unsigned> count = 0;
  return fmt::format("{}{}.{:08x}{:x}{}", kPartHead, getpid(), std::random_device()(), count++, kPartEnd);
}

bool is_part_name(std::string_view name) {
  return name.starts_with(kPartHead) && name.find(kPartEnd) != std::string_view::npos;
}

AtomicFile::AtomicFile(const fs::path& path) : path_(file_target(path)) {
  const int file = create();
  if (file >= 0) file_ = fdopen(file, "wb");
  if (file_) return;
  const int cause = errno;
  if (file >= 0) close(file);
  if (!part_.empty()) unlink(part_.c_str());
  throw uncreatable(path_, std::strerror(cause));
}

/// Creates the file without a name if possible: then nothing remains of it if the process is killed.
int AtomicFile::create() {
  if (path_.filename().empty()) {
    errno = EISDIR;
    return -1;
  }
  const int file = open(folder_of(path_).c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, kMode);
  if (file >= 0 && access(open_name(file).c_str(), F_OK) == 0) return file;
  if (file >= 0) close(file);
  name_part();
  return open(part_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, kMode);
}

void AtomicFile::name_part() { part_ = folder_of(path_) / part_name(); }

AtomicFile::~AtomicFile() {
  if (file_) std::fclose(file_);
  if (!part_.empty()) unlink(part_.c_str());
}

void AtomicFile::fail() const {
  throw output_error(path_.string(), fmt::format("a file that cannot be written ({})", std::strerror(errno)),
                     "free space on the disk, and a folder that is not removed meanwhile");
}

void AtomicFile::write(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), file_) != text.size()) fail();
}

void AtomicFile::overwrite(long at, std::string_view text) {
  if (std::fseek(file_, at, SEEK_SET) != 0) fail();
  write(text);
  if (std::fseek(file_, 0, SEEK_END) != 0) fail();
}

void AtomicFile::commit() {
  if (std::fflush(file_) != 0) fail();
  if (part_.empty()) {
    // linkat cannot replace an existing file, rename can.
    name_part();
    if (linkat(AT_FDCWD, open_name(fileno(file_)).c_str(), AT_FDCWD, part_.c_str(), AT_SYMLINK_FOLLOW) != 0)
      fail();
  }
  std::FILE* file = file_;
  file_ = nullptr;
  if (std::fclose(file) != 0 || std::rename(part_.c_str(), path_.c_str()) != 0) fail();
  part_.clear();
}

void write_file(const fs::path& path, std::string_view text) {
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

void make_folder(const fs::path& path) {
  std::error_code failure;
  fs::create_directories(path, failure);
  if (failure || !fs::is_directory(path))
    throw input_error(
        path.string(),
        failure ? fmt::format("a folder that cannot be created ({})", failure.message()) : "not a folder",
        "a folder, or a path where one can be created");
}

}  // namespace handsim::output
