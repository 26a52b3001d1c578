#include "handsim/study/report.h"

#include <sys/utsname.h>
#include <time.h>

#include <algorithm>
#include <fstream>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/version.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/report/page.h"
#include "handsim/output/table/gnuplot.h"

namespace handsim::study {

namespace {

constexpr const char* kKinds[] = {".png", ".svg"};

std::string plot_commands(const Plot& plot) {
  return fmt::format(
      "do for [t in 'png svg'] {{\n  set output place('{0}.'.t)\n"
      "  if (t eq 'png') {{ set terminal pngcairo {1} }} else {{ set terminal svg {1} }}\n"
      "{2}  unset output\n}}\n",
      plot.name, plot.terminal, plot.commands);
}

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  std::string line;
  while (std::getline(file, line))
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown";
}

std::string operating_system() {
  utsname system{};
  uname(&system);
  return std::string(system.sysname) + " " + system.release;
}

namespace fs = std::filesystem;

/// Tables of the studies, and the files with their titles and versions.
struct Kind {
  const char* table;
  const char* about;
  const char* row;  ///< what a row is, for the title of a study without one
};
constexpr Kind kStudyTables[] = {{"accuracy.csv", "accuracy.json", "method"},
                                 {"effects.csv", "effects.json", "effect"},
                                 {"stability.csv", "stability.json", "figure"},
                                 {"uncertain.csv", nullptr, "figure"},
                                 {"rollouts.csv", "summary.json", "rollout"},
                                 {"grasps.csv", nullptr, "grasp"},
                                 {"climbs.csv", nullptr, "climb"},
                                 {"validate.csv", "validate.json", "measurement"}};

std::string text_of(const fs::path& path) {
  constexpr std::size_t kLargest = 1UL << 30U;
  return fs::exists(path) ? read_input_file(path, "a study's file", kLargest) : "";
}

Json read_json(const fs::path& path) {
  Json out = Json::parse(text_of(path), nullptr, false);
  return out.is_object() ? out : Json::object();
}

}  // namespace

double cpu_now() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string quoted(std::string text) {
  std::ranges::replace(text, '\n', ' ');
  for (std::size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2) text.insert(at, 1, '"');
  return "\"" + text + "\"";
}

void add_origin(Json& out) {
  out["machine"] = {{"processor", processor()}, {"system", operating_system()}};
  out["versions"] = {{"handsim", kVersion}, {"compiler", __VERSION__}};
}

bool write_report(const std::filesystem::path& out, const std::string& name, const Report& report) {
  output::make_folder(out);
  if (!report.csv.empty()) output::write_file(out / (name + ".csv"), report.csv);
  if (!report.json.empty()) output::write_file(out / (name + ".json"), report.json);
  std::string script = output::kPlotHead + std::string("set encoding utf8\n") + report.data;
  std::vector<std::string> files;
  for (const Plot& plot : report.plots) {
    script += plot_commands(plot);
    for (const char* kind : kKinds) files.push_back(plot.name + kind);
  }
  output::write_file(out / (name + ".gp"), script);
  return output::plot(name + ".gp", out, files);
}

std::vector<std::string> report_files(const std::string& name, const std::vector<std::string>& plots) {
  std::vector<std::string> out = {name + ".csv", name + ".json", name + ".gp", kStudyFile, kPageFile};
  for (const std::string& plot : plots)
    for (const char* kind : kKinds) out.push_back(plot + kind);
  return out;
}

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
               {"title", ""},
               {"handsim", fmt::format("{} ({})", kVersion, kCommit)},
               {"study", read_json(folder / kStudyFile)},
               {"tables", Json::array()},
               {"pages", Json::array()}};
  std::string counts;
  for (const auto& [table, about, row] : kStudyTables) {
    if (!fs::exists(folder / table)) continue;
    std::string csv = text_of(folder / table);
    if (csv.empty()) throw input_error((folder / table).string(), "an empty file", "a study's table");
    const auto count = std::ranges::count(csv, '\n') - 1;
    counts += fmt::format("{}{} {}{}", counts.empty() ? "" : ", ", count, row, count == 1 ? "" : "s");
    data["tables"].push_back({{"name", table}, {"csv", std::move(csv)}});
    if (!about) continue;
    Json& figures = data["about"] = read_json(folder / about);
    data["title"] = figures.value("title", std::string(data["title"]));
    // The rows are in the table.
    for (const char* key : {"rows", "cases", "title"}) figures.erase(key);
  }
  if (data["tables"].empty())
    throw input_error(folder.string(), "a folder without tables", "the folder of a run or study");
  if (data["title"] == "") data["title"] = counts;
  if (fs::exists(folder / kBandsFile)) data["bands"] = text_of(folder / kBandsFile);
  for (const auto& entry : fs::directory_iterator(folder))
    if (fs::exists(entry.path() / kPageFile)) data["pages"].push_back(entry.path().filename().string());
  return output::report_page(output::PageKind::study, std::string(data["title"]),
                             data.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace handsim::study
