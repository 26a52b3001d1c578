#include "handsim/output/atomic_file.h"

#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::output {

AtomicFile::AtomicFile(std::filesystem::path path)
    : path_(std::move(path)), part_(path_.parent_path() / ("." + path_.filename().string() + ".part")) {
  std::error_code failure;
  // Renaming onto a folder fails only at the end; say it before any work is done.
  if (std::filesystem::is_directory(path_, failure)) {
    errno = EISDIR;
    fail("be created");
  }
  file_ = std::fopen(part_.c_str(), "wb");
  if (!file_) fail("be created");
}

AtomicFile::~AtomicFile() {
  if (!file_) return;
  std::fclose(file_);
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void AtomicFile::fail(const char* doing) const {
  throw input_error(path_.string(), fmt::format("a file that cannot {} ({})", doing, std::strerror(errno)),
                    "a path that can be written");
}

void AtomicFile::write(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), file_) != text.size()) fail("be written");
}

void AtomicFile::overwrite(long at, std::string_view text) {
  if (std::fseek(file_, at, SEEK_SET) != 0) fail("be written");
  write(text);
  if (std::fseek(file_, 0, SEEK_END) != 0) fail("be written");
}

void AtomicFile::commit() {
  std::FILE* file = file_;
  file_ = nullptr;
  const bool flushed = std::fflush(file) == 0 && std::fclose(file) == 0;
  if (!flushed || std::rename(part_.c_str(), path_.c_str()) != 0) {
    const int cause = errno;
    std::error_code ignored;
    std::filesystem::remove(part_, ignored);
    errno = cause;
    fail("be written");
  }
}

void write_file(const std::filesystem::path& path, std::string_view text) {
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

void make_folder(const std::filesystem::path& path) {
  std::error_code failure;
  std::filesystem::create_directories(path, failure);
  if (failure || !std::filesystem::is_directory(path))
    throw input_error(
        path.string(),
        failure ? fmt::format("a folder that cannot be made ({})", failure.message()) : "no folder",
        "a folder that can be made");
}

}  // namespace handsim::output
