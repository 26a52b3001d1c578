// Rows of validation that are numbers of a simulated scene; private to this folder.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "handsim/study/validate/validate.h"

namespace handsim::study {

/// Runs scenes, each once for all rows that ask for it.
class SimulatedScenes {
 public:
  /// @param out folder for the files of the runs
  explicit SimulatedScenes(std::filesystem::path out) : out_(std::move(out)) {}
  /// The row's number. @throws Error (input) if the summary does not have it
  double figure(const Measurement& of);

 private:
  const std::string& summary(const Measurement& of);

  std::filesystem::path out_;
  std::map<std::pair<std::filesystem::path, std::vector<std::string>>, std::string>
      summaries_;  ///< by scene and overrides
};

}  // namespace handsim::study
