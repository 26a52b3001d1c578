// A PNG file as an Image, for tests that compare pictures.
#pragma once

#include <png.h>

#include <filesystem>
#include <stdexcept>

#include "handsim/output/render/image.h"

namespace handsim::test {

/// @throws std::runtime_error with libpng's words where the file is missing or no whole PNG.
inline output::Image read_png(const std::filesystem::path& path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  output::Image image;
  bool good = png_image_begin_read_from_file(&png, path.c_str()) != 0;
  png.format = PNG_FORMAT_RGB;
  if (good) image.rgb.resize(PNG_IMAGE_SIZE(png));
  image.width = static_cast<int>(png.width);
  image.height = static_cast<int>(png.height);
  good = good && png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr) != 0;
  png_image_free(&png);
  if (!good) throw std::runtime_error(path.string() + ": " + png.message);
  return image;
}

}  // namespace handsim::test
