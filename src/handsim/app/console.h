// Prints results on standard output and messages on standard error. A stream that cannot be written (closed,
// full disk, closed terminal) neither ends a command nor throws; finish_output() reports lost output.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "handsim/study/study_run.h"

namespace handsim::app {

/// Opens standard streams that are closed: writing to them fails, no later file gets their number. Signals
/// of a closed pipe or terminal and of the limit on file sizes end no process: writing then fails.
void prepare_streams();

void print_text(std::string_view text);
/// Prints to standard error, unbuffered.
void print_error_text(std::string_view text);

template <class... Values>
void print(fmt::format_string<Values...> format, Values&&... values) {
  print_text(fmt::format(format, std::forward<Values>(values)...));
}

template <class... Values>
void print_error(fmt::format_string<Values...> format, Values&&... values) {
  print_error_text(fmt::format(format, std::forward<Values>(values)...));
}

/// Prints each to standard error in a line, after `warning: `.
void print_warnings(const std::vector<std::string>& warnings);

/// Flushes standard output; prints a loss. @returns the exit status, or 1 if that is 0 and output was lost
int finish_output(int status);

/// The text after `files in DIR` and the exit status, 1 if gnuplot fails; that it is missing is no failure.
struct PlotNote {
  std::string_view text;
  int status = 0;
};
PlotNote plot_note(bool plotted);

/// Prints a study's end, or its JSON. @param out folder of its files, or empty. @returns the exit status
int print_study(const study::StudyEnd& end, const std::filesystem::path& out, bool json = false);

}  // namespace handsim::app
