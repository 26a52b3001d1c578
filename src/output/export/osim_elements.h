// Elements of OpenSim's files. Private to this folder.
#pragma once

#include <string>

#include <fmt/format.h>

#include "handsim/engine/settings.h"
#include "handsim/model/model.h"
#include "handsim/model/state.h"

namespace handsim::output {

/// `<tag>text</tag>`
inline std::string element(const char* tag, const std::string& text) {
  return fmt::format("<{0}>{1}</{0}>", tag, text);
}
/// With all digits.
inline std::string element(const char* tag, double value) {
  return element(tag, fmt::format("{:.17g}", value));
}

/// Muscles and bands in effect, for the ForceSet: each length is one polynomial of its coordinates, exact
/// within its arms' range; OpenSim's arms are its derivatives. Welded coordinates stay at the start.
std::string osim_muscles(const model::Model& model, const engine::Settings& settings,
                         const model::State& start);

}  // namespace handsim::output
