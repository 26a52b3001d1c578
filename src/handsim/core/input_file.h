// Reads regular files of limited size. Refuses pipes, devices and folders without opening them. All files
// that a user names, and those that an earlier command wrote, are opened here.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/error.h"

namespace handsim {

/// What one machine has read, for others that have none of these files.
struct CarriedFiles {
  std::filesystem::path folder;              ///< from which relative paths go
  std::map<std::string, std::string> files;  ///< contents by absolute path
};

/// While it lives, its thread reads the files that are carried in place of those on the disk.
class CarriedScope {
 public:
  /// @param files outlive it. @param keep whether what is read from the disk is added to them
  CarriedScope(CarriedFiles& files, bool keep);
  ~CarriedScope();
  CarriedScope(const CarriedScope&) = delete;
  CarriedScope& operator=(const CarriedScope&) = delete;
};

/// Without `.` and `..`; a relative path goes from the folder of the carried files, else from the process's
/// own.
std::filesystem::path absolute_path(const std::filesystem::path& path);

/// True for a regular file that is carried or on the disk.
bool is_file(const std::filesystem::path& path);

/// An open file that is read from its start to its end; links are followed.
class InputFile {
 public:
  /// @param need what is accepted, for messages, e.g. `a readable YAML file`. @param most_bytes largest size.
  /// @throws Error (input) at the first line of a missing, unreadable, irregular or larger file.
  InputFile(const std::filesystem::path& path, std::string_view need, std::size_t most_bytes);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  /// The file's size when it was opened; files of /proc report 0.
  std::size_t size() const { return size_; }
  /// The next bytes, at most `most`; returns their number, 0 at the end. @throws Error (input) as above.
  std::size_t read(char* to, std::size_t most);
  /// The next line, without its end; false at the file's end. @throws Error (input), also above kLongestLine
  bool line(std::string& text);
  /// True after a last line without its end, as in a file that was cut.
  bool cut() const { return cut_; }

 private:
  Error error(std::string got, std::string need) const;
  Error unreadable(const char* what) const;
  void check(unsigned mode) const;

  std::filesystem::path path_;
  std::string need_;
  std::size_t most_, size_ = 0, filled_ = 0;  ///< filled_: bytes read so far
  int number_ = -1;                           ///< descriptor
  std::vector<char> block_;                   ///< of line(): bytes from next_ on are unread
  std::size_t next_ = 0;
  int lines_ = 0;
  bool cut_ = false;
};

inline constexpr std::size_t kLongestLine = 16U << 20U;  ///< Bytes of a line at most.

/// All bytes of a file. @throws Error (input) as InputFile.
std::string read_input_file(const std::filesystem::path& path, std::string_view need, std::size_t most_bytes);

/// The text of a file, without the byte order mark that spreadsheets write before it. @throws Error (input)
/// as InputFile, and for UTF-16, by its mark
std::string read_text_file(const std::filesystem::path& path, std::string_view need, std::size_t most_bytes);

/// True if a folder has an entry of this name, of any kind: also a link without a target.
bool has_entry(const std::filesystem::path& path);

/// A size for messages: `64 MB` for whole MB (of 1024 kB), otherwise `10000000 bytes`.
std::string bytes_text(std::size_t bytes);

}  // namespace handsim
