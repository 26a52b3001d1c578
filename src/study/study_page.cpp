#include "handsim/study/study_page.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string_view>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/units.h"
#include "handsim/core/version.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/report/page.h"
#include "handsim/output/table/read_rows.h"
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
constexpr std::size_t kLargestStudyFile = 256UL << 20U;

/// A number with the digits that a page shows, else the text.
Json field_json(std::string_view field) {
  if (field.empty()) return nullptr;
  const auto value = parse_number(std::string(field));
  if (!value || !std::isfinite(*value)) return field;
  return parse_number(fmt::format("{:.7g}", *value)).value_or(*value);
}

/// The page of a row's run, relative to the study's folder; empty if there is none.
std::string page_of(const fs::path& folder, const std::string& scene, const std::string& side) {
  for (const std::string& name : {scene + "_" + side, scene})
    if (name.find('/') == std::string::npos && fs::exists(folder / name / kPageFile))
      return name + "/" + kPageFile;
  return {};
}

Json read_json(const fs::path& path) {
  if (!fs::exists(path)) return Json::object();
  Json out = Json::parse(read_input_file(path, "a study's JSON", kLargestStudyFile), nullptr, false);
  return out.is_object() ? out : Json::object();
}

Json table_json(const fs::path& folder, const std::string& name, const Json& commands) {
  Json rows = Json::array();
  std::vector<std::string> pages;
  const auto take = [&](std::size_t, std::span<const std::string_view> fields) {
    Json& row = rows.emplace_back(Json::array());
    for (const std::string_view field : fields) row.push_back(field_json(field));
    if (fields.size() > 1) pages.push_back(page_of(folder, std::string(fields[0]), std::string(fields[1])));
  };
  const std::vector<std::string> columns = output::read_rows(folder / name, take);
  if (columns.front().empty())
    throw input_error((folder / name).string(), "an empty file", "a study's table");
  Json out = {{"name", name}, {"columns", columns}, {"rows", std::move(rows)}};
  const bool of_scenes = columns.size() > 1 && columns[0] == "scene" && columns[1] == "side";
  if (of_scenes &&
      std::any_of(pages.begin(), pages.end(), [](const std::string& page) { return !page.empty(); }))
    out["pages"] = std::move(pages);
  if (commands.contains("rows") && commands["rows"].contains(name)) out["commands"] = commands["rows"][name];
  if (commands.contains("templates") && commands["templates"].contains(name))
    out["template"] = commands["templates"][name];
  return out;
}

}  // namespace

std::string command_text(const char* word, const fs::path& file, const std::vector<std::string>& overrides) {
  std::string out = fmt::format("handsim {} {}", word, output::shell_word(file.string()));
  for (const std::string& set : overrides) out += " --set " + output::shell_word(set);
  return out + " --out again";
}

std::string run_text(const fs::path& scene, std::vector<std::string> overrides, double step) {
  overrides.push_back(fmt::format("solver.step={}", step));
  return command_text("run", scene, overrides);
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
  const Json commands = read_json(folder / kStudyFile);
  Json data = {{"kind", "study"},
               {"name", folder.lexically_normal().string()},
               {"handsim", fmt::format("{} ({})", kVersion, kCommit)},
               {"command", commands.value("command", "")},
               {"tables", Json::array()}};
  std::string title;
  for (const Kind& kind : kStudyTables) {
    if (!fs::exists(folder / kind.table)) continue;
    data["tables"].push_back(table_json(folder, kind.table, commands));
    if (!kind.about) continue;
    Json about = read_json(folder / kind.about);
    title = about.value("title", title);
    // The rows are in the table.
    for (const char* key : {"rows", "cases", "title"}) about.erase(key);
    data["about"] = std::move(about);
  }
  if (data["tables"].empty())
    throw input_error(folder.string(), "a folder without tables", "the folder of a run or study");
  if (title.empty()) title = folder.lexically_normal().filename().string();
  data["title"] = title;
  return output::report_page(output::PageKind::study, title,
                             data.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace handsim::study
