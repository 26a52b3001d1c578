#include "handsim/output/render/contact_sheet.h"

#include <cairo.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::output {

namespace {

struct FreeSurface {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
struct FreePen {
  void operator()(cairo_t* pen) const { cairo_destroy(pen); }
};
using Surface = std::unique_ptr<cairo_surface_t, FreeSurface>;
using Pen = std::unique_ptr<cairo_t, FreePen>;

/// Sizes of the page [pixels].
struct Layout {
  int columns, rows;
  int margin, gap;
  int cell_width, cell_height;
  int title_height, caption_height;
  int width, height;
};

/// Most and fewest cells in a row of a page with several rows.
constexpr int kWidestRow = 5;
constexpr int kNarrowestRow = 3;

/// Number of columns, 4, 3 or 5, with the fewest empty cells; in a tie the first of these.
int columns_for(int cells) {
  if (cells <= kWidestRow) return cells;
  int best = 4;
  for (const int columns : {kNarrowestRow, kWidestRow})
    if ((columns - cells % columns) % columns < (best - cells % best) % best) best = columns;
  return best;
}

Layout layout_of(const SheetFormat& format) {
  const int width = format.width;
  Layout page{};
  page.columns = columns_for(format.cells);
  page.rows = (format.cells + page.columns - 1) / page.columns;
  page.margin = std::max(8, width / 50);
  page.gap = std::max(4, width / 100);
  const int room = (width - 2 * page.margin - (page.columns - 1) * page.gap) / page.columns;
  // Pictures are only ever made smaller.
  page.cell_width = std::min(room, format.cell_width);
  page.cell_height = std::max(1, static_cast<int>(std::lround(static_cast<double>(format.cell_height) *
                                                              page.cell_width / format.cell_width)));
  page.title_height = format.title.empty() ? 0 : std::max(24, width / 26);
  page.caption_height = std::max(16, width / 50);
  page.width = 2 * page.margin + page.columns * page.cell_width + (page.columns - 1) * page.gap;
  page.height = 2 * page.margin + page.title_height + page.rows * (page.cell_height + page.caption_height) +
                (page.rows - 1) * page.gap;
  return page;
}

void check(const SheetFormat& format) {
  if (format.cells < 1 || format.cells > 1000)
    throw input_error("contact sheet", fmt::format("{} pictures", format.cells), "1 to 1000");
  if (format.cell_width < 1 || format.cell_height < 1)
    throw input_error("contact sheet", fmt::format("{} x {} pixels", format.cell_width, format.cell_height),
                      "pictures of at least one pixel");
  if (format.width < 160 || format.width > 16384)
    throw input_error("contact sheet width", fmt::format("{}", format.width), "160..16384 pixels");
}

/// cairo's pixels are 32-bit words 0x00RRGGBB, rows `stride` bytes apart.
Surface surface_of(const Image& image) {
  Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, image.width, image.height));
  if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS)
    throw input_error("contact sheet", cairo_status_to_string(cairo_surface_status(surface.get())),
                      "a page that fits cairo");
  cairo_surface_flush(surface.get());
  unsigned char* data = cairo_image_surface_get_data(surface.get());
  const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(surface.get()));
  for (int y = 0; y < image.height && !image.rgb.empty(); ++y) {
    auto* row = reinterpret_cast<std::uint32_t*>(data + static_cast<std::size_t>(y) * stride);
    const std::uint8_t* from = image.pixel(0, y);
    for (int x = 0; x < image.width; ++x, from += 3)
      row[x] = static_cast<std::uint32_t>(from[0] << 16 | from[1] << 8 | from[2]);
  }
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

Image image_of(cairo_surface_t* surface) {
  cairo_surface_flush(surface);
  Image image{cairo_image_surface_get_width(surface), cairo_image_surface_get_height(surface), {}};
  image.rgb.reserve(3UL * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  const unsigned char* data = cairo_image_surface_get_data(surface);
  const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(surface));
  for (int y = 0; y < image.height; ++y) {
    const auto* row = reinterpret_cast<const std::uint32_t*>(data + static_cast<std::size_t>(y) * stride);
    for (int x = 0; x < image.width; ++x)
      for (const int shift : {16, 8, 0}) image.rgb.push_back(static_cast<std::uint8_t>(row[x] >> shift));
  }
  return image;
}

