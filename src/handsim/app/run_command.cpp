#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/progress.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/engine/collision/overlap.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/pulleys.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/report/page.h"
#include "handsim/output/video/video.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/run/step_choice.h"
#include "handsim/simulation/snapshot.h"
#include "handsim/simulation/watch/state_hash.h"
#include "handsim/study/rollouts/rollout_study.h"

namespace handsim::app {

namespace {

/// Makes the folder `out` of default_out() for a file in it. @throws Error (input) if it cannot be made
void make_default_folder(const std::filesystem::path& file) {
  if (file.parent_path() == "out") output::make_folder("out");
}

/// Prints the worst joint in one line.
void print_tracking(const simulation::RunResult& result) {
  const simulation::AxisTracking* worst = simulation::Tracking::worst(result.tracking);
  if (!worst) return;
  print("  worst joint {}: rms error {:.3g} deg, largest {:.3g} deg at {:.3f} s", worst->name,
        kDegreesPerRadian * worst->rms_error, kDegreesPerRadian * worst->largest_error.value,
        worst->largest_error.time);
  if (worst->holds > 0) print(", steady {:.3g} deg", kDegreesPerRadian * worst->steady_error.value);
  if (worst->movements > 0) print(", overshoot {:.2g} %", 100 * worst->overshoot.value);
  print(", at its torque limit {:.2g} % of the time\n", 100 * worst->limit_share);
}

void print_parts(const std::vector<simulation::PartForce>& parts) {
  for (const simulation::PartForce& part : parts)
    print("      {:<7} {} contacts, normal {:.3g} N, friction {:.3g} N\n", part.part, part.contacts,
          part.normal, part.friction);
}

void print_grip(const char* when, const simulation::Grip& grip) {
  print(
      "    {}: {} contacts, {:.3g} N, {:.0f} % of the friction limit used; {}, epsilon {:.3g}, volume "
      "{:.3g}\n",
      when, grip.contacts, grip.normal, 100 * grip.friction_used,
      grip.wrenches.force_closure ? "force closure" : "no force closure", grip.wrenches.epsilon,
      grip.wrenches.volume);
  print_parts(grip.parts);
}

/// Nothing is said of how a lost object moved in the hand.
std::string motion_text(const simulation::GraspFigures& grasp) {
  if (!grasp.margin_measured()) return "";
  const double margin = 100 * grasp.margin();
  return fmt::format(
      "; slip {:.3g} um/s in the hold; moved {:.2g} mm during the shake, {:.2g} mm and {:.2g} deg after it; "
      "{:.0f} % {} the nearest limit",
      1e6 * grasp.slip, 1e3 * grasp.shaken_shift, 1e3 * grasp.shift, kDegreesPerRadian * grasp.turn,
      std::abs(margin), margin >= 0 ? "left of" : "beyond");
}

void print_grasps(const simulation::RunResult& result) {
  for (const simulation::GraspFigures& grasp : result.grasps) {
    if (!grasp.complete) {
      print("  grasp {}: the run ended before the grasp{}\n", grasp.name,
            grasp.outcome() != simulation::Outcome::cut_off ? ", the object is " + grasp.told() : "");
      continue;
    }
    print("  grasp {}: {}{}\n", grasp.name, grasp.told(), motion_text(grasp));
    print_grip("end of the hold", grasp.hold);
    print_grip("after the shake", grasp.after);
    if (grasp.disagree())
      print("    note: {}, though the contacts {} force closure\n", grasp.held ? "held" : "not held",
            grasp.after.wrenches.force_closure ? "have" : "have no");
  }
}

void print_loaded(const char* when, const simulation::LoadedGrip& grip) {
  print("    {}: {:.4g} N, palm moved {:.2g} mm, {} contacts\n", when, grip.load, 1e3 * grip.travel,
        grip.contacts);
  print_parts(grip.parts);
  for (const simulation::FingerLoad& load : grip.fingers)
    print(
        "      {:<7} tendons: deep {:.3g} N, superficial {:.3g} N; pulleys: A2 {:.3g} N ({:.0f} % of what "
        "cadaver fingers bore), A4 {:.3g} N ({:.0f} %)\n",
        load.finger, load.deep, load.superficial, load.a2, 100 * load.a2 / model::kA2Strength, load.a4,
        100 * load.a4 / model::kA4Strength);
}

void print_climbs(const simulation::RunResult& result) {
  for (const simulation::ClimbFigures& climb : result.climbs) {
    if (!climb.complete)
      print("  climb {}: the run ended before the climb{}\n", climb.name,
            climb.begun() ? "; up to then" : "");
    if (!climb.begun()) continue;
    print(
        "  climb {}: {} {:.4g} N, {:.0f} % of the grip strength for this sex, age and stature ({:.0f} N, "
        "standard deviation {:.0f} N)\n",
        climb.name, climb.failed ? "fails beyond" : "holds", climb.carried, 100 * climb.share(),
        climb.strength.norm, climb.strength.deviation);
    if (climb.strength.measured) print("    the person's own grip strength: {:.0f} N\n", climb.strength.own);
    print_loaded("at half of that load", climb.half);
    print_loaded("at the largest load", climb.last);
  }
}

/// @param files `; files in OUT`, or nothing.
void print_result(const scene::Scene& scene, const simulation::RunResult& result, const std::string& files) {
  print("{}\n", scene.spec.title);
  print("  {:<16} {:>12} {:>12}  {:<12} {}\n", "criterion", "measured", "limit", "verdict", "where");
  for (const simulation::Verdict& v : result.verdicts) {
    const std::string limit = v.limit ? fmt::format("{:.4g} {}", *v.limit, v.unit) : "-";
    const std::string where = v.where.empty() ? "" : fmt::format("{} at {:.3f} s", v.where, v.time);
    print("  {:<16} {:>12} {:>12}  {:<12} {}\n", v.name,
          v.measured ? fmt::format("{:.4g} {}", *v.measured, v.unit) : "-", limit,
          !v.limit     ? "-"
          : v.missed() ? "NOT MEASURED"
          : v.held()   ? "held"
                       : "FAILED",
          v.measured ? where : "");
  }
  print_tracking(result);
  print_grasps(result);
  print_climbs(result);
  print("  verdict: {}\n", result.fault                 ? "diverged"
                           : !result.hash_as_expected() ? "the state hash differs from the expected one"
                           : !result.judged()           ? "no criterion has a limit"
                           : result.failed()            ? "a criterion failed"
                           : result.missed()            ? "a criterion was NOT MEASURED: the run ended before"
                                                        : "every criterion held");
  print("  {:.3g} s simulated in {:.3g} s ({:.0f} times real time){}\n", result.simulated, result.wall,
        result.wall > 0 ? result.simulated / result.wall : 0, files);
}

/// Prints a line for each failed criterion, if there is no table.
void print_failures(const simulation::RunResult& result) {
  for (const simulation::Verdict& v : result.verdicts)
    if (!v.held())
      print_error("criterion {}: got {}, need {} {:.4g} {}{}\n", v.name,
                  v.measured ? fmt::format("{:.4g} {}", *v.measured, v.unit) : "nothing measured",
                  v.least ? "at least" : "at most", *v.limit, v.unit,
                  v.where.empty() || v.missed() ? "" : fmt::format(" ({} at {:.3f} s)", v.where, v.time));
}

/// Uncertain hands of the scene: becomes the command that draws them.
[[noreturn]] void run_uncertain(const RunArguments& arguments) {
  run_drawn({{"file", arguments.scene.string()},
             {"overrides", arguments.overrides},
             {"count", *arguments.uncertain},
             {"out", arguments.out.string()},
             {"report", arguments.report},
             {"on", arguments.on}});
}

/// @throws Error (input) for options that many runs cannot have.
void check_many(const RunArguments& of) {
  if (of.frames > 0 || of.pose_pictures || of.video || of.plots || of.snapshot_at || of.from_snapshot ||
      of.expected_hash || of.json || of.quiet)
    throw input_error("--uncertain", "options of one run",
                      "--out, --set, --engine and --report alone, or --rollout beside it");
}

/// A scene, or one of a study's rollouts.
/// @param stop_lost whether the study ends a run that is decided.
scene::Scene scene_of(const RunArguments& arguments, bool& stop_lost) {
  if (!arguments.rollout) return scene::load_scene(arguments.scene, arguments.overrides);
  const study::RolloutStudy study(
      study::asked_rollouts({arguments.scene, arguments.uncertain.has_value(), arguments.overrides,
                             arguments.uncertain, arguments.seed}));
  print_warnings(study.warnings());
  stop_lost = study.spec().stop_lost;
  return study.scene(*arguments.rollout);
}

/// What was chosen for `auto`, and why.
void print_choice(const scene::SceneSpec& scene) {
  if (!scene.engine_choice.empty()) print("engine auto: {}\n", scene.engine_choice);
  if (!scene.step_choice.empty()) print("step auto: {}\n", scene.step_choice);
}

/// One picture, drawn in a child process.
void render_picture(const scene::Scene& scene, const RenderArguments& arguments) {
  const simulation::PictureState moment = simulation::picture_state_at(scene, arguments.time.value_or(0));
  const auto draw = [&](const output::Progress&) {
    output::write_png(simulation::draw({scene.model, scene.spec.pictures}, moment, arguments.gl),
                      *arguments.out);
  };
  if (const auto failure = output::run_in_child(draw, {}))
    throw output_error(arguments.out->string(), "no picture: " + *failure,
                       "memory, room on the disk, or a smaller pictures.size");
}

void render_video(const scene::Scene& scene, const RenderArguments& arguments) {
  const simulation::VideoSpec& spec = *arguments.video;
  const simulation::Film film = with_progress([&](const auto& show) {
    return simulation::film_until(scene, spec, arguments.time.value_or(scene.spec.duration), show);
  });
  const auto draw = [&](const output::Progress& progress) {
    film.write(scene.spec.pictures, {arguments.gl, output::core_count(), 0}, progress);
  };
  if (const auto failure = with_progress([&](const auto& show) { return output::run_in_child(draw, show); }))
    throw output_error(spec.file.string(), "no video: " + *failure,
                       "memory, room on the disk, or a smaller pictures.size");
}

}  // namespace

std::vector<std::string> overlap_texts(const model::Model& model, std::vector<engine::Overlap> overlaps) {
  constexpr std::size_t kNamed = 10;
  std::ranges::stable_sort(
      overlaps, [](const engine::Overlap& a, const engine::Overlap& b) { return a.depth > b.depth; });
  std::vector<std::string> out;
  for (std::size_t i = 0; i < std::min(overlaps.size(), kNamed); ++i)
    out.push_back(fmt::format("{} and {} overlap by {:.2g} mm at the start",
                              model.shapes[as_index(overlaps[i].shape_a)].name,
                              model.shapes[as_index(overlaps[i].shape_b)].name, 1e3 * overlaps[i].depth));
  if (overlaps.size() > kNamed)
    out.push_back(fmt::format("{} more pairs overlap, by less", overlaps.size() - kNamed));
  return out;
}

void record_contacts(scene::Scene& scene) {
  if (!scene.spec.solver.effects.any_contact()) return;
  scene.spec.record_contacts = true;
  scene.spec.solver.contact_forces = true;
}

int run_scene_command(const RunArguments& arguments) {
  bool stop_lost = false;
  if (arguments.report) {
    output::require_three();
    if (!arguments.page)
      throw input_error("--report", "a process without the Python package", "the program handsim");
  }
  if (arguments.uncertain && !arguments.rollout) {
    check_many(arguments);
    run_uncertain(arguments);
  }
  scene::Scene scene = simulation::with_chosen_step(scene_of(arguments, stop_lost));
  if (arguments.report) record_contacts(scene);
  print_warnings(scene.warnings);
  if (!arguments.quiet && !arguments.json) print_choice(scene.spec);
  simulation::RunResult result = with_progress([&](const auto& show) {
    simulation::RunOptions options = arguments;
    options.stop_lost = stop_lost;
    options.monitor = arguments.report;
    options.draw_apart = true;
    if (!arguments.quiet) options.progress = show;
    options.note = [](const std::string& text) { print_error("note: {}\n", text); };
    return simulation::run(scene, options);
  });
  if (arguments.report)
    if (const std::string why = arguments.page(arguments.out); !why.empty())
      result.missing.push_back("report: " + why);
  print_warnings(overlap_texts(scene.model, result.overlaps));
  print_warnings(result.warnings);
  if (arguments.json)
    print_text(result.summary);
  else if (!arguments.quiet)
    print_result(scene, result, arguments.passing ? "" : "; files in " + arguments.out.string());
  if (arguments.quiet) print_failures(result);
  if (result.fault) print_error("{}\n", Error(*result.fault).what());
  for (const std::string& what : result.missing) print_error("missing: {}\n", what);
  if (!result.hash_as_expected())
    print_error(
        "state hash: got {}, expected {}: scene, settings, build or mathematics library (here {}) differ\n",
        simulation::hash_text(result.state_hash), simulation::hash_text(*result.expected_hash),
        simulation::mathematics());
  return result.passed() && result.missing.empty() ? 0 : 1;
}

int render_command(const RenderArguments& arguments) {
  output::require_pictures();
  if (arguments.out && lower_case(arguments.out->extension().string()) != ".png")
    throw input_error("--out", arguments.out->string(), "a name that ends in .png");
  const auto& video = arguments.video;
  const scene::Scene scene = scene::load_scene(arguments.scene, arguments.overrides);
  print_warnings(scene.warnings);
  print_choice(scene.spec);
  if (arguments.time.value_or(0) > scene.spec.duration)
    throw input_error("--time", fmt::format("{:g} s", *arguments.time),
                      fmt::format("0 to the scene's duration of {:g} s", scene.spec.duration));
  const auto read = [&] { return scene::files_read(scene); };
  if (arguments.out) {
    make_default_folder(*arguments.out);
    output::check_target("--out", *arguments.out, {"a PNG picture", "\x89PNG"}, read);
  }
  if (video) {
    make_default_folder(video->file);
    output::check_video(video->file, video->fps, read);
  }
  print_warnings(
      overlap_texts(scene.model, engine::initial_overlaps(scene.model, model::initial_state(scene.model))));
  if (arguments.out) {
    render_picture(scene, arguments);
    print("{}\n", arguments.out->string());
  }
  if (video) {
    render_video(scene, arguments);
    print("{}\n", video->file.string());
  }
  return 0;
}

}  // namespace handsim::app
