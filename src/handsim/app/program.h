// The program handsim, as main() calls it.
#pragma once

namespace handsim::app {

/// @returns the exit status of the command in the words
int run_program(int argc, const char* const* argv);

}  // namespace handsim::app
