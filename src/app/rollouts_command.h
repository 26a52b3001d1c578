// The study that a command line names, for the commands that take one.
#pragma once

#include "handsim/app/commands.h"
#include "handsim/study/rollouts/rollouts_spec.h"

namespace handsim::app {

/// With the command line's changes. @throws Error (input) with every problem of the file.
study::RolloutsSpec rollouts_of(const RolloutsArguments& arguments);

}  // namespace handsim::app
