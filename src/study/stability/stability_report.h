// A stability study on paper: the table, stability.csv, stability.json, stability.md, plots by gnuplot and
// pictures of the scenes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/stability/stability.h"

namespace handsim::study {

/// The rows as a table for the screen: of variants the worst.
std::string stability_table(const StabilityResult& result);

/// One row a case, in Markdown: the worst of what is to hold, and what is known to fall short.
std::string stability_markdown(const StabilityResult& result);

/// Writes stability.csv and stability.json (every variant), stability.md, and, where gnuplot is installed,
/// stability.png and .svg (how far every figure is from its limit) and CASE.png and .svg of cases with a
/// plot.
/// @returns false where gnuplot is missing or failed; its script stability.gp is there all the same.
/// @throws Error (input) where the folder cannot be written.
bool write_stability(const StabilitySpec& spec, const StabilityResult& result,
                     const std::filesystem::path& out);

/// Writes scene_CASE.png of every case of the result with a picture, and all of them on scenes.png, in a
/// process of its own. @return why they are missing; nothing where they are there.
std::optional<std::string> draw_stability(const StabilityResult& result, const std::filesystem::path& out);

/// Names of all files of a study, those of draw_stability among them.
std::vector<std::string> stability_files(const StabilitySpec& spec);

}  // namespace handsim::study
