// Measures the cost of contacts for ODE's two solvers: a hand without muscle torques lies on a stack of 0 to
// 16 slabs.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "handsim/engine/settings.h"

namespace handsim::study {

/// Figures of one method and one number of slabs.
struct ContactCostRow {
  std::string method;  ///< e.g. `quick_step 50`
  int slabs = 0;
  double contacts = 0;      ///< contact points, mean of the timed steps
  double ns_per_step = 0;   ///< CPU time of a step, collision detection included; median of the batches
  double iterative = 0;     ///< share of steps that quick_step solved
  double lcp_failures = 0;  ///< per step
};

/// world_step, quick_step with 20 and 50 iterations and auto (50) at 1 ms, all contacts in one island with
/// the hand's joints. @param data folder with handmodels/ and config/
/// @param progress is called with the finished share, 0..1.
std::vector<ContactCostRow> run_contact_cost(const std::filesystem::path& data,
                                             const std::function<void(double)>& progress);

std::string contact_cost_table(const std::vector<ContactCostRow>& rows);

/// Writes contacts_cost.csv and, if gnuplot is installed, contacts_cost.png and .svg.
/// @returns false if gnuplot is missing or fails; the other files and the script contacts_cost.gp are
/// written.
bool write_contact_cost(const std::vector<ContactCostRow>& rows, const std::filesystem::path& out);
std::vector<std::string> contact_cost_files();

}  // namespace handsim::study
