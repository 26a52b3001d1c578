// A rollout table as an HDF5 file: `/rollouts` has a dataset for each column, `/trajectories` one for each
// rollout that was recorded.
#pragma once

#include <filesystem>

#include "handsim/study/rollouts/rollout_table.h"

namespace handsim::study {

/// Equal tables give equal bytes. A missing number is NaN, a missing text is empty; units
/// are written `[m per s]`, since a slash parts groups.
/// @throws Error (output) where the file cannot be written; nothing has its name then.
void write_hdf5(const Table& table, const std::filesystem::path& path);

}  // namespace handsim::study
