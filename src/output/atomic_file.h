// A file that appears under its name only when complete. Until commit() it has no name at all where the file
// system can do that, else one of its own, `.handsim.PROCESS.NUMBER.part`, beside it: no two writers share
// one.
#pragma once

#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

namespace handsim::output {

class AtomicFile {
 public:
  /// @throws Error (input) where the folder cannot be written, or no regular file can stand there: see
  ///         file_target.
  explicit AtomicFile(const std::filesystem::path& path);
  /// Removes what was not committed.
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// @throws Error (output) where the disk is full.
  void write(std::string_view text);
  /// Puts text in the place of what was written from byte `at` on; it must have been. @throws as write.
  void overwrite(long at, std::string_view text);
  /// Gives the file its name. @throws Error (output) where that fails.
  void commit();

 private:
  int create();
  void name_part();
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  std::filesystem::path part_;  ///< empty as long as the file has no name
  std::FILE* file_ = nullptr;
};

/// Where a file of this name is written: links are followed.
/// @throws Error (input) where a folder, device, pipe or socket stands there, a link leads to nothing, or the
///         file is one of this process's standard streams.
std::filesystem::path file_target(const std::filesystem::path& path);

/// A name for a part of an output that no other process or file has.
std::string part_name();
/// Whether a file's name is one of part_name, or begins with one.
bool is_part_name(std::string_view name);

/// Writes a whole file at once.
void write_file(const std::filesystem::path& path, std::string_view text);

/// Makes the folder and its parents. @throws Error (input) where it cannot be made or is no folder.
void make_folder(const std::filesystem::path& path);

}  // namespace handsim::output
