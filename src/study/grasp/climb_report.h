// Rows of climbs as tables.
#pragma once

#include <string>
#include <vector>

#include "handsim/simulation/watch/climb_figures.h"

namespace handsim::study {

/// What a row says of its run.
struct RunRow {
  std::string scene;               ///< file name without extension
  std::string side;                ///< of the hand
  bool passed = false;             ///< every criterion of the run held
  double simulated = 0, wall = 0;  ///< [s]
  std::string fault;               ///< where the run diverged
};

struct ClimbRow : RunRow {
  simulation::ClimbFigures figures;
};

/// One line a climb.
std::string climbs_csv(const std::vector<ClimbRow>& rows);
std::string climbs_json(const std::vector<ClimbRow>& rows);

}  // namespace handsim::study
