// Asks OpenSim (PyPI: opensim) about an exported model, by a script of tests/output/export.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "scene_files.h"

namespace handsim::test {

using nlohmann::json;

inline constexpr const char* kNoOpenSim = "no opensim for " HANDSIM_PYTHON " (PyPI: opensim 4.6)";

/// Runs a script with a Python that has OpenSim.
inline int run_opensim(const std::string& arguments, const std::string& script = "opensim_check.py") {
  const std::string folder = HANDSIM_PYTHON_PACKAGES;
  const std::string path = folder.empty() ? "" : "PYTHONPATH='" + folder + "' ";
  return std::system(
      (path + HANDSIM_PYTHON + " " + source("tests/output/export/" + script).string() + " " + arguments)
          .c_str());
}

inline bool opensim_is_there() {
  static const bool there = run_opensim("> /dev/null 2>&1") == 0;
  return there;
}

/// What OpenSim says to the questions in a folder; null where it fails.
inline json opensim_answer(const std::filesystem::path& folder,
                           const std::string& script = "opensim_check.py") {
  const std::filesystem::path answer = folder / "answer.txt";
  EXPECT_EQ(run_opensim(folder.string() + " > " + answer.string() + " 2>&1", script), 0) << text_of(answer);
  const std::string text = text_of(answer);
  const std::size_t at = text.find("RESULT {");
  EXPECT_NE(at, std::string::npos) << text;
  return at == std::string::npos ? json() : json::parse(text.substr(at + 7));
}

}  // namespace handsim::test
