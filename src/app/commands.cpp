#include "handsim/app/commands.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/units.h"

namespace handsim::app {

namespace {

constexpr int kBadInput = 2;
constexpr int kFailed = 1;

/// Prints an Error as the exit status that it stands for.
template <class Command>
int guarded(Command command) {
  try {
    return command();
  } catch (const Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return error.kind() == ErrorKind::input ? kBadInput : kFailed;
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "handsim: out of memory\n");
    return kFailed;
  }
}

void add_hand(CLI::App& app, HandArguments& arguments) {
  CLI::App* hand = app.add_subcommand("hand", "Hands of a person: dimensions, masses, joints; with --out also YAML and a picture");
  hand->footer("Example: handsim hand --stature 1.75 --mass 72 --sex male --side both --out out/hand");
  hand->add_option("--person", arguments.person, "person file (in place of --stature, --mass, --sex)");
  hand->add_option("--stature", arguments.stature, "m, or with a unit: 1.75, \"175 cm\"");
  hand->add_option("--mass", arguments.mass, "kg");
  hand->add_option("--sex", arguments.sex, "male, female or unknown");
  hand->add_option("--hand-length", arguments.hand_length, "measured: wrist crease to middle fingertip [m]");
  hand->add_option("--hand-breadth", arguments.hand_breadth, "measured: across the knuckles [m]");
  hand->add_option("--hand-circumference", arguments.hand_circumference, "measured: around the knuckles [m]");
  hand->add_option("--hand-mass", arguments.hand_mass, "measured [kg]");
  hand->add_option("--hand-length-percentile", arguments.hand_length_percentile, "among people of this body, 0.01 to 99.99");
  hand->add_option("--model", arguments.model, "hand model file (default: the anatomical hand)");
  hand->add_option("--side", arguments.side, "right, left or both")->check(CLI::IsMember({"right", "left", "both"}));
  hand->add_option("--out", arguments.out, "folder for hand.yaml and hand.png");
}

void add_check(CLI::App& app, std::vector<std::filesystem::path>& files) {
  CLI::App* check = app.add_subcommand("check", "Validate scenes, persons, hand models, controllers and poses: say every problem, run nothing");
  check->footer("Example: handsim check config/two_hands.yaml config/persons/child.yaml");
  check->add_option("files", files, "YAML files")->required();
}

void add_run(CLI::App& app, RunArguments& arguments) {
  CLI::App* run = app.add_subcommand("run", "Simulate a scene: trajectory.csv, summary.json, resolved.yaml, pictures");
  run->footer("Example: handsim run config/two_hands.yaml --out out/two_hands --frames 8 --set solver.step=\"2 ms\"");
  run->add_option("scene", arguments.scene, "scene file")->required();
  run->add_option("--out", arguments.out, "folder for the run's files")->required();
  run->add_option("--set", arguments.overrides, "override a key of the scene: solver.step=\"5 ms\"; may be repeated");
  run->add_option("--frames", arguments.frames, "pictures over the run, and a contact sheet of them")->check(CLI::Range(0, 10000));
  run->add_flag("--poses", arguments.poses, "a picture at the end of every hold of a controlled scene, in place of --frames");
  run->add_flag("--plots", arguments.plots, "plots of a controlled scene: angles, errors, torques (needs gnuplot)");
  run->add_flag("--quiet", arguments.quiet, "print nothing but problems");
  run->add_flag("--json", arguments.json, "print summary.json in place of the table");
}

void add_render(CLI::App& app, RenderArguments& arguments) {
  CLI::App* render = app.add_subcommand("render", "One picture of a scene at a time of its motion");
  render->footer("Example: handsim render config/two_hands.yaml --out hands.png --time 0.2");
  render->add_option("scene", arguments.scene, "scene file")->required();
  render->add_option("--out", arguments.out, "PNG file")->required();
  render->add_option("--set", arguments.overrides, "override a key of the scene");
  render->add_option_function<std::string>("--time", [&arguments](const std::string& text) {
    const auto value = parse_quantity(text, Dimension::time);
    if (!value || *value < 0) throw CLI::ValidationError("--time", "got " + text + ", need a time such as 0.2 or \"200 ms\"");
    arguments.time = *value;
  }, "simulated time (default 0)");
}

}  // namespace

int run_command_line(int argc, const char* const* argv) {
  CLI::App app("handsim: biomechanical hands of a given person, simulated with the Open Dynamics Engine");
  app.set_version_flag("--version", std::string("handsim ") + HANDSIM_VERSION);
  app.require_subcommand(1);
  app.footer("handsim COMMAND --help says more. Exit status: 0 done, all criteria held; 1 a criterion failed or the "
             "simulation diverged; 2 bad input.");
  HandArguments hand;
  std::vector<std::filesystem::path> files;
  RunArguments run;
  RenderArguments render;
  add_hand(app, hand);
  add_check(app, files);
  add_run(app, run);
  add_render(app, render);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11's own codes are many; usage problems are exit status 2 here.
    return app.exit(error) == 0 ? 0 : kBadInput;
  }
  if (app.got_subcommand("hand")) return guarded([&] { return hand_command(hand); });
  if (app.got_subcommand("check")) return guarded([&] { return check_command(files); });
  if (app.got_subcommand("run")) return guarded([&] { return run_scene_command(run); });
  return guarded([&] { return render_command(render); });
}

}  // namespace handsim::app