/// Shortens the text (UTF-8) with an ellipsis until it fits [pixels].
std::string fitted(cairo_t* pen, const std::string& text, double room) {
  const auto fits = [&](const std::string& s) {
    cairo_text_extents_t extents;
    cairo_text_extents(pen, s.c_str(), &extents);
    return extents.x_advance <= room;
  };
  // More bytes than any page can show.
  constexpr std::size_t kLongest = 4096;
  if (text.size() <= kLongest && fits(text)) return text;
  // Cuts between characters: continuation bytes of UTF-8 stay with their first byte.
  std::vector<std::size_t> cuts;
  for (std::size_t at = 0; at < std::min(text.size(), kLongest); ++at)
    if ((static_cast<unsigned char>(text[at]) & 0xC0U) != 0x80U) cuts.push_back(at);
  // The width grows with the length: bisection finds the first cut that does not fit.
  const auto first_too_wide = std::partition_point(
      cuts.begin(), cuts.end(), [&](std::size_t cut) { return fits(text.substr(0, cut) + "…"); });
  return text.substr(0, first_too_wide == cuts.begin() ? 0 : *(first_too_wide - 1)) + "…";
}

struct TextStyle {
  double size;  ///< of the font [pixels]
  cairo_font_weight_t weight;
  double grey;
};

/// Text with its left end and baseline at x, y.
void write(cairo_t* pen, const std::string& text, double x, double y, double room, const TextStyle& style) {
  cairo_select_font_face(pen, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, style.weight);
  cairo_set_font_size(pen, style.size);
  cairo_set_source_rgb(pen, style.grey, style.grey, style.grey);
  cairo_move_to(pen, x, y);
  cairo_show_text(pen, fitted(pen, text, room).c_str());
}

void put_cell(cairo_t* pen, const Image& image, const std::string& caption, const Layout& page, int x,
              int y) {
  const Surface picture = surface_of(image);
  cairo_save(pen);
  cairo_rectangle(pen, x, y, page.cell_width, page.cell_height);
  cairo_clip(pen);
  cairo_translate(pen, x, y);
  cairo_scale(pen, static_cast<double>(page.cell_width) / image.width,
              static_cast<double>(page.cell_height) / image.height);
  cairo_set_source_surface(pen, picture.get(), 0, 0);
  cairo_pattern_set_filter(cairo_get_source(pen), CAIRO_FILTER_BEST);
  // Without padding the edge of the picture blends into the page.
  cairo_pattern_set_extend(cairo_get_source(pen), CAIRO_EXTEND_PAD);
  cairo_paint(pen);
  cairo_restore(pen);
  write(pen, caption, x + 1, y + page.cell_height + 0.74 * page.caption_height, page.cell_width - 2,
        {0.52 * page.caption_height, CAIRO_FONT_WEIGHT_NORMAL, 0.25});
}

/// The largest of 1, 2 and 5 times a power of ten that is not above a number.
double round_below(double most) {
  const double decade = std::pow(10, std::floor(std::log10(most)));
  return decade * (most >= 5 * decade ? 5 : most >= 2 * decade ? 2 : 1);
}

