// Rows of a run's CSV tables, at full precision. Column names carry units.
#pragma once

#include <string>
#include <vector>

#include "handsim/engine/engine.h"

namespace handsim::output {

/// Names of a model's coordinates, e.g. `right.index_mcp.flexion`; a ball joint has `.x`, `.y` and `.z`.
std::vector<std::string> coordinate_names(const model::Model& model);

/// trajectory.csv: time, joint coordinates and rates, body poses. Columns: `right.index_mcp.flexion[rad]`,
/// `right.index_mcp.flexion.rate[rad/s]`, `right.palm.x[m]`, `right.palm.qw`.
std::vector<std::string> trajectory_columns(const model::Model& model);
std::vector<double> trajectory_values(const model::State& state);

/// contacts.csv: a row for each contact point, world axes; the normal is from b to a, friction acts on a.
std::string contact_head();
std::string contact_row(const model::Model& model, double time, const engine::Contact& contact);

}  // namespace handsim::output
