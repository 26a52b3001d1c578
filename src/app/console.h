// What the program prints: results on standard output, messages on standard error. A channel that cannot be
// written (closed, a full disk, a terminal that is gone) never ends a command nor throws; what was lost on
// standard output is remembered.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace handsim::app {

/// Puts streams that the program was started without in a state in which they can be written to and fail, so
/// that no file that is opened later takes their number. A reader of a pipe or a terminal that goes away, and
/// a file that may not grow, are errors to report and not the end of the process.
void prepare_streams();

/// To standard output.
void print_text(std::string_view text);
/// To standard error, at once.
void tell_text(std::string_view text);

template <class... Values>
void print(fmt::format_string<Values...> format, Values&&... values) {
  print_text(fmt::format(format, std::forward<Values>(values)...));
}

template <class... Values>
void tell(fmt::format_string<Values...> format, Values&&... values) {
  tell_text(fmt::format(format, std::forward<Values>(values)...));
}

/// Each in a line, after `warning: `.
void tell_warnings(const std::vector<std::string>& warnings);

/// Writes out what is still buffered. @return the command's exit status; 1, and a message, where it was 0 and
/// something on standard output was lost.
int finish_output(int status);

/// Of a study with plots by gnuplot: what stands behind `files in DIR`, and the exit status. A missing
/// gnuplot is no failure, one that fails is.
struct PlotNote {
  std::string_view text;
  int status = 0;
};
PlotNote plot_note(bool plotted);

}  // namespace handsim::app
