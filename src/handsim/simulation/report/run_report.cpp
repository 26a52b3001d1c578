#include "handsim/simulation/report/run_report.h"

#include <cmath>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/version.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/report/page.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/report/run_data.h"

namespace handsim::simulation {

namespace {

std::string command_of(const RunFiles& run) {
  std::string out =
      fmt::format("handsim run {} --out again", output::shell_word((run.folder / "resolved.yaml").string()));
  if (run.summary.contains("continued_from_s")) out += " --from-snapshot snapshot.bin";
  const Json hash = run.summary.value("state_hash", Json());
  return hash.is_string() ? out + " --expect-hash " + hash.get<std::string>() : out;
}

Json run_json(const RunFiles& run) {
  const std::optional<RecordedContacts> contacts = read_contacts(run);
  std::vector<PartCurve> sums;
  Json out = {{"name", run.folder.lexically_normal().string()},
              {"title", run.summary["title"]},
              {"command", command_of(run)},
              {"resolved", run.resolved},
              {"summary", run.summary},
              {"scene", scene_json(run, contacts)},
              {"poses", poses_json(run)},
              {"contacts", contacts_json(run, contacts, sums)}};
  out["curves"] = curves_json(run, sums, out["zero"]);
  out["marks"] = marks_json(run);
  return out;
}

constexpr std::size_t kLargestText = 64UL << 20U;

/// What the page reads of a summary, by example; a key with `?` may be absent or null.
constexpr const char* kSummary = R"({
  "title": "", "verdict": "", "state_hash?": "", "missing?": [""], "warnings?": [""],
  "criteria": [{"name": "", "verdict": "", "unit": "", "measured?": 0, "limit?": 0, "limit_is?": "", "where?": "", "time_s?": 0}],
  "solver": {"engine": "", "method": "", "step_s": 0}, "versions": {"handsim": ""},
  "time?": {"simulated_s": 0, "loop_wall_s": 0}, "convergence?": {"warnings?": [""]},
  "fault?": {"time_s": 0, "where": "", "quantity": "", "detail": ""},
  "climbs?": [{"name": "", "failure_time_s?": 0}], "grasps?": [{"name": "", "lost_time_s?": 0}]})";

/// The key of the first value that is not as in the example; empty if there is none.
std::string unlike(const Json& value, const Json& example, const std::string& key) {
  if (example.is_number() ? !value.is_number() : value.type() != example.type()) return key;
  std::string out;
  if (example.is_array())
    for (std::size_t i = 0; i < value.size() && out.empty(); ++i)
      out = unlike(value[i], example[0], fmt::format("{}.{}", key, i));
  if (!example.is_object()) return out;
  for (const auto& [name, of] : example.items()) {
    const std::string plain = name.substr(0, name.find('?')), inner = key.empty() ? plain : key + "." + plain;
    const bool absent = !value.contains(plain) || value[plain].is_null();
    if (absent && plain == name) return inner;
    if (out.empty() && !absent) out = unlike(value[plain], of, inner);
  }
  return out;
}

Json read_summary(const std::filesystem::path& path) {
  Json out = Json::parse(read_input_file(path, "a run's summary.json", kLargestText), nullptr, false);
  const std::string key = out.is_object() ? unlike(out, Json::parse(kSummary), "") : "a JSON object";
  if (!key.empty())
    throw input_error(path.string(), "no summary of a run: " + key + " is missing or wrong",
                      "summary.json of handsim run");
  return out;
}

/// @throws Error (input) at the first row with an orientation that is none.
void check_orientations(const RunFiles& run, const std::filesystem::path& path) {
  for (std::size_t row = 0; row < run.trajectory.rows(); ++row)
    for (std::size_t c = run.first_pose() + 3; c < run.trajectory.columns.size(); c += 7) {
      double square = 0;
      for (std::size_t i = c; i < c + 4; ++i) square += std::pow(run.trajectory.at(row, i), 2);
      if (!(std::abs(square - 1) < 1e-3))
        throw output::row_error(
            path, row + 2,
            fmt::format("{} to .qz of length {:g}", run.trajectory.columns[c], std::sqrt(square)),
            "a unit quaternion");
    }
}

}  // namespace

std::string run_report(const std::vector<std::filesystem::path>& folders,
                       const std::optional<RunTitle>& title) {
  output::require_three();
  Json data = {
      {"kind", "run"}, {"handsim", fmt::format("{} ({})", kVersion, kCommit)}, {"runs", Json::array()}};
  for (const std::filesystem::path& folder : folders) {
    data["runs"].push_back(run_json(read_run(folder)));
    Json &first = data["runs"][0]["scene"], &scene = data["runs"].back()["scene"];
    if (&scene != &first && scene["skins"] == first["skins"]) scene.erase("skins");
  }
  if (title) {
    data["runs"][0]["name"] = title->name;
    data["runs"][0]["command"] = title->command;
  }
  return output::report_page(output::PageKind::run, data["runs"][0]["title"].get<std::string>(),
                             data.dump(-1, ' ', false, Json::error_handler_t::replace));
}

std::size_t RunFiles::first_pose() const { return 1 + 2 * as_index(scene.model.dof_count()); }

model::State RunFiles::state(std::size_t row) const {
  model::State out = model::initial_state(scene.model);
  out.time = times[row];
  std::size_t column = first_pose();
  for (std::size_t b = 1; b < out.bodies.size(); ++b, column += 7) {
    const auto value = [&](std::size_t i) { return trajectory.at(row, column + i); };
    out.bodies[b].p = {value(0), value(1), value(2)};
    out.bodies[b].q = Quat(value(3), value(4), value(5), value(6)).normalized();
  }
  return out;
}

RunFiles read_run(const std::filesystem::path& folder) {
  const std::filesystem::path resolved = folder / "resolved.yaml";
  const std::filesystem::path table = folder / "trajectory.csv";
  if (!has_entry(table))
    throw input_error(folder.string(), "a folder without trajectory.csv", "the folder of a run");
  RunFiles run{folder,
               read_input_file(resolved, "a run's resolved.yaml", kLargestText),
               scene::load_scene(resolved),
               read_summary(folder / "summary.json"),
               output::read_numbers(table),
               {}};
  if (run.trajectory.columns != output::trajectory_columns(run.scene.model))
    throw input_error(table.string(), "columns of another scene", "the table of the run beside it");
  if (run.trajectory.rows() == 0) throw input_error(table.string(), "no rows", "a run that has started");
  check_orientations(run, table);
  for (std::size_t row = 0; row < run.trajectory.rows(); ++row)
    run.times.push_back(run.trajectory.at(row, 0));
  return run;
}

}  // namespace handsim::simulation
