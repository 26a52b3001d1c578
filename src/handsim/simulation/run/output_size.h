// Columns of a run's tables beside trajectory and contacts; an estimate of its output against the free space.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// Estimates with 19 bytes for a number, the mean of shipped scenes; contacts and pictures by rough rules.
struct OutputSize {
  long rows = 0;           ///< of the tables
  double row = 0;          ///< a row of all tables together [bytes]
  double largest_row = 0;  ///< a row of the largest table [bytes]
  double pictures = 0;     ///< of all pictures [bytes]
  double inputs = 0;       ///< of the copies of meshes and motion files [bytes]
  double moments = 0;      ///< memory for the states that will be drawn [bytes]

  double total() const { return static_cast<double>(rows) * row + pictures + inputs; }
};

/// Number of rows for steps `first` to `last`, one for every multiple of `every`.
long record_rows(long first, long last, long every);

/// Number of steps between two rows.
long record_steps(const scene::SceneSpec& spec);

/// @param first, last first and last step of the run. @param frames number of pictures over the run.
OutputSize output_size(const scene::Scene& scene, long first, long last, int frames);

/// Compares the size with the free space and the largest file of `out`, and the free memory for pictures.
/// @returns a note if the run writes more than 1 GB, otherwise nothing.
/// @throws Error (input) with the estimate, the free space and a `record.every` that fits.
std::optional<std::string> check_room(const scene::Scene& scene, const OutputSize& size,
                                      const std::filesystem::path& out);

/// @param remedy what writes less. @throws Error (input) where so many bytes do not fit on the disk of `out`.
void check_free(double bytes, const std::filesystem::path& out, const std::string& remedy);

/// Columns of control.sto after the time: `.target[deg]`, `.angle[deg]`, `.torque[N_m]` of each driven axis.
std::vector<std::string> control_columns(const scene::Scene& scene);
/// Columns of muscles.sto of each muscle: excitation, activation, tension, fibre length and lengthening rate.
inline constexpr std::array<const char*, 5> kMuscleColumns = {".excitation[]", ".activation[]", ".tendon[N]",
                                                              ".fibre[mm]", ".speed[mm/s]"};
std::vector<std::string> muscle_columns(const scene::Scene& scene);
/// Columns of monitor.csv after the time. A residual that was not measured is `nan`.
inline constexpr const char* kMonitorColumns =
    ",kinetic[J],potential[J],sum[J],joints[m/s],joints[rad/s],contacts[m/s]";

}  // namespace handsim::simulation
