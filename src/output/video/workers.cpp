#include "handsim/output/video/workers.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/text.h"

namespace handsim::output {

namespace {

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
