#include "handsim/output/render/image.h"

#include <png.h>

#include <fmt/format.h>

#include "handsim/core/data_folder.h"
#include "handsim/core/error.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

#ifdef HANDSIM_BUNDLED_FONTS
// A wheel has fonts: src/packaging/bundled_fonts.c.
extern "C" void handsim_font_file(bool bold, char* path, std::size_t room) {
  const char* const name = bold ? "fonts/DejaVuSans-Bold.ttf" : "fonts/DejaVuSans.ttf";
  path[(data_folder() / name).string().copy(path, room - 1)] = '\0';
}
#endif

void write_png(const Image& image, const std::filesystem::path& path) {
  if (image.width < 1 || image.height < 1 ||
      image.rgb.size() != 3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
    throw input_error("image",
                      fmt::format("{} x {} pixels in {} bytes", image.width, image.height, image.rgb.size()),
                      "at least one pixel and three bytes for each");
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr) == 0)
    throw output_error(path.string(), std::string("a picture that libpng cannot write: ") + png.message,
                       "memory");
  bytes.resize(size);
  write_file(path, bytes);
}

}  // namespace handsim::output
