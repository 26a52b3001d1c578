// An 8-bit RGB picture in memory and its PNG file; the ways to draw one without a display.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "handsim/core/index.h"

namespace handsim::output {

/// Rows from the top, three bytes a pixel.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
  std::string text = {};  ///< what the picture says, UTF-8; a PNG has it as its description

  const std::uint8_t* pixel(int x, int y) const {
    return &rgb[3 * (as_index(y) * as_index(width) + as_index(x))];
  }
};

/// @throws Error (input) in a build without pictures (HANDSIM_PICTURES), as all that draws in this folder, or
/// where the system has neither OSMesa nor EGL. The call loads the library that it finds.
void require_pictures();

/// Writes a PNG; the file appears under its name only when complete.
/// @throws Error (input) if the path cannot be written, Error (output) if the disk is full.
void write_png(const Image& image, const std::filesystem::path& path);

/// OSMesa: Mesa's own drawing into memory, which Mesa had until version 25.0. EGL: any driver, without a
/// surface; a machine without a graphics card has Mesa's, with the same pictures.
enum class Gl { osmesa, egl };

/// Name on the command line: `osmesa`, `egl`.
const char* name_of(Gl gl);
/// The ways to OpenGL of this build, the default first.
std::vector<Gl> built_gls();

}  // namespace handsim::output
