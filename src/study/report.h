// What the reports of all studies share: fields of CSV, the head of a JSON file, plots as PNG and SVG, and
// the writing of NAME.csv, NAME.json, NAME.gp and what gnuplot makes of the last.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace handsim::study {

using Json = nlohmann::ordered_json;

/// Text as a field of CSV: in double quotes, on one line.
std::string quoted(std::string text);

/// Adds what the figures were measured on: `machine`, and `versions` of handsim and the compiler.
void add_origin(Json& out);

/// A plot that stands twice in a script, as NAME.png and NAME.svg.
struct Plot {
  std::string name;
  std::string terminal;  ///< options of gnuplot's terminal, e.g. `size 1400,800`
  std::string commands;  ///< lines, without terminal and output
};

/// The texts of a study's files.
struct Report {
  std::string csv;
  std::string json;  ///< empty: no such file
  std::string data;  ///< data blocks and settings at the head of the script
  std::vector<Plot> plots;
};

/// Writes NAME.csv, NAME.json and, where there are plots, NAME.gp, and draws the plots.
/// @returns false where gnuplot is missing or failed; the other files are there all the same.
/// @throws Error (input) where the folder cannot be written.
bool write_report(const std::filesystem::path& out, const std::string& name, const Report& report);

/// Names of a study's files.
std::vector<std::string> report_files(const std::string& name, const std::vector<std::string>& plots);

}  // namespace handsim::study
