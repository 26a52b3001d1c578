// The output folder of a run or study. It is locked against other handsim processes while the object lives,
// checked before anything is computed, and cleared of earlier output. Other files in it are never changed.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace handsim::output {

class OutputFolder {
 public:
  /// Lists the input files; called only if output files of the same names exist.
  using Inputs = std::function<std::vector<std::filesystem::path>()>;

  /// Creates the folder if it is missing. The lock is a kernel lock (flock on the folder): it ends with the
  /// process. A file system without locks has none.
  /// @param names names of the files that will be written, relative; `*` and `[0-9]` as in a shell.
  /// @throws Error (input) if another process has locked the folder, if it cannot be written, or if one of
  ///         the names exists and is not a regular file, or is one of `inputs`.
  OutputFolder(std::filesystem::path path, std::vector<std::string> names, const Inputs& inputs = {});
  ~OutputFolder();
  OutputFolder(OutputFolder&& other) noexcept;
  OutputFolder& operator=(OutputFolder&&) = delete;

  /// Removes all files of these names, and temporary ones of killed processes. @throws Error (output)
  void clear() const;
  const std::filesystem::path& path() const { return path_; }

 private:
  void lock();
  /// The files of these names that exist, relative.
  std::vector<std::filesystem::path> present() const;
  void check(const Inputs& inputs) const;

  std::filesystem::path path_;
  std::vector<std::string> names_;
  int file_ = -1;  ///< descriptor of the folder, which holds the lock; -1 after a move
};

/// A kind of file that a command writes, and what the first kMarkBytes of each such file have.
struct FileKind {
  std::string_view name, mark;
};
inline constexpr std::size_t kMarkBytes = 1000;

/// Checks what may be written to the path of `--out`, `--video` and the like: a new file, or one in place of
/// an empty file or one of its kind; all else is the user's. @param option for messages. @throws Error
/// (input) for another file, one of the inputs, as file_target, and for a folder that cannot be written
void check_target(const std::string& option, const std::filesystem::path& path, const FileKind& kind,
                  const OutputFolder::Inputs& inputs = {});

}  // namespace handsim::output
