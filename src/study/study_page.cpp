#include "handsim/study/study_page.h"

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/version.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/report/page.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

namespace fs = std::filesystem;

/// Tables of the studies, and the files with their titles and versions.
struct Kind {
  const char* table;
  const char* about;
};
constexpr Kind kStudyTables[] = {
    {"accuracy.csv", "accuracy.json"}, {"effects.csv", "effects.json"}, {"stability.csv", "stability.json"},
    {"rollouts.csv", "summary.json"},  {"grasps.csv", nullptr},         {"climbs.csv", nullptr},
    {"validate.csv", "validate.json"}};

std::string text_of(const fs::path& path) {
  constexpr std::size_t kLargest = 1UL << 30U;
  return fs::exists(path) ? read_input_file(path, "a study's file", kLargest) : "";
}

Json read_json(const fs::path& path) {
  Json out = Json::parse(text_of(path), nullptr, false);
  return out.is_object() ? out : Json::object();
}

}  // namespace

std::string command_text(const std::vector<std::string>& words, const std::vector<std::string>& overrides) {
  std::string out = "handsim";
  for (const std::string& word : words) out += " " + output::shell_word(word);
  for (const std::string& set : overrides) out += " --set " + output::shell_word(set);
  return out + " --out again";
}

void write_commands(const fs::path& out, const StudyCommands& commands) {
  const Json json = {{"command", commands.study}, {"rows", commands.rows}, {"templates", commands.templates}};
  output::write_file(out / kStudyFile, json.dump(1) + "\n");
}

void finish_study(const fs::path& out, const StudyCommands& commands, bool report) {
  write_commands(out, commands);
  if (report) output::write_file(out / kPageFile, study_page(out));
}

std::string study_page(const fs::path& folder) {
  const fs::path name = folder.lexically_normal();
  Json data = {{"kind", "study"},
               {"name", name.string()},
               {"title", name.filename().string()},
               {"handsim", fmt::format("{} ({})", kVersion, kCommit)},
               {"study", read_json(folder / kStudyFile)},
               {"tables", Json::array()},
               {"pages", Json::array()}};
  for (const auto& [table, about] : kStudyTables) {
    if (!fs::exists(folder / table)) continue;
    std::string csv = text_of(folder / table);
    if (csv.empty()) throw input_error((folder / table).string(), "an empty file", "a study's table");
    data["tables"].push_back({{"name", table}, {"csv", std::move(csv)}});
    if (!about) continue;
    Json& figures = data["about"] = read_json(folder / about);
    data["title"] = figures.value("title", std::string(data["title"]));
    // The rows are in the table.
    for (const char* key : {"rows", "cases", "title"}) figures.erase(key);
  }
  if (data["tables"].empty())
    throw input_error(folder.string(), "a folder without tables", "the folder of a run or study");
  for (const auto& entry : fs::directory_iterator(folder))
    if (fs::exists(entry.path() / kPageFile)) data["pages"].push_back(entry.path().filename().string());
  return output::report_page(output::PageKind::study, std::string(data["title"]),
                             data.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace handsim::study
