// How a study is run, and what it says at its end: for the command line and for Python.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace handsim::study {

struct StudyRun {
  std::filesystem::path out;                  ///< folder for its files
  bool report = false;                        ///< writes report.html, too
  std::function<void(double)> progress = {};  ///< called with the share done, 0..1; may throw: the study ends
  std::function<void(const std::string&)> tell =
      {};  ///< gets the text for the screen before files are written
};

struct StudyEnd {
  std::string text;        ///< for the screen
  std::string after = {};  ///< further text, after the names of files
  std::string json = {};   ///< in place of both, for programs
  bool passed = true;
  bool plotted = true;                    ///< false if gnuplot is missing or fails
  std::vector<std::string> missing = {};  ///< what could not be made, and why
};

/// Tells the text for the screen at once: what comes after it may fail.
inline void tell(const StudyRun& run, StudyEnd& end) {
  if (run.tell) run.tell(std::exchange(end.text, {}));
}

}  // namespace handsim::study
