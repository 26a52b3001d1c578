// An accuracy study on paper: the table, accuracy.csv, accuracy.json and plots drawn by gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "handsim/study/accuracy/accuracy.h"

namespace handsim::study {

/// The rows as a table for the screen.
std::string accuracy_table(const AccuracyResult& result, double early);

/// The cheapest row for each of a ladder of errors, down to the smallest that any row reaches, as a table;
/// where one row is the cheapest for several, the smallest of them. Empty where no row reaches 0.1.
std::string cheapest_table(const AccuracyResult& result);

/// Writes accuracy.csv, accuracy.json and, where gnuplot is installed, error_cost, cost_step and velocity as
/// PNG and SVG.
/// @returns false where gnuplot is missing or failed; its script accuracy.gp is there all the same.
/// @throws Error (input) where the folder cannot be written.
bool write_accuracy(const AccuracySpec& spec, const AccuracyResult& result, const std::filesystem::path& out);
std::vector<std::string> accuracy_files();

}  // namespace handsim::study
