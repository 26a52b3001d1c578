// The tables of a run that a scene asks for under `record`: bodies, markers, momentum, joint reactions.
#pragma once

#include <memory>

#include "handsim/output/atomic_file.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

/// Names of the files that the scene's tables may have.
std::vector<std::string> extra_table_files();
/// Bytes of a row of all these tables, at `number` bytes for each number.
double extra_row_bytes(const scene::Scene& scene, double number);

class ExtraTables {
 public:
  /// @param rows at most, every `interval` [s]. @throws Error (input): reactions with loops, no file
  ExtraTables(const Simulation& simulation, const std::filesystem::path& out, std::size_t rows,
              double interval);
  ~ExtraTables();

  /// Call after every step, and at the start. @param row whether to add a row.
  void update(bool row);
  void finish();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace handsim::simulation
