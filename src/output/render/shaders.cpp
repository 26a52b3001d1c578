#include "handsim/output/render/shaders.h"

#include <fmt/format.h>

namespace handsim::output {

std::string shader_constants() {
  return fmt::format("const int kMaxOccluders = {};\nconst float kLightSize = {}, kSkyReach = {};\n",
                     kMaxOccluders, kLightSize, kSkyReach);
}

}  // namespace handsim::output
