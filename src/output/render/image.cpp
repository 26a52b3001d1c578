#include "handsim/output/render/image.h"

#include <png.h>

#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

namespace {

namespace fs = std::filesystem;

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

Error unreadable(const fs::path& path, const std::string& why) {
  return input_error(path.string(), fmt::format("a file that cannot be read ({})", why), "a PNG picture");
}

/// Keeps libpng's message and leaves by longjmp, as libpng is C and must not be left by an exception.
[[noreturn]] void on_png_error(png_structp png, png_const_charp message) {
  *static_cast<std::string*>(png_get_error_ptr(png)) = message;
  png_longjmp(png, 1);
}

void on_png_warning(png_structp, png_const_charp) {}

/// No exception may pass through libpng, which is C.
void on_png_bytes(png_structp png, png_bytep bytes, png_size_t size) {
  bool taken = true;
  try {
    static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(bytes), size);
  } catch (const std::bad_alloc&) {
    taken = false;
  }
  if (!taken) png_error(png, "out of memory");
}

void on_png_flush(png_structp) {}

/// True when all went well. Holds nothing that a longjmp would leak.
bool encode(png_structp png, png_infop info, std::string& out, const Image& image) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_write_fn(png, &out, on_png_bytes, on_png_flush);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), 8,
               PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
  png_write_info(png, info);
  for (int y = 0; y < image.height; ++y) png_write_row(png, image.pixel(0, y));
  png_write_end(png, info);
  return true;
}

/// Sizes the image; true when all went well.
bool decode_header(png_structp png, png_infop info, std::FILE* file, Image& image) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_init_io(png, file);
  png_read_info(png, info);
  // Any PNG becomes 8-bit RGB.
  png_set_expand(png);
  png_set_scale_16(png);
  png_set_strip_alpha(png);
  png_set_gray_to_rgb(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  image.width = static_cast<int>(png_get_image_width(png, info));
  image.height = static_cast<int>(png_get_image_height(png, info));
  return true;
}

bool decode_rows(png_structp png, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_read_image(png, rows);
  png_read_end(png, nullptr);
  return true;
}

}  // namespace

void write_png(const Image& image, const fs::path& path) {
  if (image.width < 1 || image.height < 1 ||
      image.rgb.size() != 3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
    throw input_error("image",
                      fmt::format("{} x {} pixels in {} bytes", image.width, image.height, image.rgb.size()),
                      "at least one pixel and three bytes for each");
  std::string message = "libpng cannot start", bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &message, on_png_error, on_png_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  const bool done = info != nullptr && encode(png, info, bytes, image);
  png_destroy_write_struct(&png, &info);
  if (!done) throw output_error(path.string(), "a picture that libpng cannot write: " + message, "memory");
  write_file(path, bytes);
}

Image read_png(const fs::path& path) {
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file) throw unreadable(path, std::strerror(errno));
  std::string message = "libpng cannot start";
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &message, on_png_error, on_png_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  Image image;
  bool done = info != nullptr && decode_header(png, info, file.get(), image);
  if (done) {
    const auto stride = 3 * static_cast<std::size_t>(image.width);
    image.rgb.resize(stride * static_cast<std::size_t>(image.height));
    std::vector<png_bytep> rows(static_cast<std::size_t>(image.height));
    for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = image.rgb.data() + y * stride;
    done = decode_rows(png, rows.data());
  }
  png_destroy_read_struct(&png, &info, nullptr);
  if (!done) throw unreadable(path, message);
  return image;
}

}  // namespace handsim::output
