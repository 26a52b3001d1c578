// Overlaps of shapes at the start, as lines for people.
#pragma once

#include <string>
#include <vector>

#include "handsim/engine/contact/overlap.h"

namespace handsim::app {

/// A line for each pair, the deepest first; of more than ten, how many more there are.
std::vector<std::string> overlap_texts(const model::Model& model, std::vector<engine::Overlap> overlaps);

}  // namespace handsim::app
