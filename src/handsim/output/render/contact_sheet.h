// Many pictures on one page, each with a caption, drawn when it is added: memory holds only the page.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "handsim/output/render/image.h"

namespace handsim::output {

/// The layout of a page.
struct SheetFormat {
  int cells = 1;        ///< pictures on the page, 1 to 1000
  int cell_width = 0;   ///< of every picture [pixels]
  int cell_height = 0;  ///< [pixels]
  std::string title;    ///< empty: no title
  int width = 1600;     ///< largest width of the page [pixels], 160..16384
  /// Length of the arrows of forces [m/N], for their legend; absent: none.
  std::optional<double> force_scale = {};
};

/// Pictures are in reading order, three to five in a row, scaled down (never up) to the format's width; long
/// captions end in an ellipsis. The page is narrower if the pictures do not need its width.
class ContactSheet {
 public:
  /// @throws Error (input) for a format out of range, or a page too large for memory.
  explicit ContactSheet(const SheetFormat& format);
  ~ContactSheet();

  /// Puts a picture into the next cell. @param caption e.g. `t = 0.25 s`, UTF-8.
  /// @param scale of the picture [pixels/m]: draws a scale bar into it, and an arrow of forces beside it.
  /// @throws Error (input) for a picture whose size is not the format's, or if all cells are full.
  void add(const Image& image, const std::string& caption, std::optional<double> scale = {});
  /// The page with the pictures so far; its text is the title and the captions, a line each. @throws Error
  /// (input) for a title or caption that is not UTF-8.
  Image image() const;

 private:
  struct Page;
  std::unique_ptr<Page> page_;
};

}  // namespace handsim::output
