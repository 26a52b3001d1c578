// What the fuzz targets share. Each target is one reader: whatever the bytes, it returns or throws Error, and
// nothing else; the fuzzer sees crashes, leaks, hangs and hunger.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "handsim/core/error.h"
#include "places.h"

namespace handsim::fuzz {

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Runs a reader; the one exception that it may throw is Error, with something to say.
template <class Reader>
int read(Reader reader) {
  try {
    reader();
  } catch (const Error& error) {
    if (*error.what() == '\0') __builtin_trap();
  }
  return 0;
}

/// A file of these bytes, for readers that take a path; in memory where the system has such a folder.
class File {
 public:
  File(std::string_view bytes, const std::string& extension) {
    const std::filesystem::path memory = "/dev/shm";
    std::error_code failure;
    path_ =
        (std::filesystem::is_directory(memory, failure) ? memory : std::filesystem::temp_directory_path()) /
        ("handsim-fuzz-" + std::to_string(getpid()) + extension);
    std::ofstream(path_, std::ios::binary) << bytes;
  }
  ~File() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// References in the bytes are looked for beside the shipped scenes.
inline const std::string kPlace = test::in_source("config/fuzz.yaml");

}  // namespace handsim::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
