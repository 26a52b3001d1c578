#include "handsim/app/console.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "handsim/output/table/gnuplot.h"

namespace handsim::app {

namespace {

/// errno of the first write to standard output that failed, or 0.
int& output_errno() {
  static int value = 0;
  return value;
}

void record_lost_output() {
  if (output_errno() == 0) output_errno() = errno;
}

}  // namespace

void prepare_streams() {
  // Child processes inherit ignored signals but not handlers: they keep the default of SIGPIPE.
  static_cast<void>(std::signal(SIGPIPE, [](int) {}));
  for (const int signal : {SIGHUP, SIGXFSZ}) static_cast<void>(std::signal(signal, SIG_IGN));
  // open() returns the lowest free number. A stream open for the wrong direction fails like a closed one.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (fcntl(stream, F_GETFD) == -1 && errno == EBADF)
      static_cast<void>(open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY));
}

void print_text(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) record_lost_output();
}

void print_error_text(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(STDERR_FILENO, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) print_error("warning: {}\n", warning);
}

int finish_output(int status) {
  if (std::fflush(stdout) != 0) record_lost_output();
  if (output_errno() == 0) return status;
  print_error_text("handsim: standard output was lost (");
  print_error_text(std::strerror(output_errno()));
  print_error_text(")\n");
  return status == 0 ? 1 : status;
}

PlotNote plot_note(bool plotted) {
  if (plotted) return {};
  if (!output::has_gnuplot()) return {" (no plots: gnuplot is missing; the .gp file is its script)", 0};
  return {" (no plots: gnuplot failed; the .gp file is its script)", 1};
}

int print_study(const study::StudyEnd& end, const std::filesystem::path& out, bool json) {
  const PlotNote note = plot_note(end.plotted);
  if (json) {
    print_text(end.json);
    if (note.status != 0) print_error("missing: plots{}\n", note.text);
    return note.status;
  }
  print_text(end.text);
  for (const std::string& what : end.missing) print_error("missing: {}\n", what);
  if (!out.empty()) print("files in {}{}\n", out.string(), note.text);
  return end.passed && end.missing.empty() ? note.status : 1;
}

}  // namespace handsim::app
