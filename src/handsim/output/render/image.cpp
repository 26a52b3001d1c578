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

namespace {

/// Four bytes, the most significant first.
std::string big_endian(std::uint32_t number) {
  std::string out;
  for (const int shift : {24, 16, 8, 0}) out += static_cast<char>((number >> shift) & 0xFFU);
  return out;
}

/// A chunk of a PNG file with a text in UTF-8 (PNG, third edition, 11.3.3).
std::string description(const std::string& text) {
  const std::string body = "iTXtDescription" + std::string(5, '\0') + text;
  std::uint32_t sum = 0xFFFFFFFFU;  // CRC-32
  for (const char c : body) {
    sum ^= static_cast<std::uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) sum = (sum >> 1U) ^ ((sum & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return big_endian(static_cast<std::uint32_t>(body.size() - 4)) + body + big_endian(~sum);
}

}  // namespace

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
  constexpr std::size_t kHead = 33;  // signature and first chunk
  if (!image.text.empty()) bytes.insert(kHead, description(image.text));
  write_file(path, bytes);
}

}  // namespace handsim::output
