// The ways to draw without a display.
#pragma once

#include <vector>

namespace handsim::output {

/// OSMesa: Mesa's own drawing into memory, which Mesa had until version 25.0. EGL: any driver, without a
/// surface; a machine without a graphics card has Mesa's, with the same pictures.
enum class Gl { osmesa, egl };

/// Name on the command line: `osmesa`, `egl`.
const char* name_of(Gl gl);
/// Those of this build, the default first.
std::vector<Gl> built_gls();

}  // namespace handsim::output
