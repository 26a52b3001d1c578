// How a study is run, and what it says at its end: for the command line and for Python.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace handsim::study {

struct StudyRun {
  std::filesystem::path out;                  ///< folder for its files
  bool report = false;                        ///< writes report.html, too
  std::function<void(double)> progress = {};  ///< called with the share done, 0..1; may throw: the study ends
};

struct StudyEnd {
  std::string text;        ///< for the screen
  std::string after = {};  ///< further text, after the names of files
  std::string json = {};   ///< in place of both, for programs
  bool passed = true;
  bool plotted = true;                    ///< false if gnuplot is missing or fails
  std::vector<std::string> missing = {};  ///< what could not be made, and why
};

}  // namespace handsim::study
