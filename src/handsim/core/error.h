// The one exception type of handsim. An input error lists all problems, each with the place in the file,
// the value found and the value needed; a physics fault has time, body or joint, quantity and value.
// handsim never aborts the process, and throws only this type and std::bad_alloc.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace handsim {

/// A place in a text file; line and column count from 1.
struct Place {
  std::string file;
  int line = 1;
  int column = 1;

  /// `file:line:column: `; empty for a place in no file.
  std::string text() const;
};

/// One thing wrong with an input, printed as `file:line:column: key: got X, need Y`.
struct Problem {
  std::optional<Place> place;  ///< absent for problems outside any file
  std::string key;             ///< dotted path, e.g. `hands.0.wrist.position`; may be empty
  std::string got;             ///< what was found
  std::string need;            ///< what would have been accepted

  std::string text() const;
};

/// A simulation that failed.
struct PhysicsFault {
  double time = 0;       ///< simulated time [s]
  std::string where;     ///< name of the body or joint
  std::string quantity;  ///< what left its bounds, with unit
  std::string detail;    ///< value, bound and remedy
};

enum class ErrorKind {
  input,    ///< a file, key, number or argument is wrong: exit status 2
  physics,  ///< the simulation diverged: exit status 1
  output,   ///< a file could not be written, e.g. the disk is full: exit status 1
};

inline constexpr std::size_t kMostProblems = 1000;  ///< Largest number of problems that are reported.

class Error : public std::runtime_error {
 public:
  /// At least one problem of input or output. Keeps the first kMostProblems and the number of the others.
  explicit Error(std::vector<Problem> problems, ErrorKind kind = ErrorKind::input);
  explicit Error(PhysicsFault fault);

  ErrorKind kind() const { return kind_; }
  /// Empty for a physics fault.
  const std::vector<Problem>& problems() const { return problems_; }
  /// Set for a physics fault.
  const std::optional<PhysicsFault>& fault() const { return fault_; }

 private:
  ErrorKind kind_;
  std::vector<Problem> problems_;
  std::optional<PhysicsFault> fault_;
};

/// An input error outside any file: `key: got X, need Y`.
Error input_error(std::string key, std::string got, std::string need);
/// An output error of the same form.
Error output_error(std::string key, std::string got, std::string need);

}  // namespace handsim
