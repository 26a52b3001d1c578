#include "handsim/simulation/report/run_report.h"

#include <fmt/format.h>

#include "handsim/core/version.h"
#include "handsim/output/report/page.h"
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
  const std::optional<ContactRows> contacts = read_contacts(run);
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

}  // namespace

std::string run_report(const std::vector<std::filesystem::path>& folders) {
  output::require_three();
  Json data = {
      {"kind", "run"}, {"handsim", fmt::format("{} ({})", kVersion, kCommit)}, {"runs", Json::array()}};
  for (const std::filesystem::path& folder : folders) data["runs"].push_back(run_json(read_run(folder)));
  return output::report_page(output::PageKind::run, data["runs"][0]["title"].get<std::string>(),
                             data.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace handsim::simulation
