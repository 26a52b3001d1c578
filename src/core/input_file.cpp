#include "handsim/core/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fmt/format.h>

namespace handsim {

namespace {

/// An open file, closed at the end.
class Descriptor {
 public:
  explicit Descriptor(const std::filesystem::path& path)
      // open() must not wait for the writer of a pipe, nor make a terminal the controlling one.
      : number_(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC)) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

/// Name of a kind of file that is refused; null for a regular file.
const char* refused_kind(mode_t mode) {
  if (S_ISREG(mode)) return nullptr;
  return S_ISDIR(mode) ? "a directory" : "a pipe, socket or device";
}

}  // namespace

std::string bytes_text(std::size_t bytes) {
  constexpr std::size_t kMegabyte = 1U << 20U;
  return bytes > 0 && bytes % kMegabyte == 0 ? fmt::format("{} MB", bytes / kMegabyte)
                                             : fmt::format("{} bytes", bytes);
}

std::string read_input_file(const std::filesystem::path& path, std::string_view need,
                            std::size_t most_bytes) {
  const auto refuse = [&](std::string got, std::string wanted) {
    return Error(std::vector<Problem>{{Place{path.string(), 1, 1}, "", std::move(got), std::move(wanted)}});
  };
  const auto unreadable = [&](const char* what) {
    return refuse(fmt::format("a file that cannot be {} ({})", what, std::strerror(errno)),
                  std::string(need));
  };
  struct stat status {};
  // Checked before opening, because opening some devices has effects.
  if (::stat(path.c_str(), &status) != 0) throw refuse("no such file", std::string(need));
  if (const char* what = refused_kind(status.st_mode)) throw refuse(what, std::string(need));
  const Descriptor file(path);
  if (file.number() < 0 || ::fstat(file.number(), &status) != 0) throw unreadable("opened");
  if (const char* what = refused_kind(status.st_mode)) throw refuse(what, std::string(need));
  const auto size = static_cast<std::size_t>(std::max<off_t>(status.st_size, 0));
  const std::string most = "at most " + bytes_text(most_bytes);
  if (size > most_bytes) throw refuse(fmt::format("a file of {} bytes", size), most);
  // The reported size may be wrong: reading stops only one byte beyond the limit.
  std::string text(std::min(most_bytes, std::max<std::size_t>(size, 4096)) + 1, '\0');
  std::size_t filled = 0;
  while (true) {
    if (filled == text.size()) text.resize(std::min(most_bytes + 1, 2 * filled));
    const ssize_t count = ::read(file.number(), text.data() + filled, text.size() - filled);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw unreadable("read");
    if (count == 0) break;
    filled += static_cast<std::size_t>(count);
    if (filled > most_bytes) throw refuse("a file that grows beyond " + bytes_text(most_bytes), most);
  }
  text.resize(filled);
  return text;
}

}  // namespace handsim
