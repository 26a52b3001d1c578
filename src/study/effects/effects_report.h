// What effects cost and change: the table, effects.csv, effects.json and bars drawn by gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "handsim/study/effects/effects.h"

namespace handsim::study {

/// The rows as a table for the screen.
std::string effects_table(const EffectsResult& result);

/// effects.json as text.
std::string effects_json(const scene::Scene& scene, const EffectsResult& result);

/// Writes effects.csv, effects.json and, where gnuplot is installed, effects.png and effects.svg.
/// @returns false where gnuplot is missing or failed; its script effects.gp is there all the same.
/// @throws Error (input) where the folder cannot be written.
bool write_effects(const scene::Scene& scene, const EffectsResult& result, const std::filesystem::path& out);
std::vector<std::string> effects_files();

}  // namespace handsim::study
