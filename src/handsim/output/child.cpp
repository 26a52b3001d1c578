#include "handsim/output/child.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>

#include <fmt/format.h>

#include "handsim/core/text.h"

namespace handsim::output {

namespace {

constexpr int kPipe = 3;  ///< the child's file descriptor of the pipe to its parent

// The child sends one report per line. Output of libraries to standard error uses the same pipe.
constexpr std::string_view kShare = "handsim-share ", kFailure = "handsim-failure ";
constexpr std::size_t kLongestLine = 500;

void report(int pipe, std::string_view head, std::string_view text) {
  const std::string line = fmt::format("\n{}{}\n", head, text);
  static_cast<void>(!::write(pipe, line.data(), line.size()));
}

/// Parses the lines that the child sends.
class Report {
 public:
  explicit Report(const Progress& progress) : progress_(progress) {}

  void add(std::string_view text) {
    for (const char c : text) {
      if (c != '\n')
        line_ += c;
      else
        finish_line();
    }
  }
  void finish_line() {
    if (line_.starts_with(kShare)) {
      if (progress_) progress_(std::strtod(line_.c_str() + kShare.size(), nullptr));
    } else if (line_.starts_with(kFailure)) {
      failure = line_.substr(kFailure.size());
    } else if (line_.find_first_not_of(" \t\r") != std::string::npos) {
      last_line = printable(line_, kLongestLine);
    }
    line_.clear();
  }

  std::optional<std::string> failure;
  std::string last_line;

 private:
  const Progress& progress_;
  std::string line_;
};

/// Runs in the child process. Ends without exit handlers and flushing: both belong to the parent.
[[noreturn]] void run_job(int pipe, pid_t parent, const std::function<void(const Progress&)>& job) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  dup2(pipe, STDOUT_FILENO);
  dup2(pipe, STDERR_FILENO);
  if (pipe != kPipe) dup2(pipe, kPipe);
  // The child must not hold the parent's locks and files.
  close_range(kPipe + 1, ~0U, 0);
  try {
    job([](double share) { report(kPipe, kShare, fmt::format("{}", share)); });
    _exit(0);
  } catch (const std::bad_alloc&) {
    report(kPipe, kFailure, "out of memory");
  } catch (const std::exception& error) {
    report(kPipe, kFailure, printable(error.what(), std::strlen(error.what())));
  }
  _exit(1);
}

std::string describe_exit(int status, const Report& report) {
  std::string out = WIFSIGNALED(status) ? fmt::format("ended by signal {} ({})", WTERMSIG(status),
                                                      strsignal(WTERMSIG(status)))
                                        : fmt::format("ended with status {}", WEXITSTATUS(status));
  return report.last_line.empty() ? out : out + ": " + report.last_line;
}

}  // namespace

std::optional<std::string> run_in_child(const std::function<void(const Progress&)>& job,
                                        const Progress& progress) {
  int ends[2] = {-1, -1};
  const auto cannot = [](int why) { return fmt::format("cannot start a process ({})", std::strerror(why)); };
  if (pipe2(ends, O_CLOEXEC) != 0) return cannot(errno);
  const pid_t parent = getpid(), child = fork();
  if (child == 0) run_job(ends[1], parent, job);
  const int cause = errno;
  close(ends[1]);
  Report report(progress);
  if (child > 0) {
    char text[4096];
    for (ssize_t got = 0; (got = ::read(ends[0], text, sizeof text)) != 0;) {
      if (got < 0 && errno != EINTR) break;
      if (got > 0) report.add({text, static_cast<std::size_t>(got)});
    }
    report.finish_line();
  }
  std::optional<std::string> out;
  int status = 0;
  if (child < 0)
    out = cannot(cause);
  else if (waitpid(child, &status, 0) != child)
    out = fmt::format("cannot wait for its process ({})", std::strerror(errno));
  else if (report.failure)
    out = report.failure;
  else if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    out = describe_exit(status, report);
  close(ends[0]);
  return out;
}

std::optional<pid_t> start_program(std::vector<std::string> words, const std::filesystem::path& folder,
                                   int input, int errors) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  pid_t child = 0;
  const int failure = posix_spawnp(&child, pointers[0], &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return failure == 0 ? std::optional(child) : std::nullopt;
}

std::optional<int> wait_for(std::optional<pid_t> program) {
  int status = 0;
  while (program && waitpid(*program, &status, 0) < 0)
    if (errno != EINTR) return std::nullopt;
  return program && WIFEXITED(status) ? std::optional(WEXITSTATUS(status)) : std::nullopt;
}

}  // namespace handsim::output
