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

/// Muscles and bands in effect, for the ForceSet. A tendon's length is one polynomial of all coordinates that
/// it crosses, exact within the range of its arms; OpenSim's moment arms are the polynomial's derivatives.
/// Coordinates of joints that are welded in the file keep their values of the start.
std::string osim_muscles(const model::Model& model, const engine::Settings& settings,
                         const model::State& start);

}  // namespace handsim::output
