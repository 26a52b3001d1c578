// The page of a study, from the tables in its folder and study.json, which has the commands that repeat it
// and its rows.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace handsim::study {

/// What a page adds to a study's tables.
struct StudyCommands {
  std::string study;  ///< the command that repeats it
  /// By the name of a table (`accuracy.csv`): the command of each row, in its order.
  std::map<std::string, std::vector<std::string>> rows = {};
  /// By the name of a table: a command with columns in braces, `handsim run s.yaml --rollout {rollout}`.
  std::map<std::string, std::string> templates = {};
};

/// Names of the files.
inline constexpr const char* kStudyFile = "study.json";
inline constexpr const char* kPageFile = "report.html";

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
