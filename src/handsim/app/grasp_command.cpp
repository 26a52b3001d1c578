#include <set>

#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/progress.h"
#include "handsim/core/units.h"
#include "handsim/study/grasp/grasp_study.h"

namespace handsim::app {

namespace {

void print_climbs(const std::vector<study::ClimbRow>& rows) {
  print("{:<24} {:<6} {:<8} {:>8} {:>9} {:>9} {:>8} {:>9} {:>9}\n", "scene", "hand", "verdict", "load",
        "norm", "of norm", "moved", "contacts", "criteria");
  print("{:<24} {:<6} {:<8} {:>8} {:>9} {:>9} {:>8} {:>9} {:>9}\n", "", "", "", "N", "N", "%", "mm", "", "");
  for (const study::ClimbRow& row : rows) {
    const simulation::ClimbFigures& f = row.figures;
    const char* verdict = !row.fault.empty() ? "diverged"
                          : f.failed         ? "failed"
                          : !f.complete      ? "cut off"
                                             : "holds";
    print("{:<24} {:<6} {:<8} {:>8.4g} {:>9.4g} {:>9.3g} {:>8.2g} {:>9} {:>9}\n", row.scene, row.side,
          verdict, f.carried, f.strength.norm, 100 * f.share(), 1e3 * f.last.travel, f.last.contacts,
          row.passed   ? "held"
          : f.complete ? "FAILED"
                       : "NOT MEASURED");
    if (!row.fault.empty()) print_error("{}\n", row.fault);
  }
}

/// `-` where it has not been measured.
std::string figure(bool measured, double value) { return measured ? fmt::format("{:.3g}", value) : "-"; }

std::string margin_text(const simulation::GraspFigures& figures) {
  return figures.margin_measured() ? fmt::format("{:.0f}", 100 * figures.margin()) : "-";
}

void print_table(const std::vector<study::GraspRow>& rows) {
  constexpr const char* kHead =
      "{:<24} {:<6} {:<9} {:>8} {:>7} {:>8} {:>9} {:>9} {:>8} {:>9} {:>8} {:>8} {:>9} {:>9}\n";
  print(kHead, "scene", "hand", "verdict", "criteria", "margin", "slip", "in shake", "after it", "turned",
        "contacts", "grip", "epsilon", "volume", "friction");
  print(kHead, "", "", "", "", "%", "um/s", "mm", "mm", "deg", "", "N", "", "", "least");
  const auto print_row = [&](const std::string& name, const std::string& side, const char* verdict,
                             const char* criteria, const simulation::GraspFigures& f,
                             const std::string& least) {
    const bool held = f.hold_measured(), end = f.complete;
    print(kHead, name, side, verdict, criteria, margin_text(f), figure(held, 1e6 * f.slip),
          figure(held, 1e3 * f.shaken_shift), figure(end, 1e3 * f.shift),
          figure(end, kDegreesPerRadian * f.turn), figure(end, f.after.contacts), figure(end, f.after.normal),
          figure(end, f.after.wrenches.epsilon), figure(end, f.after.wrenches.volume), least);
  };
  for (const study::GraspRow& row : rows) {
    const simulation::GraspFigures& f = row.figures;
    const bool marginal = row.turning && !row.turning->empty();
    const char* verdict = !row.fault.empty() ? "diverged"
                          : row.uncertain()  ? "uncertain"
                          : marginal         ? "marginal"
                                             : word(f.outcome());
    print_row(row.scene, row.side, verdict, row.passed ? "held" : "FAILED", f,
              row.smallest_friction ? fmt::format("{:.2g}", *row.smallest_friction) : "-");
    if (row.half_step)
      print_row("  at half the step", "", word(row.half_step->outcome()), "", *row.half_step, "-");
    if (row.uncertain())
      print("  note: {}; {} at half the step: the step decides\n", f.told(), row.half_step->told());
    if (marginal)
      print("  note: {}; {} turns it\n", f.told(), *row.turning);
    else if (!row.uncertain() &&
             (f.outcome() == simulation::Outcome::moved || f.outcome() == simulation::Outcome::lost))
      print("  note: {}\n", f.told());
    if (!row.not_searched.empty()) print("  note: no search for the least friction: {}\n", row.not_searched);
    if (f.disagree())
      print("  note: {}, though the contacts {} force closure\n", f.held ? "held" : "not held",
            f.held ? "have no" : "have");
    if (!row.fault.empty()) print_error("{}\n", row.fault);
  }
}

void add_pages(study::GraspTables& tables, const std::filesystem::path& out, const WritePage& page) {
  std::set<std::filesystem::path> folders;
  const auto add = [&](const study::RunRow& row) {
    for (const std::string& name : {row.scene + "_" + row.side, row.scene})
      if (std::filesystem::exists(out / name / "trajectory.csv")) folders.insert(out / name);
  };
  for (const study::GraspRow& row : tables.grasps) add(row);
  for (const study::ClimbRow& row : tables.climbs) add(row);
  for (const std::filesystem::path& folder : folders)
    if (const std::string why = page(folder); !why.empty()) tables.missing.push_back("report: " + why);
}

/// Hands that are drawn of each scene: becomes the command that draws them.
[[noreturn]] void uncertain_grasps(const study::GraspStudy& study, const GraspArguments& arguments) {
  if (study.friction || study.friction_search || study.margin || study.confirm || study.pictures ||
      study.video)
    throw input_error("--uncertain", "options of one run of each scene",
                      "--out, --side, --persons, --set, --engine, --on and --report alone");
  const auto texts = [](const std::vector<std::filesystem::path>& paths) {
    study::Json out = study::Json::array();
    for (const std::filesystem::path& path : paths) out.push_back(path.string());
    return out;
  };
  run_drawn({{"scenes", texts(study.scenes)},
             {"sides", study.sides},
             {"persons", texts(study.persons)},
             {"overrides", study.overrides},
             {"count", *arguments.uncertain},
             {"out", arguments.out.string()},
             {"report", arguments.report},
             {"on", arguments.on},
             {"command",
              fmt::format("{} --uncertain {}", study::grasp_commands(study).study, *arguments.uncertain)}});
}

}  // namespace

int grasp_command(const GraspArguments& arguments) {
  study::GraspStudy study = arguments;
  if (arguments.side == "both")
    study.sides = {"right", "left"};
  else if (!arguments.side.empty())
    study.sides = {arguments.side};
  if (arguments.uncertain) uncertain_grasps(study, arguments);
  const study::StudyCommands commands = study::grasp_commands(study);
  if (arguments.report) {
    require_pages(arguments.page);
    study.overrides.emplace_back("record.contacts=true");
  }
  if (study.video && study.video->file.has_parent_path())
    throw input_error("--video", study.video->file.string(), "a name without a folder, such as grasp.mp4");
  study.draw_apart = true;
  study::GraspTables tables = with_progress([&](const auto& show) {
    study.progress = show;
    return study::run_grasps(study);
  });
  if (arguments.report) add_pages(tables, arguments.out, arguments.page);
  study::finish_study(arguments.out, commands, arguments.report);
  if (!tables.grasps.empty()) print_table(tables.grasps);
  if (!tables.climbs.empty()) print_climbs(tables.climbs);
  for (const study::RefusedGrasp& grasp : tables.refused)
    print("not for this hand: {} {}: {}\n", grasp.scene, grasp.side, grasp.why);
  print("files in {}\n", arguments.out.string());
  for (const std::string& what : tables.missing) print_error("missing: {}\n", what);
  return tables.passed() && tables.missing.empty() ? 0 : 1;
}

}  // namespace handsim::app
