// Planted: a source of model/ that looks up into the engines. With the include paths of model/ it must not
// compile; with HANDSIM_RIGHT it does.
#ifdef HANDSIM_RIGHT
#include "handsim/core/pose.h"
#else
#include "handsim/engine/engine.h"
#endif
