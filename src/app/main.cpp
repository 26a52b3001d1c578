#include "handsim/app/commands.h"

int main(int argc, char** argv) { return handsim::app::run_command_line(argc, argv); }
