#include "handsim/app/commands.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include "handsim/app/completion.h"
#include "handsim/app/console.h"
#include "handsim/core/version.h"
#include "handsim/core/yaml_reader.h"
#include "handsim/simulation/watch/state_hash.h"

namespace handsim::app {

namespace {

constexpr int kBadInput = 2;
constexpr int kFailed = 1;

/// Prints an Error as the exit status that it stands for. Takes no memory to say so.
template <class Command>
int guarded(Command command) {
  const auto failed = [](std::string_view head, const char* what, int status) {
    tell_text(head);
    tell_text(what);
    tell_text("\n");
    return status;
  };
  try {
    return command();
  } catch (const Error& error) {
    return failed("", error.what(), error.kind() == ErrorKind::input ? kBadInput : kFailed);
  } catch (const std::bad_alloc&) {
    return failed("handsim: ", "out of memory", kFailed);
  } catch (const std::exception& error) {
    return failed("handsim: ", error.what(), kFailed);
  }
}

/// Usage problems in the form of all others; empty for a good value, as CLI11 wants it.
std::string got_need(const std::string& got, const std::string& need) {
  return fmt::format("got {}, need {}", got, need);
}

/// A type with bars is a list of words, for the help and for completion.
constexpr const char* kSides = "right|left|both";
constexpr const char* kShells = "bash|zsh|fish|man";

std::string check_shell(const std::string& text) {
  const auto words = CLI::detail::split(kShells, '|');
  return std::find(words.begin(), words.end(), text) != words.end()
             ? ""
             : got_need(text, "bash, zsh, fish or man");
}

std::string check_side(const std::string& text) {
  return text == "right" || text == "left" || text == "both" ? "" : got_need(text, "right, left or both");
}

std::string check_frames(const std::string& text) {
  const auto value = parse_number(text);
  const bool good = value && *value >= 0 && *value <= 10000 && *value == std::floor(*value);
  return good ? "" : got_need(text, "a whole number of pictures, 0 to 10000");
}

std::string check_format(const std::string& text) {
  return text == "mjcf" || text == "urdf" ? "" : got_need(text, "mjcf or urdf");
}

std::string check_friction(const std::string& text) {
  const auto value = parse_number(text);
  return value && *value >= 0 && *value <= 10 ? "" : got_need(text, "a coefficient of friction, 0 to 10");
}

std::string check_target(const std::string& text) {
  const auto value = parse_number(text);
  return value && *value > 0 && std::isfinite(*value) ? "" : got_need(text, "an error above 0, such as 1e-3");
}

std::string check_path(const std::string& text) { return text.empty() ? got_need("\"\"", "a path") : ""; }

std::string check_engine(const std::string& text) {
  const std::vector<std::string> engines = {"ode", "dae", "articulated", "auto"};
  const bool known = std::find(engines.begin(), engines.end(), text) != engines.end();
  return known ? "" : got_need(text, need_word(text, engines));
}

/// `--set`, and `--engine` for `--set solver.engine=...`. CLI11 lets an option that may be repeated take
/// every word after it; these take one.
void add_overrides(CLI::App& app, std::vector<std::string>& overrides) {
  const auto engine = std::make_shared<std::string>();
  app.add_option(
         "--engine", *engine,
         "in place of the scene's, with that engine's default method; settings that it does not have are "
         "left out")
      ->type_name("ode|dae|articulated|auto")
      ->check(check_engine);
  // Before the others, which may then set what that engine has.
  app.callback([engine, &overrides] {
    if (!engine->empty()) overrides.insert(overrides.begin(), "solver.engine=" + *engine);
  });
  app.add_option("--set", overrides, "override a key of the scene: solver.step=\"5 ms\"; may be repeated")
      ->allow_extra_args(false);
}

void add_hand(CLI::App& app, HandArguments& arguments) {
  CLI::App* hand = app.add_subcommand(
      "hand", "Hands of a person: dimensions, masses, joints; with --out also YAML and a picture");
  hand->footer("Example: handsim hand --stature 1.75 --mass 72 --sex male --side both --out out/hand");
  hand->add_option("--person", arguments.person, "person file (in place of --stature, --mass, --sex)");
  hand->add_option("--stature", arguments.stature, "m, or with a unit: 1.75, \"175 cm\"");
  hand->add_option("--mass", arguments.mass, "kg");
  hand->add_option("--sex", arguments.sex, "of the person")->type_name("male|female|unknown");
  hand->add_option("--hand-length", arguments.hand_length, "measured: wrist crease to middle fingertip [m]");
  hand->add_option("--hand-breadth", arguments.hand_breadth, "measured: across the knuckles [m]");
  hand->add_option("--hand-circumference", arguments.hand_circumference, "measured: around the knuckles [m]");
  hand->add_option("--hand-mass", arguments.hand_mass, "measured [kg]");
  hand->add_option("--hand-length-percentile", arguments.hand_length_percentile,
                   "among people of this body, 0.01 to 99.99");
  hand->add_option("--model", arguments.model, "hand model file (default: the anatomical hand)");
  hand->add_option("--side", arguments.side, "which hands (default both)")
      ->type_name(kSides)
      ->check(check_side);
  hand->add_option("--out", arguments.out, "folder for hand.yaml and hand.png")->check(check_path);
}

void add_check(CLI::App& app, std::vector<std::filesystem::path>& files, bool& engines) {
  CLI::App* check = app.add_subcommand("check",
                                       "Validate scenes, persons, hand models, controllers, poses and "
                                       "motions: say every problem, run nothing");
  check->footer("Example: handsim check config/two_hands.yaml config/persons/child.yaml");
  check->add_option("files", files, "YAML files")->required();
  check->add_flag("--engines", engines,
                  "print which engines run each scene as it stands, and why others do not");
}

void add_run(CLI::App& app, RunArguments& arguments) {
  CLI::App* run =
      app.add_subcommand("run", "Simulate a scene: trajectory.csv, summary.json, resolved.yaml, pictures");
  run->footer(
      "Example: handsim run config/two_hands.yaml --out out/two_hands --frames 8 --set solver.step=\"2 ms\"");
  run->add_option("scene", arguments.scene, "scene file")->required();
  run->add_option("--out", arguments.out, "folder for the run's files")->required()->check(check_path);
  add_overrides(*run, arguments.overrides);
  CLI::Option* frames =
      run->add_option("--frames", arguments.frames, "pictures over the run, and a contact sheet of them")
          ->check(check_frames);
  run->add_flag("--poses", arguments.poses,
                "a picture at the end of every hold of a controlled scene, in place of --frames")
      ->excludes(frames);
  run->add_flag("--plots", arguments.plots,
                "plots of a controlled scene: angles, errors, torques (needs gnuplot)");
  run->add_option_function<std::string>(
      "--snapshot-at",
      [&arguments](const std::string& text) {
        const auto value = parse_quantity(text, Dimension::time);
        if (!value || *value < 0)
          throw CLI::ValidationError("--snapshot-at",
                                     got_need(text, "a time from 0, such as 0.2 or \"200 ms\""));
        arguments.snapshot_at = *value;
      },
      "write the run as it stands at this time as snapshot.bin");
  run->add_option(
         "--from-snapshot", arguments.from_snapshot,
         "go on from a snapshot.bin of this scene: tables and pictures of the rest, a summary of all")
      ->check(check_path);
  run->add_option_function<std::string>(
      "--expect-hash",
      [&arguments](const std::string& text) {
        arguments.expected_hash = simulation::parse_hash(text);
        if (!arguments.expected_hash)
          throw CLI::ValidationError(
              "--expect-hash", got_need(text, "the 16 hexadecimal digits of state_hash in summary.json"));
      },
      "exit 1 where the hash of all states (state_hash in summary.json) is another");
  run->add_flag("--quiet", arguments.quiet, "print nothing but problems");
  run->add_flag("--json", arguments.json, "print summary.json in place of the table");
}

void add_render(CLI::App& app, RenderArguments& arguments) {
  CLI::App* render = app.add_subcommand("render", "One picture of a scene at a time of its motion");
  render->footer("Example: handsim render config/two_hands.yaml --out hands.png --time 0.2");
  render->add_option("scene", arguments.scene, "scene file")->required();
  render->add_option("--out", arguments.out, "PNG file: .png")->required()->check(check_path);
  add_overrides(*render, arguments.overrides);
  render->add_option_function<std::string>(
      "--time",
      [&arguments](const std::string& text) {
        const auto value = parse_quantity(text, Dimension::time);
        if (!value || *value < 0)
          throw CLI::ValidationError("--time", got_need(text, "a time from 0, such as 0.2 or \"200 ms\""));
        arguments.time = *value;
      },
      "simulated time (default 0)");
}

/// A missing or unknown command, which CLI11 only calls missing.
Error command_error(const CLI::App& app, int argc, const char* const* argv) {
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    known.push_back(command->get_name());
  const std::string got = argc > 1 ? argv[1] : "nothing";
  return input_error("command", got, need_word(got, known));
}

/// An option that the command has not, or a word too many; nothing where the problem is another.
std::optional<Error> option_error(const CLI::App& command) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (const std::string& word : command.remaining()) {
    if (!word.starts_with('-'))
      return input_error("arguments", "one too many, " + word,
                         "none more; a value with a blank in it stands in quotes");
    const std::string option = word.substr(0, word.find('='));
    return input_error(option, "an unknown option", need_word(option, known));
  }
  return std::nullopt;
}

void add_grasp(CLI::App& app, GraspArguments& arguments) {
  CLI::App* grasp = app.add_subcommand("grasp",
                                       "Run grasp and climb scenes and say in a table what was held, how "
                                       "firmly, with what friction at least, and "
                                       "what load a hand carried on a hold");
  grasp->footer("Example: handsim grasp config --out out/grasps --side both");
  grasp->add_option("scenes", arguments.scenes, "scene files, or folders of them")->required();
  grasp
      ->add_option("--out", arguments.out,
                   "folder for the runs' files, grasps.csv and climbs.csv, and both as .json")
      ->required()
      ->check(check_path);
  grasp->add_option("--side", arguments.side, "hand that grasps (default: the scene's)")
      ->type_name(kSides)
      ->check(check_side);
  add_overrides(*grasp, arguments.overrides);
  grasp->add_option("--friction", arguments.friction, "of every surface, in place of the scenes'")
      ->check(check_friction);
  grasp->add_flag("--friction-search", arguments.friction_search,
                  "also find the smallest friction that still holds (seven more runs a scene)");
  grasp->add_flag(
      "--margin", arguments.margin,
      "run each grasp again with 5 % more and less friction and mass: marginal where that turns it");
  grasp->add_flag("--pictures", arguments.pictures, "a picture at every phase");
  CLI::Option* agree =
      grasp
          ->add_option(
              "--agree", arguments.agree,
              "random grasps around the one scene, run on ODE and on the articulated engine: in how many "
              "they say the same")
          ->check(CLI::Range(1, 100000));
  grasp->add_option("--seed", arguments.seed, "of the random grasps (default: 1)")->needs(agree);
  grasp->add_flag("--quarter-steps", arguments.quarter_steps, "each engine also at a quarter of the step")
      ->needs(agree);
}

void add_accuracy(CLI::App& app, AccuracyArguments& arguments) {
  CLI::App* accuracy = app.add_subcommand(
      "accuracy",
      "What accuracy costs: errors and prices of methods and steps, as table, CSV, JSON and plots");
  accuracy->footer(
      "Example: handsim accuracy config/accuracy_slider_crank.yaml --out out/accuracy --target 1e-3");
  accuracy->add_option("study", arguments.study, "study file")->required();
  accuracy->add_option("--out", arguments.out, "folder for the study's files")->required()->check(check_path);
  accuracy
      ->add_option("--target", arguments.target,
                   "name the cheapest method and step that reaches this error; exit 1 where none does")
      ->check(check_target);
  CLI::Option* peers = accuracy->add_option(
      "--peers", arguments.peers, "folder of other engines' programs (default: where the build puts them)");
  accuracy->add_option("--costs", arguments.costs,
                       "table of costs, for engine auto, whose part on this kind of scene is replaced");
  accuracy->add_flag("--no-peers", arguments.no_peers, "leave the rows of other engines out")
      ->excludes(peers);
}

void add_stability(CLI::App& app, StabilityArguments& arguments) {
  CLI::App* stability = app.add_subcommand(
      "stability",
      "Hard cases: every engine, method and step against an oracle, as table, CSV, JSON, plots and pictures");
  stability->footer("Example: handsim stability config/stability.yaml --out out/stability --quick");
  stability->add_option("study", arguments.study, "study file")->required();
  stability->add_option("--out", arguments.out, "folder for the study's files")
      ->required()
      ->check(check_path);
  stability->add_option("--case", arguments.cases, "run this case alone; may be repeated")
      ->allow_extra_args(false);
  stability->add_flag("--quick", arguments.quick, "shorter runs of most cases, at most a minute in all");
  stability->add_flag("--no-pictures", arguments.no_pictures, "draw no scenes");
}

void add_contacts(CLI::App& app, std::filesystem::path& out) {
  CLI::App* contacts = app.add_subcommand("contacts", "What a step costs by method and number of contacts");
  contacts->footer("Example: handsim contacts --out out/contacts");
  contacts->add_option("--out", out, "folder for the study's files")->required()->check(check_path);
}

void add_effects(CLI::App& app, EffectsArguments& arguments) {
  CLI::App* effects = app.add_subcommand("effects",
                                         "What each effect of a scene costs and what it changes: table, CSV, "
                                         "JSON and a plot of the scene with each "
                                         "effect taken away in turn");
  effects->footer(
      "Example: handsim effects config/dropped_hand.yaml --out out/effects --set duration=\"1 s\"");
  effects->add_option("scene", arguments.scene, "scene file")->required();
  effects->add_option("--out", arguments.out, "folder for the study's files")->required()->check(check_path);
  add_overrides(*effects, arguments.overrides);
  effects->add_option_function<std::string>(
      "--repeats",
      [&arguments](const std::string& text) {
        const auto value = parse_number(text);
        if (!value || *value < 1 || *value > 1000 || *value != std::floor(*value))
          throw CLI::ValidationError("--repeats",
                                     got_need(text, "a whole number of timed rounds, 1 to 1000"));
        arguments.repeats = static_cast<int>(*value);
      },
      "timed rounds of which the median counts (default 7)");
  effects->add_flag("--json", arguments.json, "print effects.json in place of the table");
}

void add_export(CLI::App& app, ExportArguments& arguments) {
  CLI::App* command =
      app.add_subcommand("export", "A scene's model as a file for other engines: MJCF or URDF");
  command->footer("Example: handsim export config/two_hands.yaml --format mjcf --out two_hands.xml");
  command->add_option("scene", arguments.scene, "scene file")->required();
  command
      ->add_option("--format", arguments.format,
                   "mjcf (MuJoCo) or urdf (ROS); default: by the file's ending, else mjcf")
      ->type_name("mjcf|urdf")
      ->check(check_format);
  command->add_option("--out", arguments.out, "file to write: .xml for mjcf, .urdf for urdf")
      ->required()
      ->check(check_path);
  add_overrides(*command, arguments.overrides);
}

void add_completion(CLI::App& app, std::string& shell) {
  CLI::App* command =
      app.add_subcommand("completion", "Print a completion script for a shell, or the man page");
  command->footer("Example: handsim completion bash > ~/.local/share/bash-completion/completions/handsim");
  command->add_option("shell", shell, "bash, zsh, fish, or man for the man page")
      ->required()
      ->type_name(kShells)
      ->check(check_shell);
}

/// Reads the words and calls their command.
int parse_and_call(int argc, const char* const* argv) {
  CLI::App app("handsim: biomechanical hands of a given person, simulated with the Open Dynamics Engine");
  app.set_version_flag("--version",
                       fmt::format("handsim {}, commit {}\n{}\n{}", kVersion, kCommit, kCompiler, kOde));
  app.require_subcommand(1);
  app.footer(
      "handsim COMMAND --help says more. Exit status: 0 done, all criteria held; 1 a criterion failed, the "
      "simulation diverged, or output was lost; 2 bad input.");
  HandArguments hand;
  std::vector<std::filesystem::path> files;
  RunArguments run;
  RenderArguments render;
  AccuracyArguments accuracy;
  GraspArguments grasp;
  EffectsArguments effects;
  std::filesystem::path contacts;
  add_hand(app, hand);
  bool engines = false;
  add_check(app, files, engines);
  add_run(app, run);
  add_render(app, render);
  add_accuracy(app, accuracy);
  add_grasp(app, grasp);
  add_effects(app, effects);
  ExportArguments exported;
  add_export(app, exported);
  add_contacts(app, contacts);
  StabilityArguments stability;
  add_stability(app, stability);
  std::string shell;
  add_completion(app, shell);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11's own codes are many; usage problems are exit status 2 here.
    if (error.get_exit_code() != 0) {
      if (app.get_subcommands().empty()) throw command_error(app, argc, argv);
      if (const std::optional<Error> unknown = option_error(*app.get_subcommands().front())) throw *unknown;
    }
    std::ostringstream help, problem;
    const int status = app.exit(error, help, problem) == 0 ? 0 : kBadInput;
    print_text(help.str());
    tell_text(problem.str());
    return status;
  }
  if (app.got_subcommand("hand")) return hand_command(hand);
  if (app.got_subcommand("check")) return check_command(files, engines);
  if (app.got_subcommand("run")) return run_scene_command(run);
  if (app.got_subcommand("grasp")) return grasp_command(grasp);
  if (app.got_subcommand("accuracy")) return accuracy_command(accuracy);
  if (app.got_subcommand("export")) return export_command(exported);
  if (app.got_subcommand("contacts")) return contacts_command(contacts);
  if (app.got_subcommand("stability")) return stability_command(stability);
  if (app.got_subcommand("completion")) {
    print_text(shell == "man" ? man_page(app, kVersion) : completion_script(app, shell));
    return 0;
  }
  if (app.got_subcommand("effects")) return effects_command(effects);
  return render_command(render);
}

}  // namespace

int run_command_line(int argc, const char* const* argv) {
  return guarded([&] { return parse_and_call(argc, argv); });
}

}  // namespace handsim::app
