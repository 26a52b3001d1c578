// Many pictures on one page, each with a caption.
#pragma once

#include <string>
#include <vector>

#include "handsim/output/image.h"

namespace handsim::output {

struct SheetCell {
  Image image;          ///< all cells share one size
  std::string caption;  ///< e.g. `t = 0.25 s`
};

/// Cells in reading order, about four to a row, scaled down (never up) to fit `width` pixels, 160..16384;
/// captions that are too long end in an ellipsis. The page is narrower where the cells do not fill it.
/// @throws Error (input) for no cells, cells of different sizes, or a width out of range.
Image contact_sheet(const std::vector<SheetCell>& cells, const std::string& title, int width = 1600);

}  // namespace handsim::output
