// A file that appears under its name only when complete. Before commit() it has no name, or, where the file
// system demands one, `.handsim.PROCESS.NUMBER.part` in the same folder, which no other writer uses.
#pragma once

#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

namespace handsim::output {

class AtomicFile {
 public:
  /// @throws Error (input) if the folder cannot be written, and where file_target throws.
  explicit AtomicFile(const std::filesystem::path& path);
  /// Removes the file if it was not committed.
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// @throws Error (output) if the disk is full.
  void write(std::string_view text);
  /// Replaces as many bytes as the text has, from byte `at` on, which are written already. @throws as write
  void overwrite(long at, std::string_view text);
  /// Gives the file its name. @throws Error (output) if that fails.
  void commit();

 private:
  int create();
  void name_part();
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  std::filesystem::path part_;  ///< the temporary name; empty while the file has none
  std::FILE* file_ = nullptr;
};

/// The path to which a file of this name is written; symbolic links are followed. @throws Error (input) for a
/// folder, a device, a pipe, a socket, a broken link, or one of this process's standard streams.
std::filesystem::path file_target(const std::filesystem::path& path);

/// A temporary file name that no other process or file uses.
std::string part_name();
/// True for a file name that part_name made, or that begins with one.
bool is_part_name(std::string_view name);

/// Writes a whole file at once.
void write_file(const std::filesystem::path& path, std::string_view text);

/// Creates the folder and its parents. @throws Error (input) if it cannot be created or is not a folder.
void make_folder(const std::filesystem::path& path);

}  // namespace handsim::output
