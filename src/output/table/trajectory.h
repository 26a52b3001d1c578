// A State per row as CSV: time, joint coordinates and rates, body poses, at full precision. Column names
// carry units: `right.index_mcp.flexion[rad]`, `right.index_mcp.flexion.rate[rad/s]`, `right.palm.x[m]`,
// `right.palm.qw`.
#pragma once

#include <string>
#include <vector>

#include "handsim/model/state.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

/// Names of a model's coordinates in their order, e.g. `right.index_mcp.flexion`; ball joints have `.x .y
/// .z`.
std::vector<std::string> coordinate_names(const model::Model& model);

class TrajectoryWriter {
 public:
  TrajectoryWriter(const std::filesystem::path& path, const model::Model& model);

  void add(const model::State& state);
  void finish();

 private:
  AtomicFile file_;
};

}  // namespace handsim::output
