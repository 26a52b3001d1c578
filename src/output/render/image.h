// An 8-bit RGB picture in memory and its PNG file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace handsim::output {

/// Rows from the top, three bytes a pixel.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;

  const std::uint8_t* pixel(int x, int y) const {
    return &rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(x))];
  }
};

/// @throws Error (input) in a build without pictures (CMake option HANDSIM_PICTURES); every drawing function
///         of this folder throws the same error there.
void require_pictures();

/// Writes a PNG; the file appears under its name only when complete.
/// @throws Error (input) if the path cannot be written, Error (output) if the disk is full.
void write_png(const Image& image, const std::filesystem::path& path);

}  // namespace handsim::output
