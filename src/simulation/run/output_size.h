// How much a run will write, estimated before it is run, against the room that there is for it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// Estimates from the bytes of a number that shipped scenes have, 19; contacts and pictures by a rule of
/// thumb.
struct OutputSize {
  long rows = 0;           ///< of the tables
  double row = 0;          ///< of all tables together [bytes]
  double largest_row = 0;  ///< of the largest table [bytes]
  double pictures = 0;     ///< of all pictures [bytes]
  double inputs = 0;       ///< of the copies of meshes and motion files [bytes]
  double moments = 0;      ///< memory that keeps what is to be drawn [bytes]

  double total() const { return static_cast<double>(rows) * row + pictures + inputs; }
};

/// Rows of the tables of steps `first` to `last`, one at every step that `every` divides.
long record_rows(long first, long last, long every);

/// Steps from one row to the next.
long record_steps(const scene::SceneSpec& spec);

/// @param first, last the run's steps. @param frames pictures over the run.
OutputSize output_size(const scene::Scene& scene, long first, long last, int frames);

/// Refuses what does not fit: the free space where `out` is or is to be, the largest file that the system
/// allows, the memory that pictures keep.
/// @returns a note on a run that writes more than 1 GB, otherwise nothing.
/// @throws Error (input) naming the estimate, the room and the `record.every` that would fit.
std::optional<std::string> check_room(const scene::Scene& scene, const OutputSize& size,
                                      const std::filesystem::path& out);

/// @param remedy what writes less. @throws Error (input) where so many bytes do not fit where `out` is or is
/// to be.
void check_free(double bytes, const std::filesystem::path& out, const std::string& remedy);

}  // namespace handsim::simulation
