#include "handsim/core/input_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fmt/format.h>

namespace handsim {

namespace {

thread_local CarriedFiles* carried = nullptr;
thread_local bool keeps = false;

/// The content of a file that is carried; null: it is none.
const std::string* carried_content(const std::filesystem::path& path) {
  if (!carried) return nullptr;
  const auto found = carried->files.find(absolute_path(path).string());
  return found == carried->files.end() ? nullptr : &found->second;
}

/// The descriptor of a file that has a content and no name, at its start; negative: there is no memory.
int file_of(const std::string& content) {
  const int file = ::memfd_create("handsim", MFD_CLOEXEC);
  for (std::size_t done = 0; file >= 0 && done < content.size();) {
    const ssize_t count =
        ::pwrite(file, content.data() + done, content.size() - done, static_cast<off_t>(done));
    if (count <= 0) return ::close(file), -1;
    done += static_cast<std::size_t>(count);
  }
  return file;
}

}  // namespace

CarriedScope::CarriedScope(CarriedFiles& files, bool keep) { carried = &files, keeps = keep; }
CarriedScope::~CarriedScope() { carried = nullptr; }

std::filesystem::path absolute_path(const std::filesystem::path& path) {
  return (carried ? carried->folder / path : std::filesystem::absolute(path)).lexically_normal();
}

bool is_file(const std::filesystem::path& path) {
  std::error_code failure;
  return carried_content(path) || std::filesystem::is_regular_file(path, failure);
}

std::string bytes_text(std::size_t bytes) {
  constexpr std::size_t kMegabyte = 1U << 20U;
  return bytes > 0 && bytes % kMegabyte == 0 ? fmt::format("{} MB", bytes / kMegabyte)
                                             : fmt::format("{} bytes", bytes);
}

InputFile::InputFile(const std::filesystem::path& path, std::string_view need, std::size_t most_bytes)
    : path_(path), need_(need), most_(most_bytes) {
  struct stat status {};
  if (const std::string* content = carried_content(path)) {
    size_ = content->size();
    if (size_ > most_) throw error(fmt::format("a file of {} bytes", size_), "at most " + bytes_text(most_));
    number_ = file_of(*content);
    if (number_ < 0) throw unreadable("opened");
    return;
  }
  // Checked before opening, because opening some devices has effects.
  if (::stat(path.c_str(), &status) != 0)
    throw errno == ENOENT || errno == ENOTDIR || errno == ENAMETOOLONG ? error("no such file", need_)
                                                                       : unreadable("opened");
  check(status.st_mode);
  // open() must not wait for the writer of a pipe, nor make a terminal the controlling one.
  number_ = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  if (number_ < 0) throw unreadable("opened");
  try {
    if (::fstat(number_, &status) != 0) throw unreadable("opened");
    check(status.st_mode);
    size_ = static_cast<std::size_t>(std::max<off_t>(status.st_size, 0));
    if (size_ > most_) throw error(fmt::format("a file of {} bytes", size_), "at most " + bytes_text(most_));
    if (carried && keeps) {
      std::string content(size_, '\0');
      if (::pread(number_, content.data(), content.size(), 0) == static_cast<ssize_t>(content.size()))
        carried->files.emplace(absolute_path(path).string(), std::move(content));
    }
  } catch (...) {
    ::close(number_);
    throw;
  }
}

InputFile::~InputFile() { ::close(number_); }

Error InputFile::error(std::string got, std::string need) const {
  return Error({Problem{Place{path_.string(), std::max(1, lines_), 1}, "", std::move(got), std::move(need)}});
}

Error InputFile::unreadable(const char* what) const {
  return error(fmt::format("a file that cannot be {} ({})", what, std::strerror(errno)), need_);
}

void InputFile::check(unsigned mode) const {
  if (!S_ISREG(mode)) throw error(S_ISDIR(mode) ? "a directory" : "a pipe, socket or device", need_);
}

std::size_t InputFile::read(char* to, std::size_t most) {
  ssize_t count = 0;
  while ((count = ::read(number_, to, most)) < 0 && errno == EINTR) {
  }
  if (count < 0) throw unreadable("read");
  filled_ += static_cast<std::size_t>(count);
  // The reported size may be wrong: reading stops within a block beyond the limit.
  if (filled_ > most_)
    throw error("a file that grows beyond " + bytes_text(most_), "at most " + bytes_text(most_));
  return static_cast<std::size_t>(count);
}

bool InputFile::line(std::string& text) {
  constexpr std::size_t kBlock = 1U << 16U;
  text.clear();
  ++lines_;
  while (true) {
    if (next_ == block_.size()) {
      block_.resize(kBlock);
      block_.resize(read(block_.data(), kBlock));
      next_ = 0;
      if (block_.empty()) return cut_ = !text.empty();
    }
    const auto from = block_.begin() + static_cast<std::ptrdiff_t>(next_);
    const auto end = std::find(from, block_.end(), '\n');
    text.append(from, end);
    if (text.size() > kLongestLine) throw error("a line of more than " + bytes_text(kLongestLine), need_);
    next_ = static_cast<std::size_t>(end - block_.begin());
    if (end == block_.end()) continue;
    ++next_;
    return true;
  }
}

std::string read_input_file(const std::filesystem::path& path, std::string_view need,
                            std::size_t most_bytes) {
  InputFile file(path, need, most_bytes);
  // With a byte beyond the limit, at which reading stops.
  std::string text(std::min(most_bytes, std::max<std::size_t>(file.size(), 4096)) + 1, '\0');
  std::size_t filled = 0;
  while (const std::size_t count = file.read(text.data() + filled, text.size() - filled))
    if ((filled += count) == text.size()) text.resize(std::min(most_bytes + 1, 2 * filled));
  text.resize(filled);
  return text;
}

std::string read_text_file(const std::filesystem::path& path, std::string_view need, std::size_t most_bytes) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  std::string text = read_input_file(path, need, most_bytes);
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"))
    throw Error({Problem{Place{path.string(), 1, 1}, "", "text in UTF-16", "text in UTF-8"}});
  if (text.starts_with(kMark)) text.erase(0, kMark.size());
  return text;
}

bool has_entry(const std::filesystem::path& path) {
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0;
}

}  // namespace handsim
