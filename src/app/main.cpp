#include "handsim/app/commands.h"
#include "handsim/app/console.h"

int main(int argc, char** argv) {
  handsim::app::prepare_streams();
  return handsim::app::finish_output(handsim::app::run_command_line(argc, argv));
}
