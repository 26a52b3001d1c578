// How a study is run, and what it says at its end: for the command line and for Python.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "handsim/core/error.h"

namespace handsim::study {

struct StudyRun {
  std::filesystem::path out;                  ///< folder for its files
  bool report = false;                        ///< writes report.html, too
  std::function<void(double)> progress = {};  ///< called with the share done, 0..1; may throw: the study ends
  std::function<void(const std::string&)> tell =
      {};  ///< gets the text for the screen before files are written
};

struct StudyEnd {
  std::string text;       ///< for the screen
  std::string json = {};  ///< in its place, for programs
  bool passed = true;
  bool plotted = true;                    ///< false if gnuplot is missing or fails
  std::vector<std::string> missing = {};  ///< what could not be made, and why
};

/// Tells the text for the screen at once: what comes after it may fail.
inline void tell(const StudyRun& run, StudyEnd& end) {
  if (run.tell) run.tell(std::exchange(end.text, {}));
}

/// Calls `work` in threads, which share its tasks and end once `stop` is true. The first exception sets it,
/// and is thrown.
/// @param threads 0: one for each processor core
template <class Work>
void in_threads(int threads, std::atomic<bool>& stop, const Work& work) {
  std::exception_ptr error;
  const auto guarded = [&] {
    try {
      work();
    } catch (...) {
      if (!stop.exchange(true)) error = std::current_exception();
    }
  };
  if (threads <= 0) threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(guarded);
  guarded();
  for (std::thread& thread : others) thread.join();
  if (error) std::rethrow_exception(error);
}

}  // namespace handsim::study
