// The tables of a run: trajectory.csv and .mot, control.sto, muscles.sto, contacts.csv, monitor.csv, and
// those that a scene asks for under `record`: bodies, markers, momentum, joint reactions.
#pragma once

#include <array>
#include <functional>

#include "handsim/model/newton_euler.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

/// Names of the files that a scene's `record` may add.
std::vector<std::string> extra_table_files();
/// Bytes of a row of all these, at `number` bytes for each number.
double extra_row_bytes(const scene::Scene& scene, double number);

class RunTables {
 public:
  /// The simulation must outlive this. @throws Error (input): reactions with loops, no file
  RunTables(const Simulation& simulation, const RunOptions& options);
  RunTables(const RunTables&) = delete;  ///< its tables refer to it
  RunTables& operator=(const RunTables&) = delete;

  /// To be called after every step, and at the start; writes rows at every multiple of `record.every`.
  void record(long step);
  /// Completes the files.
  void finish();

 private:
  using Row = std::vector<double>;
  /// A row's numbers after the time; nothing: no row.
  using Numbers = std::function<std::optional<Row>()>;
  struct Table {
    std::function<void()> add, finish;
  };
  void add_text(const char* name, const std::string& head, const std::function<std::string()>& text);
  void add_csv(const char* name, const std::string& columns, const Numbers& numbers);
  void add_motion(const char* name, std::vector<std::string> columns, const Numbers& numbers);
  void add_driven();
  void add_extra();
  void add_markers();
  void raise_residuals();
  Row monitor_row();
  std::optional<Row> reaction_row();

  const Simulation& simulation_;
  std::filesystem::path out_;
  long every_;        ///< number of steps between two rows
  std::size_t rows_;  ///< at most
  std::vector<Table> tables_;
  bool monitored_;
  /// Largest residuals of joints [m/s], [rad/s] and contacts [m/s] since the last row; NaN: not measured.
  std::array<double, 3> residuals_;
  std::optional<model::NewtonEuler> dynamics_;  ///< for reactions
  model::State before_;                         ///< the state at the last step, for the same
};

}  // namespace handsim::simulation
