#include "handsim/app/program.h"

int main(int argc, char** argv) { return handsim::app::run_program(argc, argv); }
