#include "handsim/output/video/video.h"

#include <fcntl.h>
#include <sched.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <new>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/text.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

namespace {

namespace fs = std::filesystem;
constexpr std::size_t kLongestReport = 400;

bool is_gif(const fs::path& file) { return lower_case(file.extension().string()) == ".gif"; }

/// Starts a program found by PATH. @returns its process, or nothing.
std::optional<pid_t> start(std::vector<std::string> words, int in, int errors) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in, STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  pid_t child = 0;
  // Set by the Python package where imageio-ffmpeg has one and the path has none.
  const char* const other = std::getenv("HANDSIM_FFMPEG");
  const int failure =
      posix_spawnp(&child, other ? other : pointers.front(), &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return failure == 0 ? std::optional(child) : std::nullopt;
}

/// Waits for a process. @returns its exit status; -1 if it did not exit by itself.
int wait_for(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int memory_file() { return memfd_create("handsim", MFD_CLOEXEC); }

bool has_ffmpeg() {
  const int nothing = memory_file();
  const std::optional<pid_t> child = start({"ffmpeg", "-version"}, nothing, nothing);
  const bool good = child && wait_for(*child) == 0;
  close(nothing);
  return good;
}

Error no_ffmpeg() {
  return input_error("--video", "no program ffmpeg that works",
                     "Debian package ffmpeg, or pip install imageio-ffmpeg for the Python package");
}

std::vector<std::string> words_of(const VideoFormat& format, const fs::path& part) {
  const std::string input =
      fmt::format("ffmpeg -v error -nostdin -y -f rawvideo -pix_fmt rgb24 -s {}x{} -r {:.9g} -i pipe:0 -an ",
                  format.width, format.height, format.fps);
  // GIF: a palette for each frame; one for all would need all frames in memory. MP4: players everywhere read
  // 4:2:0, which needs even sizes; the index at the front lets them start at once.
  std::istringstream all(input +
                         (is_gif(format.file)
                              ? "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse="
                                "new=1:dither=bayer:bayer_scale=4 -loop 0 -f gif"
                              : "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2:color=0xD8DCE1 -c:v libx264 "
                                "-preset veryfast -crf 18 -pix_fmt yuv420p -movflags +faststart -f mp4"));
  std::vector<std::string> words{std::istream_iterator<std::string>(all), {}};
  words.push_back("file:" + part.string());
  return words;
}

constexpr std::size_t kLongestReason = 500;

/// What a fork sends before a picture's bytes, or before the text of an error.
struct Head {
  int width = 0;   ///< 0: an error
  int height = 0;  ///< of an error: length of its text
};

void send_all(int pipe, const void* bytes, std::size_t size) {
  for (const char* from = static_cast<const char*>(bytes); size > 0;) {
    const ssize_t sent = ::write(pipe, from, size);
    if (sent < 0 && errno == EINTR) continue;
    // The parent has gone.
    if (sent <= 0) _exit(1);
    from += sent;
    size -= static_cast<std::size_t>(sent);
  }
}

/// False at the end of the stream.
bool receive_all(int pipe, void* bytes, std::size_t size) {
  for (char* to = static_cast<char*>(bytes); size > 0;) {
    const ssize_t got = ::read(pipe, to, size);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    to += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

[[noreturn]] void work(int pipe, pid_t parent, std::size_t first, std::size_t stride, std::size_t count,
                       const std::function<MakeImage()>& maker) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
  // One thread: the forks use all cores already.
  setenv("LP_NUM_THREADS", "0", 0);
  const auto fail = [&](std::string_view reason) {
    const Head head = {0, static_cast<int>(reason.size())};
    send_all(pipe, &head, sizeof head);
    send_all(pipe, reason.data(), reason.size());
    _exit(1);
  };
  try {
    const MakeImage make = maker();
    for (std::size_t i = first; i < count; i += stride) {
      const Image image = make(i);
      const Head head = {image.width, image.height};
      send_all(pipe, &head, sizeof head);
      send_all(pipe, image.rgb.data(), image.rgb.size());
    }
    _exit(0);
  } catch (const std::bad_alloc&) {
    fail("out of memory");
  } catch (const std::exception& error) {
    fail(printable(error.what(), kLongestReason));
  }
  _exit(1);
}

/// A fork, which is ended with this object.
class Worker {
 public:
  Worker(std::size_t first, std::size_t stride, std::size_t count, const std::function<MakeImage()>& maker) {
    int ends[2] = {-1, -1};
    if (pipe2(ends, O_CLOEXEC) != 0) cannot();
    const pid_t parent = getpid();
    process_ = fork();
    if (process_ == 0) {
      close(ends[0]);
      work(ends[1], parent, first, stride, count, maker);
    }
    pipe_ = ends[0];
    close(ends[1]);
    if (process_ < 0) cannot();
  }
  ~Worker() {
    if (pipe_ >= 0) close(pipe_);
    if (process_ <= 0) return;
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  Image receive() {
    Head head;
    if (!receive_all(pipe_, &head, sizeof head)) died();
    if (head.width == 0) {
      std::string reason(static_cast<std::size_t>(head.height), '\0');
      static_cast<void>(receive_all(pipe_, reason.data(), reason.size()));
      throw output_error("pictures", reason, "memory, room on the disk, or smaller pictures");
    }
    Image image{head.width, head.height, {}};
    image.rgb.resize(3UL * static_cast<std::size_t>(head.width) * static_cast<std::size_t>(head.height));
    if (!receive_all(pipe_, image.rgb.data(), image.rgb.size())) died();
    return image;
  }

 private:
  [[noreturn]] static void cannot() {
    throw output_error("pictures", fmt::format("cannot start a process ({})", std::strerror(errno)),
                       "fewer processes or more memory");
  }
  [[noreturn]] void died() {
    int status = 0;
    waitpid(process_, &status, 0);
    process_ = -1;
    throw output_error("pictures",
                       WIFSIGNALED(status) ? fmt::format("drawing ended by signal {} ({})", WTERMSIG(status),
                                                         strsignal(WTERMSIG(status)))
                                           : fmt::format("drawing ended with status {}", WEXITSTATUS(status)),
                       "more memory, or smaller pictures");
  }

  int pipe_ = -1;
  pid_t process_ = -1;
};

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
    return process && wait_for(*std::exchange(process, std::nullopt)) == 0;
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
  own.process = start(words_of(format, own.part), ends[1], own.errors);
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

void make_in_order(std::size_t count, int processes, const std::function<MakeImage()>& maker,
                   const std::function<void(std::size_t, Image&&)>& take) {
  if (count == 0) return;
  const auto stride = std::min(count, static_cast<std::size_t>(std::max(1, processes)));
  if (stride == 1) {
    const MakeImage make = maker();
    for (std::size_t i = 0; i < count; ++i) take(i, make(i));
    return;
  }
  std::vector<std::unique_ptr<Worker>> workers;
  for (std::size_t k = 0; k < stride; ++k)
    workers.push_back(std::make_unique<Worker>(k, stride, count, maker));
  for (std::size_t i = 0; i < count; ++i) take(i, workers[i % stride]->receive());
}

}  // namespace handsim::output
