#include "handsim/study/study_page.h"

#include <cmath>
#include <fstream>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/units.h"
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
    {"accuracy.csv", "accuracy.json"},   {"effects.csv", "effects.json"}, {"stability.csv", "stability.json"},
    {"rollouts.csv", "summary.json"},    {"grasps.csv", nullptr},         {"climbs.csv", nullptr},
    {"agreement.csv", "agreement.json"}, {"contacts_cost.csv", nullptr},  {"validate.csv", "validate.json"}};
constexpr std::size_t kLargestStudyFile = 256UL << 20U;

/// Fields of a line; one in double quotes may have commas and doubled quotes.
std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> out(1);
  bool in_quotes = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"' && in_quotes && i + 1 < line.size() && line[i + 1] == '"')
      out.back() += line[++i];
    else if (line[i] == '"')
      in_quotes = !in_quotes;
    else if (line[i] == ',' && !in_quotes)
      out.emplace_back();
    else
      out.back() += line[i];
  }
  return out;
}

/// A number with the digits that a page shows, else the text.
Json field_json(const std::string& field) {
  if (field.empty()) return nullptr;
  const auto value = parse_number(field);
  if (!value || !std::isfinite(*value)) return field;
  return parse_number(fmt::format("{:.7g}", *value)).value_or(*value);
}

/// The page of a row's run, relative to the study's folder; empty if there is none.
std::string page_of(const fs::path& folder, const std::vector<std::string>& columns,
                    const std::vector<std::string>& fields) {
  if (columns.size() < 2 || columns[0] != "scene" || columns[1] != "side") return {};
  for (const std::string& name : {fields[0] + "_" + fields[1], fields[0]})
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
  std::ifstream file(folder / name);
  std::string line;
  if (!std::getline(file, line))
    throw input_error((folder / name).string(), "an empty file", "a study's table");
  const std::vector<std::string> columns = fields_of(line);
  Json rows = Json::array(), pages = Json::array();
  bool any_page = false;
  for (int number = 2; std::getline(file, line); ++number) {
    const std::vector<std::string> fields = fields_of(line);
    if (fields.size() != columns.size())
      throw Error({Problem{Place{(folder / name).string(), number, 1}, "",
                           fmt::format("{} fields", fields.size()), fmt::format("{}", columns.size())}});
    Json row = Json::array();
    for (const std::string& field : fields) row.push_back(field_json(field));
    rows.push_back(std::move(row));
    pages.push_back(page_of(folder, columns, fields));
    any_page = any_page || !pages.back().get_ref<const std::string&>().empty();
  }
  Json out = {{"name", name}, {"columns", columns}, {"rows", std::move(rows)}};
  if (any_page) out["pages"] = std::move(pages);
  if (commands.contains("rows") && commands["rows"].contains(name)) out["commands"] = commands["rows"][name];
  if (commands.contains("templates") && commands["templates"].contains(name))
    out["template"] = commands["templates"][name];
  return out;
}

}  // namespace

void write_commands(const fs::path& out, const StudyCommands& commands) {
  const Json json = {{"command", commands.study}, {"rows", commands.rows}, {"templates", commands.templates}};
  output::write_file(out / kStudyFile, json.dump(1) + "\n");
}

bool is_study(const fs::path& folder) {
  return std::any_of(std::begin(kStudyTables), std::end(kStudyTables),
                     [&](const Kind& kind) { return fs::exists(folder / kind.table); });
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
