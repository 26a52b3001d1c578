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

/// Of the first write to standard output that failed; 0: none has.
int& lost() {
  static int cause = 0;
  return cause;
}

void remember_loss() {
  if (lost() == 0) lost() = errno;
}

}  // namespace

void prepare_streams() {
  // Programs that handsim starts inherit what is ignored, and not what is handled.
  static_cast<void>(std::signal(SIGPIPE, [](int) {}));
  for (const int signal : {SIGHUP, SIGXFSZ}) static_cast<void>(std::signal(signal, SIG_IGN));
  // The lowest free number is the one that is given. What is open the wrong way round fails as closed would.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (fcntl(stream, F_GETFD) == -1 && errno == EBADF)
      static_cast<void>(open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY));
}

void print_text(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) remember_loss();
}

void tell_text(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(STDERR_FILENO, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

void tell_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) tell("warning: {}\n", warning);
}

int finish_output(int status) {
  if (std::fflush(stdout) != 0) remember_loss();
  if (lost() == 0) return status;
  tell_text("handsim: standard output was lost (");
  tell_text(std::strerror(lost()));
  tell_text(")\n");
  return status == 0 ? 1 : status;
}

PlotNote plot_note(bool plotted) {
  if (plotted) return {};
  if (!output::has_gnuplot()) return {" (no plots: gnuplot is missing; the .gp file is its script)", 0};
  return {" (no plots: gnuplot failed; the .gp file is its script)", 1};
}

}  // namespace handsim::app
