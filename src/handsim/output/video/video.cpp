#include "handsim/output/video/video.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <future>
#include <iterator>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/text.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"

namespace handsim::output {

namespace {

namespace fs = std::filesystem;
constexpr std::size_t kLongestReport = 400;

bool is_gif(const fs::path& file) { return lower_case(file.extension().string()) == ".gif"; }

int memory_file() { return memfd_create("handsim", MFD_CLOEXEC); }

/// Set by the Python package where imageio-ffmpeg has one and the path has none.
std::string ffmpeg() {
  const char* const other = std::getenv("HANDSIM_FFMPEG");
  return other ? other : "ffmpeg";
}

bool has_ffmpeg() {
  const int nothing = memory_file();
  const bool good = wait_for(start_program({ffmpeg(), "-version"}, ".", nothing, nothing)) == 0;
  close(nothing);
  return good;
}

Error no_ffmpeg() {
  return input_error("--video", "no program ffmpeg that works",
                     "Debian package ffmpeg, or pip install imageio-ffmpeg for the Python package");
}

std::vector<std::string> words_of(const VideoFormat& format, const fs::path& part) {
  // Without -xerror a disk that is full at the end is no failure.
  const std::string input =
      fmt::format("-v error -xerror -nostdin -y -f rawvideo -pix_fmt rgb24 -s {}x{} -r {:.9g} -i pipe:0 -an ",
                  format.width, format.height, format.fps);
  // GIF: a palette for each frame; one for all would need all frames in memory. MP4: players everywhere read
  // 4:2:0, which needs even sizes; the index at the front lets them start at once.
  std::istringstream all(input +
                         (is_gif(format.file)
                              ? "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse="
                                "new=1:dither=bayer:bayer_scale=4 -loop 0 -f gif"
                              : "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2:color=0xD8DCE1 -c:v libx264 "
                                "-preset veryfast -crf 18 -pix_fmt yuv420p -movflags +faststart -f mp4"));
  std::vector<std::string> words{ffmpeg()};
  words.insert(words.end(), std::istream_iterator<std::string>(all), {});
  words.push_back("file:" + part.string());
  return words;
}

}  // namespace

struct VideoWriter::Encoder {
  VideoFormat format;
  fs::path target, part;
  int frames = -1;  ///< our end of the socket
  int errors = -1;  ///< ffmpeg's standard error
  std::optional<pid_t> process;

  void close_frames() {
    if (frames >= 0) close(std::exchange(frames, -1));
  }
  /// Ends the input, waits, and tells whether all is well.
  bool end() {
    close_frames();
    return wait_for(std::exchange(process, std::nullopt)) == 0;
  }
  [[noreturn]] void fail() {
    end();
    std::string text(kLongestReport, '\0');
    const ssize_t got = pread(errors, text.data(), text.size(), 0);
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    throw output_error(
        format.file.string(),
        "ffmpeg ended: " + (text.empty() ? "no reason given" : printable(text, kLongestReport)),
        "room on the disk, and an ffmpeg with libx264");
  }
};

void check_video(const fs::path& file, double fps, const OutputFolder::Inputs& inputs) {
  const std::string ending = lower_case(file.extension().string());
  if (ending != ".mp4" && ending != ".gif")
    throw input_error("--video", file.string(), "a name that ends in .mp4 or .gif");
  const double most = is_gif(file) ? kMostGifFps : kMostFps;
  if (!(fps > 0 && fps <= most))
    throw input_error("--fps", fmt::format("{:g}", fps),
                      fmt::format("above 0, at most {:g} in {}", most, is_gif(file) ? "a GIF" : "an MP4"));
  check_target("--video", file, is_gif(file) ? FileKind{"a GIF", "GIF8"} : FileKind{"an MP4 video", "ftyp"},
               inputs);
  if (!has_ffmpeg()) throw no_ffmpeg();
}

VideoWriter::VideoWriter(const VideoFormat& format) : encoder_(std::make_unique<Encoder>()) {
  check_video(format.file, format.fps);
  if (std::min(format.width, format.height) < 16)
    throw input_error("video", fmt::format("{} x {} pixels", format.width, format.height),
                      "at least 16 x 16 pixels");
  Encoder& own = *encoder_;
  own.format = format;
  own.target = file_target(format.file);
  own.part = own.target.parent_path() / part_name();
  own.errors = memory_file();
  int ends[2] = {-1, -1};
  // A socket, because a write to a pipe without a reader ends the process by a signal.
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw output_error(format.file.string(), std::strerror(errno), "a free file descriptor");
  own.frames = ends[0];
  own.process = start_program(words_of(format, own.part), ".", ends[1], own.errors);
  close(ends[1]);
  if (!own.process) throw no_ffmpeg();
}

VideoWriter::~VideoWriter() {
  encoder_->end();
  if (encoder_->errors >= 0) close(encoder_->errors);
  std::error_code ignored;
  if (!encoder_->part.empty()) fs::remove(encoder_->part, ignored);
}

void VideoWriter::add(const Image& image) {
  Encoder& own = *encoder_;
  if (image.width != own.format.width || image.height != own.format.height)
    throw input_error("video", fmt::format("a picture of {} x {} pixels", image.width, image.height),
                      fmt::format("{} x {} pixels", own.format.width, own.format.height));
  const std::uint8_t* from = image.rgb.data();
  for (std::size_t left = image.rgb.size(); left > 0;) {
    const ssize_t sent = send(own.frames, from, left, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) own.fail();
    from += sent;
    left -= static_cast<std::size_t>(sent);
  }
}

void VideoWriter::finish() {
  Encoder& own = *encoder_;
  if (!own.end()) own.fail();
  std::error_code failure;
  fs::rename(own.part, own.target, failure);
  if (failure) throw output_error(own.format.file.string(), failure.message(), "a path that can be written");
}

int core_count() {
  cpu_set_t set;
  return sched_getaffinity(0, sizeof set, &set) == 0 ? std::max(1, CPU_COUNT(&set)) : 1;
}

void make_in_order(std::size_t count, int threads, const std::function<MakeImage()>& maker,
                   const std::function<void(std::size_t, Image&&)>& take) {
  const auto stride = std::min(count, static_cast<std::size_t>(std::max(1, threads)));
  if (stride == 1) {
    const MakeImage make = maker();
    for (std::size_t i = 0; i < count; ++i) take(i, make(i));
    return;
  }
  // Mesa draws with one thread each: these use all cores already.
  setenv("LP_NUM_THREADS", "0", 0);
  std::vector<std::promise<Image>> made(count);
  std::mutex mutex;
  std::condition_variable_any changed;
  std::size_t taken = 0;
  std::vector<std::jthread> workers;
  const auto work = [&](const std::stop_token& stop, std::size_t i) {
    try {
      for (const MakeImage make = maker(); i < count; i += stride) {
        std::unique_lock lock(mutex);
        // Pictures that wait take memory.
        if (!changed.wait(lock, stop, [&] { return i < taken + 2 * stride; })) return;
        lock.unlock();
        made[i].set_value(make(i));
      }
    } catch (...) {
      made[i].set_exception(std::current_exception());
    }
  };
  for (std::size_t k = 0; k < stride; ++k) workers.emplace_back(work, k);
  for (std::size_t i = 0; i < count; ++i) {
    take(i, made[i].get_future().get());
    const std::lock_guard lock(mutex);
    taken = i + 1;
    changed.notify_all();
  }
}

}  // namespace handsim::output
