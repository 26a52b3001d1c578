// Runs the handsim program: arguments in; exit status, standard output and standard error out.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::test {

struct Outcome {
  int status = -1;  ///< exit status; -1: ended by a signal, e.g. after kHang
  std::string out;
  std::string err;

  /// Lines of standard error without warnings and progress.
  std::vector<std::string> problems() const {
    std::vector<std::string> lines;
    std::istringstream stream(err);
    for (std::string line; std::getline(stream, line);)
      if (!line.empty() && !line.starts_with("warning: ") && !line.starts_with("progress: "))
        lines.push_back(line);
    return lines;
  }
};

/// The program with these arguments, to its end, or until its standard error has this word.
inline Outcome run_program(const std::vector<std::string>& arguments, const std::string& until = "") {
  constexpr unsigned kHang = kSanitized ? 120 : 30;  // [s]
  const TemporaryFolder folder;
  const std::string out = folder.path() / "out", err = folder.path() / "err";
  // Otherwise the child would also write this process's buffered output.
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    if (!std::freopen(out.c_str(), "wb", stdout) || !std::freopen(err.c_str(), "wb", stderr)) _exit(126);
    std::vector<char*> argv = {const_cast<char*>(test::kProgramFile)};
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    // The alarm stays set in the program.
    alarm(kHang);
    execv(test::kProgramFile, argv.data());
    _exit(127);
  }
  int status = 0;
  if (!until.empty()) {
    while (waitpid(child, &status, WNOHANG) == 0)
      if (text_of(err).find(until) == std::string::npos)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      else
        kill(child, SIGKILL);
  } else {
    waitpid(child, &status, 0);
  }
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text_of(out), text_of(err)};
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

inline bool empty_or_missing(const std::filesystem::path& folder) {
  return !std::filesystem::exists(folder) || std::filesystem::is_empty(folder);
}

inline std::filesystem::path write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

/// A scene of one ball, to which lines can be added.
inline constexpr const char* kBallScene =
    "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0]}]\nduration: 2\n";

}  // namespace handsim::test
