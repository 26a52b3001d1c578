// The folder that a run or study writes into: held against every other handsim as long as the object lives,
// checked before anything is computed, and emptied of what an earlier one has left. Files that handsim does
// not write there are never touched.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace handsim::output {

class OutputFolder {
 public:
  /// Names the files that are read, only asked for where some would be replaced.
  using Inputs = std::function<std::vector<std::filesystem::path>()>;

  /// Makes the folder where it is missing. The lock is the kernel's (flock on the folder itself): it is gone
  /// with the process, however that ends. On a file system without locks there is none.
  /// @param names of the files that will be written, relative; `*` and `[0-9]` as in a shell.
  /// @throws Error (input) where another process holds the folder; where it cannot be written; where under
  ///         one of the names stands what is no regular file, or one of `inputs`.
  OutputFolder(std::filesystem::path path, std::vector<std::string> names, const Inputs& inputs = {});
  ~OutputFolder();
  OutputFolder(OutputFolder&& other) noexcept;
  OutputFolder& operator=(OutputFolder&&) = delete;

  /// Removes all files of these names, and parts that a killed process has left.
  /// @throws Error (output) where that fails.
  void clear() const;
  const std::filesystem::path& path() const { return path_; }

 private:
  void lock();
  /// Of the names' files, those that are there, relative.
  std::vector<std::filesystem::path> present() const;
  void check(const Inputs& inputs) const;

  std::filesystem::path path_;
  std::vector<std::string> names_;
  int file_ = -1;  ///< the folder itself, which has the lock
};

/// @throws Error (input) where a single file that is to be written is one of those read.
void check_not_read(const std::filesystem::path& path, const OutputFolder::Inputs& inputs);

}  // namespace handsim::output
