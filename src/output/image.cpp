#include "handsim/output/image.h"

#include <png.h>
#include <unistd.h>

#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::output {

namespace {

namespace fs = std::filesystem;

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

/// Deletes a file that did not become complete.
class TemporaryFile {
 public:
  explicit TemporaryFile(fs::path path) : path_(std::move(path)) {}
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    std::error_code ignored;
    if (!kept_) fs::remove(path_, ignored);
  }
  void keep() { kept_ = true; }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
  bool kept_ = false;
};

Error unwritable(const fs::path& path, const std::string& why) {
  return input_error(path.string(), fmt::format("a path that cannot be written ({})", why),
                     "a file name in an existing folder that can be written");
}

Error unreadable(const fs::path& path, const std::string& why) {
  return input_error(path.string(), fmt::format("a file that cannot be read ({})", why), "a PNG picture");
}

/// Keeps libpng's message and leaves by longjmp, as libpng is C and must not be left by an exception.
[[noreturn]] void on_png_error(png_structp png, png_const_charp message) {
  *static_cast<std::string*>(png_get_error_ptr(png)) = message;
  png_longjmp(png, 1);
}

void on_png_warning(png_structp, png_const_charp) {}

/// True when all went well. Holds nothing that a longjmp would leak.
bool encode(png_structp png, png_infop info, std::FILE* file, const Image& image) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_init_io(png, file);
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

void write_rows(const Image& image, std::FILE* file, const fs::path& path) {
  std::string message = "libpng cannot start";
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &message, on_png_error, on_png_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  const bool done = info != nullptr && encode(png, info, file, image);
  png_destroy_write_struct(&png, &info);
  if (!done) throw unwritable(path, message);
}

}  // namespace

void write_png(const Image& image, const fs::path& path) {
  if (image.width < 1 || image.height < 1 ||
      image.rgb.size() != 3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
    throw input_error("image",
                      fmt::format("{} x {} pixels in {} bytes", image.width, image.height, image.rgb.size()),
                      "at least one pixel and three bytes for each");
  if (fs::is_directory(path)) throw unwritable(path, "it is a folder");
  TemporaryFile temporary(path.string() + fmt::format(".{}.partial", ::getpid()));
  File file(std::fopen(temporary.path().c_str(), "wb"));
  if (!file) throw unwritable(path, std::strerror(errno));
  write_rows(image, file.get(), path);
  if (std::fclose(file.release()) != 0) throw unwritable(path, std::strerror(errno));
  std::error_code failure;
  fs::rename(temporary.path(), path, failure);
  if (failure) throw unwritable(path, failure.message());
  temporary.keep();
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
