// Lines of text on overlaps of shapes at the start.
#pragma once

#include <string>
#include <vector>

#include "handsim/engine/contact/overlap.h"

namespace handsim::app {

/// A line for each of the ten deepest pairs, deepest first, and the number of the others.
std::vector<std::string> overlap_texts(const model::Model& model, std::vector<engine::Overlap> overlaps);

}  // namespace handsim::app
