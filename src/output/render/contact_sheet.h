// Many pictures on one page, each with a caption. Pictures are drawn onto the page as they come, so that a
// page of many never holds more than itself.
#pragma once

#include <memory>
#include <string>

#include "handsim/output/render/image.h"

namespace handsim::output {

/// What a page is made for.
struct SheetFormat {
  int cells = 1;        ///< pictures on the page, 1 to 1000
  int cell_width = 0;   ///< of every picture [pixels]
  int cell_height = 0;  ///< [pixels]
  std::string title;    ///< empty: none
  int width = 1600;     ///< that the page may have [pixels], 160..16384
};

/// Cells in reading order, about four to a row, scaled down (never up) to fit the format's width; captions
/// that are too long end in an ellipsis. The page is narrower where the cells do not fill it.
class ContactSheet {
 public:
  /// @throws Error (input) for a format out of range, or a page too large for memory.
  explicit ContactSheet(const SheetFormat& format);
  ~ContactSheet();

  /// Puts a picture into the next cell. @param caption e.g. `t = 0.25 s`, UTF-8.
  /// @throws Error (input) for a picture of another size than the format's, or one too many.
  void add(const Image& image, const std::string& caption);
  /// The page as it stands. @throws Error (input) for a title or caption that is not UTF-8.
  Image image() const;

 private:
  struct Page;
  std::unique_ptr<Page> page_;
};

}  // namespace handsim::output
