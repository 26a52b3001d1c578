// The command for recorded motion.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/inverse/inverse.h"

namespace handsim::app {

struct InverseArguments : study::InverseInput {
  InverseArguments() { options.filter = 6; }  // [Hz]

  std::filesystem::path scene;
  std::optional<std::filesystem::path> names;  ///< file of the names that the motion's columns have
  std::filesystem::path out;
  std::vector<std::string> overrides;
  bool muscles = false;
  double co_contraction = 0;  ///< least activation
  bool apart = false;         ///< with muscles: no contact in the check, which is no part of the torques
  bool json = false;
  std::optional<int> uncertain;  ///< hands that are drawn
  std::string on;                ///< address of the Dask scheduler that runs these; empty: this machine
  bool report = false;           ///< of these: writes report.html
};
/// The input with what its files say. @throws Error (input) for a file of names that is none.
study::InverseInput inverse_input(const InverseArguments& arguments);
int inverse_command(const InverseArguments& arguments);

}  // namespace handsim::app
