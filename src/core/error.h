// What can go wrong, as one type: `handsim::Error`. Input problems carry the place in the file, what
// was found and what was needed, many at once; physics faults carry time, body or joint, quantity and
// value. Nothing in handsim aborts the process and nothing is thrown but this (and std::bad_alloc).
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

/// A simulation that went wrong.
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

/// Most problems that are reported; nobody reads more.
inline constexpr std::size_t kMostProblems = 1000;

/// The only exception type of handsim.
class Error : public std::runtime_error {
 public:
  /// Problems of input or output, at least one. Keeps the first kMostProblems and says how many more there
  /// are.
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
/// The same of an output.
Error output_error(std::string key, std::string got, std::string need);

}  // namespace handsim
