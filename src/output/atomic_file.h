// A file that appears under its name only when complete: written beside it as `.NAME.part`, renamed by
// commit().
#pragma once

#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

namespace handsim::output {

class AtomicFile {
 public:
  /// @throws Error (input) where the folder cannot be written.
  explicit AtomicFile(std::filesystem::path path);
  /// Removes what was not committed.
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// @throws Error (input) where the disk takes no more.
  void write(std::string_view text);
  /// Puts text in the place of what was written from byte `at` on; it must have been. @throws as write.
  void overwrite(long at, std::string_view text);
  /// Gives the file its name. @throws Error (input) where that fails.
  void commit();

 private:
  [[noreturn]] void fail(const char* doing) const;

  std::filesystem::path path_;
  std::filesystem::path part_;
  std::FILE* file_ = nullptr;
};

/// Writes a whole file at once.
void write_file(const std::filesystem::path& path, std::string_view text);

/// Makes the folder and its parents. @throws Error (input) where it cannot be made or is no folder.
void make_folder(const std::filesystem::path& path);

}  // namespace handsim::output
