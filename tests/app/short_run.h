// Short runs of a shipped scene in processes with closed streams, limits or signals.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <functional>
#include <thread>

#include <nlohmann/json.hpp>

#include "app/program.h"
#include "places.h"

namespace handsim::test {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

inline const std::string kScene = source("config/two_hands.yaml").string();

/// A run of a fraction of a second.
inline Words run_into(const fs::path& out, const Words& more = {}) {
  Words words = {"run", kScene, "--out", out.string(), "--set", "duration=0.1"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Waits until a run holds the lock of its output folder: then it has begun. @return false if it ended before
inline bool wait_for_lock(pid_t run) {
  const std::string holder = " WRITE " + std::to_string(run) + " ";
  for (siginfo_t ended{}; ended.si_pid == 0; std::this_thread::sleep_for(std::chrono::milliseconds(2))) {
    if (text_of("/proc/locks").find(holder) != std::string::npos) return true;
    if (waitid(P_PID, static_cast<id_t>(run), &ended, WEXITED | WNOHANG | WNOWAIT) != 0) return false;
  }
  return false;
}

/// Starts the program; `prepare` runs in the child, after standard error and output have gone to files.
inline pid_t start(Words words, const fs::path& folder, const std::function<void()>& prepare) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child != 0) return child;
  const std::string out = folder / "stdout", err = folder / "stderr";
  if (!std::freopen(out.c_str(), "wb", stdout) || !std::freopen(err.c_str(), "wb", stderr)) _exit(126);
  std::vector<char*> argv = {const_cast<char*>(test::kProgramFile)};
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  alarm(60);
  prepare();
  execv(test::kProgramFile, argv.data());
  _exit(127);
}

/// Exit status; minus the signal that ended the program.
inline int wait_for(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

inline int status_with(const Words& words, const fs::path& folder, const std::function<void()>& prepare) {
  return wait_for(start(words, folder, prepare));
}

/// trajectory.csv of an undisturbed run.
inline const std::string& trajectory() {
  static const std::string text = [] {
    const TemporaryFolder folder;
    EXPECT_EQ(run_program(run_into(folder.path() / "out")).status, 0);
    return text_of(folder.path() / "out/trajectory.csv");
  }();
  return text;
}

inline void expect_whole(const fs::path& out) {
  EXPECT_TRUE(text_of(out / "trajectory.csv") == trajectory());
  EXPECT_FALSE(nlohmann::json::parse(text_of(out / "summary.json"), nullptr, false).is_discarded());
  EXPECT_TRUE(fs::exists(out / "resolved.yaml"));
}

}  // namespace handsim::test
