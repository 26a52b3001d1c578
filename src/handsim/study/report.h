// Functions for all studies and their reports: CPU time, the median, text in CSV, common entries of JSON
// files, NAME.csv, NAME.json, NAME.gp and the plots that gnuplot makes from NAME.gp, and the page of a study,
// from the tables in its folder and study.json, which has the commands that repeat it and its rows.
#pragma once

#include <filesystem>
#include <map>
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
  std::string csv;   ///< empty: the table is written elsewhere
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

/// Commands that a page adds to a study's tables.
struct StudyCommands {
  std::string study;  ///< the command that repeats it
  /// The command of each row, in its order, by the name of the table (`accuracy.csv`).
  std::map<std::string, std::vector<std::string>> rows = {};
  /// A command for all rows, by the name of the table: columns stand in braces, `handsim run s.yaml --rollout
  /// {rollout}`.
  std::map<std::string, std::string> templates = {};
};

/// Names of the files.
inline constexpr const char* kStudyFile = "study.json";
inline constexpr const char* kPageFile = "report.html";
inline constexpr const char* kBandsFile =
    "bands.csv";  ///< curves with their middle 90 %, which the page draws

/// `handsim WORDS --set ... --out again`.
std::string command_text(const std::vector<std::string>& words,
                         const std::vector<std::string>& overrides = {});

/// Writes study.json.
void write_commands(const std::filesystem::path& out, const StudyCommands& commands);
/// Writes study.json, and report.html if wanted.
void finish_study(const std::filesystem::path& out, const StudyCommands& commands, bool report);

/// Text of the page. It has the tables as they are; its script reads them, and links rows of runs whose
/// folders are beside the table to their pages.
/// @throws Error (input) for a folder without a study's table, or with an empty one.
std::string study_page(const std::filesystem::path& folder);

}  // namespace handsim::study
