// Functions for all studies and their reports: CPU time, the median, fields of CSV, common entries of JSON
// files, and the files NAME.csv, NAME.json, NAME.gp and the plots that gnuplot makes from NAME.gp.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace handsim::study {

using Json = nlohmann::ordered_json;

/// CPU time of this thread [s].
double cpu_now();
/// The median of at least one value; of an even number, the upper middle value.
double median(std::vector<double> values);

/// Text as a field of CSV: in double quotes, on one line.
std::string quoted(std::string text);

/// Adds the measuring environment: `machine`, and `versions` of handsim and the compiler.
void add_origin(Json& out);

/// A plot that the script draws twice, as NAME.png and NAME.svg.
struct Plot {
  std::string name;
  std::string terminal;  ///< options of gnuplot's terminal, e.g. `size 1400,800`
  std::string commands;  ///< lines of gnuplot, without terminal and output
};

/// The texts of a study's files.
struct Report {
  std::string csv;
  std::string json;  ///< empty: no JSON file
  std::string data;  ///< data blocks and settings at the start of the script
  std::vector<Plot> plots;
};

/// Writes NAME.csv, NAME.json and NAME.gp, and draws the plots.
/// @returns false if gnuplot is missing or fails; the other files are written anyway.
/// @throws Error (input) if the folder cannot be written.
bool write_report(const std::filesystem::path& out, const std::string& name, const Report& report);

/// Names of a study's files.
std::vector<std::string> report_files(const std::string& name, const std::vector<std::string>& plots);

}  // namespace handsim::study