/// A line from x to the right, with its text after it. @param head with the head of an arrow.
/// @returns where the text ends.
double legend(cairo_t* pen, double x, double y, double length, const std::string& text, double size,
              bool head) {
  const double thick = std::max(1.5, 0.14 * size), tip = 3.2 * thick;
  cairo_set_line_width(pen, thick);
  cairo_move_to(pen, x, y);
  cairo_line_to(pen, x + length - (head ? tip : 0), y);
  for (const double end : {x, x + length}) {
    cairo_move_to(pen, end, y - 2 * thick);
    if (!head) cairo_line_to(pen, end, y + 2 * thick);
  }
  cairo_stroke(pen);
  if (head) {
    cairo_move_to(pen, x + length, y);
    cairo_line_to(pen, x + length - tip, y - 0.45 * tip);
    cairo_line_to(pen, x + length - tip, y + 0.45 * tip);
    cairo_fill(pen);
  }
  cairo_select_font_face(pen, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(pen, size);
  cairo_move_to(pen, x + length + 0.5 * size, y + 0.36 * size);
  cairo_show_text(pen, text.c_str());
  cairo_text_extents_t extents;
  cairo_text_extents(pen, text.c_str(), &extents);
  return x + length + 0.5 * size + extents.x_advance;
}

/// Draws the scale bar, and the arrow of a force, in the lower left corner of a cell. @param scale of the
/// cell on the page [pixels/m].
void put_scale(cairo_t* pen, const Layout& page, int x, int y, double scale, std::optional<double> force) {
  constexpr double kShare = 0.22;  // of the cell's width at most
  const double size = 0.46 * page.caption_height;
  const double line = y + page.cell_height - size, left = x + 0.7 * size;
  const double bar = round_below(kShare * page.cell_width / scale);
  const std::string length = bar < 1 ? fmt::format("{:g} mm", 1e3 * bar) : fmt::format("{:g} m", bar);
  cairo_set_source_rgb(pen, 0.15, 0.16, 0.18);
  const double end = legend(pen, left, line, bar * scale, length, size, false);
  if (!force) return;
  const double newtons = round_below(kShare * page.cell_width / (scale * *force));
  // The arrows' colour in draw lists, converted to sRGB.
  cairo_set_source_rgb(pen, 0.88, 0, 0.63);
  legend(pen, end + 1.5 * size, line, newtons * *force * scale, fmt::format("{:g} N", newtons), size, true);
}

}  // namespace

struct ContactSheet::Page {
  explicit Page(const SheetFormat& asked)
      : format(asked),
        layout(layout_of(asked)),
        surface(surface_of({layout.width, layout.height, {}})),
        pen(cairo_create(surface.get())) {}
  SheetFormat format;
  Layout layout;
  Surface surface;
  Pen pen;
  int cells = 0;  ///< number of filled cells
  std::string text = format.title + "\n";
};

ContactSheet::ContactSheet(const SheetFormat& format) {
  check(format);
  page_ = std::make_unique<Page>(format);
  cairo_t* pen = page_->pen.get();
  const Layout& page = page_->layout;
  cairo_set_source_rgb(pen, 1, 1, 1);
  cairo_paint(pen);
  write(pen, format.title, page.margin, page.margin + 0.5 * page.title_height, page.width - 2 * page.margin,
        {0.46 * page.title_height, CAIRO_FONT_WEIGHT_BOLD, 0.1});
}

ContactSheet::~ContactSheet() = default;

void ContactSheet::add(const Image& image, const std::string& caption, std::optional<double> scale) {
  const SheetFormat& format = page_->format;
  const auto bytes =
      3UL * static_cast<std::size_t>(format.cell_width) * static_cast<std::size_t>(format.cell_height);
  if (image.width != format.cell_width || image.height != format.cell_height || image.rgb.size() != bytes)
    throw input_error(
        fmt::format("picture `{}` of the contact sheet", caption),
        fmt::format("{} x {} pixels", image.width, image.height),
        fmt::format("{} x {} pixels, the sheet's cell size", format.cell_width, format.cell_height));
  if (page_->cells == format.cells)
    throw input_error("contact sheet", "one picture too many", fmt::format("{} pictures", format.cells));
  const Layout& page = page_->layout;
  const int column = page_->cells % page.columns, row = page_->cells / page.columns;
  const int x = page.margin + column * (page.cell_width + page.gap);
  const int y = page.margin + page.title_height + row * (page.cell_height + page.caption_height + page.gap);
  put_cell(page_->pen.get(), image, caption, page, x, y);
  if (scale && *scale > 0)
    put_scale(page_->pen.get(), page, x, y, *scale * page.cell_width / image.width, format.force_scale);
  page_->text += caption + "\n";
  ++page_->cells;
}

Image ContactSheet::image() const {
  if (cairo_status(page_->pen.get()) != CAIRO_STATUS_SUCCESS)
    throw input_error("contact sheet", cairo_status_to_string(cairo_status(page_->pen.get())),
                      "captions and title in UTF-8, and a page that fits memory");
  Image out = image_of(page_->surface.get());
  out.text = page_->text;
  return out;
}

}  // namespace handsim::output
