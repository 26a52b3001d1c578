#include "handsim/app/overlaps.h"

#include <algorithm>

#include <fmt/format.h>

namespace handsim::app {

std::vector<std::string> overlap_texts(const model::Model& model, std::vector<engine::Overlap> overlaps) {
  constexpr std::size_t kNamed = 10;
  std::stable_sort(overlaps.begin(), overlaps.end(),
                   [](const engine::Overlap& a, const engine::Overlap& b) { return a.depth > b.depth; });
  std::vector<std::string> out;
  for (std::size_t i = 0; i < std::min(overlaps.size(), kNamed); ++i)
    out.push_back(fmt::format("{} and {} overlap by {:.2g} mm at the start",
                              model.shapes[static_cast<std::size_t>(overlaps[i].shape_a)].name,
                              model.shapes[static_cast<std::size_t>(overlaps[i].shape_b)].name,
                              1e3 * overlaps[i].depth));
  if (overlaps.size() > kNamed)
    out.push_back(fmt::format("{} more pairs overlap, by less", overlaps.size() - kNamed));
  return out;
}

}  // namespace handsim::app
