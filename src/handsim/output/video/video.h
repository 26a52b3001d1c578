// Video files: raw frames go through a socket to ffmpeg's program, which writes an MP4 (H.264) or a GIF.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>

#include "handsim/output/output_folder.h"
#include "handsim/output/render/image.h"

namespace handsim::output {

/// Frames in a second at most: a GIF counts time in 1/100 s.
inline constexpr double kMostFps = 240, kMostGifFps = 50;

struct VideoFormat {
  std::filesystem::path file;  ///< .mp4 or .gif
  int width = 0;               ///< of every frame [pixels]; an MP4 of an odd size gets a grey line more
  int height = 0;              ///< [pixels]
  double fps = 30;             ///< frames in a second
};

/// Finds what would fail after a run. @throws Error (input) for an ending but .mp4 and .gif, `fps` out of 0
/// to kMostFps (GIF: kMostGifFps), a file that must stay (check_target) or cannot be written, no ffmpeg
void check_video(const std::filesystem::path& file, double fps, const OutputFolder::Inputs& inputs = {});

/// The file appears under its name only when it is complete.
class VideoWriter {
 public:
  /// Starts ffmpeg. @throws Error as check_video does, and for a size below 16 pixels.
  explicit VideoWriter(const VideoFormat& format);
  /// Removes the file if it was not finished.
  ~VideoWriter();

  /// @throws Error (input) for a picture of another size, Error (output) if ffmpeg has ended.
  void add(const Image& image);
  /// Waits for ffmpeg. @throws Error (output) with ffmpeg's own words if it fails.
  void finish();

 private:
  struct Encoder;
  std::unique_ptr<Encoder> encoder_;
};

using MakeImage = std::function<Image(std::size_t)>;  ///< Makes picture i of a sequence.

/// Makes pictures in threads and passes them on in order: thread k makes pictures k, k + threads, ...
/// @param maker called once in each thread, for what its pictures share, such as a Renderer.
/// @param take called in this thread.
/// @throws what a thread or `take` throws.
void make_in_order(std::size_t count, int threads, const std::function<MakeImage()>& maker,
                   const std::function<void(std::size_t, Image&&)>& take);

/// Processor cores that this process may use.
int core_count();

}  // namespace handsim::output
