#include <csignal>

#include "handsim/app/commands.h"

int main(int argc, char** argv) {
  // A file that may grow no more is an error to tell, not the end of the process.
  static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
  return handsim::app::run_command_line(argc, argv);
}
