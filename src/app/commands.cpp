#include "handsim/app/commands.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <sstream>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "handsim/app/completion.h"
#include "handsim/app/console.h"
#include "handsim/app/file_readers.h"
#include "handsim/core/version.h"
#include "handsim/core/yaml_reader.h"
#include "handsim/simulation/watch/state_hash.h"

namespace handsim::app {

namespace {

constexpr int kBadInput = 2;
constexpr int kFailed = 1;

/// Calls a command. Prints an exception, without allocating memory, and returns its exit status.
template <class Command>
int guarded(Command command) {
  const auto failed = [](std::string_view head, const char* what, int status) {
    print_error_text(head);
    print_error_text(what);
    print_error_text("\n");
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

/// A problem of usage in the form of all others.
std::string got_need(const std::string& got, const std::string& need) {
  return fmt::format("got {}, need {}", got, need);
}

/// Restricts an option to words. @param bars the words with | between them, also for help and completion.
void add_words(CLI::Option* option, const std::string& bars) {
  option->type_name(bars)->check([bars](const std::string& text) {
    const std::vector<std::string> words = CLI::detail::split(bars, '|');
    const bool known = std::find(words.begin(), words.end(), text) != words.end();
    return known ? "" : got_need(text, need_word(text, words));
  });
}

constexpr const char* kSides = "right|left|both";

using Check = std::function<std::string(const std::string&)>;

Check number_from(double least, double most, bool whole, const std::string& need) {
  return [=](const std::string& text) {
    const auto value = parse_number(text);
    const bool good = value && *value >= least && *value <= most && (!whole || *value == std::floor(*value));
    return good ? "" : got_need(text, need);
  };
}

std::string check_path(const std::string& text) { return text.empty() ? got_need("\"\"", "a path") : ""; }

/// Adds an option whose text `parse` reads; it returns nothing for an invalid text.
template <class Target, class Parse>
void add_parsed(CLI::App& command, const std::string& name, Target& target, Parse parse,
                const std::string& need, const std::string& help) {
  command.add_option_function<std::string>(
      name,
      [name, &target, parse, need](const std::string& text) {
        const auto value = parse(text);
        if (!value) throw CLI::ValidationError(name, got_need(text, need));
        target = *value;
      },
      help);
}

template <class Target>
void add_time(CLI::App& command, const std::string& name, Target& target, const std::string& help) {
  const auto parse = [](const std::string& text) {
    const auto value = parse_quantity(text, Dimension::time);
    return value && *value >= 0 ? value : std::nullopt;
  };
  add_parsed(command, name, target, parse, "a time from 0, such as 0.2 or \"200 ms\"", help);
}

void add_out(CLI::App& command, std::filesystem::path& out, const std::string& help) {
  command.add_option("--out", out, help)->required()->check(check_path);
}

/// Adds `--video` with its `--fps` and `--speed`, and `--gl`.
void add_drawing(CLI::App& command, DrawArguments& drawing, const std::string& where) {
  CLI::Option* video =
      command.add_option("--video", drawing.video, "video in real time, .mp4 or .gif (needs ffmpeg): " + where)
          ->check(check_path);
  command.add_option("--fps", drawing.fps, "frames in a second of the video (default 30)")
      ->check(number_from(0.1, 240, false, "a number of frames, 0.1 to 240"))
      ->needs(video);
  command.add_option("--speed", drawing.speed, "simulated seconds in a second of the video (default 1)")
      ->check(number_from(1e-4, 1e4, false, "a factor, 0.0001 to 10000; below 1 it is slow motion"))
      ->needs(video);
  add_words(command.add_option("--gl", drawing.gl, "OpenGL without a display (default: osmesa, if built in)"),
            "osmesa|egl");
}

/// The command line and the functions of its commands.
struct CommandLine {
  CLI::App app{"handsim: biomechanical hands of a given person, simulated with the Open Dynamics Engine"};
  std::vector<std::pair<CLI::App*, std::function<int()>>> commands;

  /// @param arguments filled in when the command line is parsed.
  template <class Arguments>
  CLI::App& add(const char* name, const char* help, const char* example, int (*call)(const Arguments&),
                const std::shared_ptr<Arguments>& arguments) {
    CLI::App* command = app.add_subcommand(name, help);
    command->footer(std::string("Example: ") + example);
    commands.emplace_back(command, [call, arguments] { return call(*arguments); });
    return *command;
  }
};

/// Adds `--set`, and `--engine` for `--set solver.engine=...`. By default CLI11 gives a repeatable option all
/// words after it; these take one.
void add_overrides(CLI::App& app, std::vector<std::string>& overrides) {
  const auto engine = std::make_shared<std::string>();
  add_words(
      app.add_option("--engine", *engine,
                     "replaces the scene's engine, with its default method; settings that it does not have "
                     "are left out"),
      "ode|dae|articulated|auto");
  // Before the others, which may then set keys of that engine.
  app.callback([engine, &overrides] {
    if (!engine->empty()) overrides.insert(overrides.begin(), "solver.engine=" + *engine);
  });
  app.add_option("--set", overrides, "override a key of the scene: solver.step=\"5 ms\"; may be repeated")
      ->allow_extra_args(false);
}

void add_hand(CommandLine& line) {
  const auto arguments = std::make_shared<HandArguments>();
  CLI::App& hand = line.add(
      "hand", "Hands of a person: dimensions, masses, joints; with --out also YAML and a picture",
      "handsim hand --stature 1.75 --mass 72 --sex male --side both --out out/hand", hand_command, arguments);
  hand.add_option("--person", arguments->person, "person file (in place of --stature, --mass, --sex)");
  const auto measure = [&](const char* name, const char* key, const char* help) {
    return hand.add_option_function<std::string>(
        name, [arguments, key](const std::string& value) { arguments->measures[key] = value; }, help);
  };
  measure("--stature", "stature", "m, or with a unit: 1.75, \"175 cm\"");
  measure("--mass", "mass", "kg");
  measure("--sex", "sex", "of the person")->type_name("male|female|unknown");
  measure("--hand-length", "hand_length", "measured: wrist crease to middle fingertip [m]");
  measure("--hand-breadth", "hand_breadth", "measured: across the knuckles [m]");
  measure("--hand-circumference", "hand_circumference", "measured: around the knuckles [m]");
  measure("--hand-mass", "hand_mass", "measured [kg]");
  measure("--hand-length-percentile", "hand_length_percentile",
          "among people of this stature, mass and sex, 0.01 to 99.99");
  hand.add_option("--model", arguments->model, "hand model file (default: the anatomical hand)");
  add_words(hand.add_option("--side", arguments->side, "which hands (default both)"), kSides);
  hand.add_option("--out", arguments->out, "folder for hand.yaml and hand.png")->check(check_path);
}

void add_check(CommandLine& line) {
  const auto arguments = std::make_shared<CheckArguments>();
  CLI::App& check =
      line.add("check",
               "Validate scenes, persons, hand models, controllers, poses and motions: report every "
               "problem, run nothing",
               "handsim check config/two_hands.yaml config/persons/child.yaml", check_command, arguments);
  check.add_option("files", arguments->files, "YAML files")->required();
  check.add_flag("--engines", arguments->engines,
                 "print which engines can run each scene, and why others cannot");
}

void add_schema(CommandLine& line) {
  const auto arguments = std::make_shared<SchemaArguments>();
  CLI::App& schema =
      line.add("schema", "Print the JSON Schema of a kind of file, for completion and checks in editors",
               "handsim schema scene > scene.schema.json", schema_command, arguments);
  std::string words;
  for (const FileReader& reader : file_readers())
    words += (words.empty() ? "" : "|") + std::string(reader.word);
  add_words(schema.add_option("kind", arguments->kind, "kind of file")->required(), words);
}

void add_run(CommandLine& line) {
  const auto arguments = std::make_shared<RunArguments>();
  CLI::App& run =
      line.add("run", "Simulate a scene: trajectory.csv, summary.json, resolved.yaml, pictures",
               "handsim run config/two_hands.yaml --out out/two_hands --frames 8 --set solver.step=\"2 ms\"",
               run_scene_command, arguments);
  run.add_option("scene", arguments->scene, "scene file")->required();
  add_out(run, arguments->out, "folder for the run's files");
  add_overrides(run, arguments->overrides);
  const auto from_0 = number_from(0, std::numeric_limits<int>::max(), true, "a whole number, from 0");
  CLI::Option* rollout =
      run.add_option("--rollout", arguments->rollout,
                     "of a rollout study in the scene's place: this one, with its files and pictures")
          ->check(from_0);
  run.add_option("--seed", arguments->seed, "of the study, where it was run with --seed")
      ->check(from_0)
      ->needs(rollout);
  CLI::Option* frames =
      run.add_option("--frames", arguments->frames, "pictures over the run, and a contact sheet of them")
          ->check(number_from(0, 10000, true, "a whole number of pictures, 0 to 10000"));
  run.add_flag("--poses", arguments->poses,
               "a picture at the end of every hold of a controlled scene, in place of --frames")
      ->excludes(frames);
  add_drawing(run, arguments->drawing, "of the run");
  run.add_flag("--plots", arguments->plots,
               "plots of a controlled scene: angles, errors, torques (needs gnuplot)");
  add_time(run, "--snapshot-at", arguments->snapshot_at,
           "write the state of the run at this time to snapshot.bin");
  run.add_option("--from-snapshot", arguments->from_snapshot,
                 "continue from a snapshot.bin of this scene: tables and pictures of the rest, summary of "
                 "the whole run")
      ->check(check_path);
  add_parsed(run, "--expect-hash", arguments->expected_hash, simulation::parse_hash,
             "the 16 hexadecimal digits of state_hash in summary.json",
             "exit 1 if the hash of all states (state_hash in summary.json) differs");
  run.add_flag("--quiet", arguments->quiet, "print only problems");
  run.add_flag("--json", arguments->json, "print summary.json in place of the table");
}

void add_render(CommandLine& line) {
  const auto arguments = std::make_shared<RenderArguments>();
  CLI::App& render =
      line.add("render", "One picture of a scene at a time of its motion, or a video of it",
               "handsim render config/two_hands.yaml --out hands.png --time 0.2", render_command, arguments);
  render.add_option("scene", arguments->scene, "scene file")->required();
  CLI::Option* out = render.add_option("--out", arguments->out, "PNG file: .png")->check(check_path);
  add_overrides(render, arguments->overrides);
  add_time(render, "--time", arguments->time,
           "simulated time of the picture (default 0), end of the video (default: the scene's)");
  add_drawing(render, arguments->drawing, "in place of --out or beside it");
  render.parse_complete_callback([out, &render] {
    if (out->empty() && render.get_option("--video")->empty()) throw CLI::RequiredError("--out or --video");
  });
}

void add_grasp(CommandLine& line) {
  const auto arguments = std::make_shared<GraspArguments>();
  CLI::App& grasp = line.add("grasp",
                             "Run grasp and climb scenes: table of what was held, how firmly, the least "
                             "friction that holds, and the load that a hand carried on a hold",
                             "handsim grasp config --out out/grasps --side both", grasp_command, arguments);
  grasp.add_option("scenes", arguments->scenes, "scene files, or folders of them")->required();
  add_out(grasp, arguments->out, "folder for the runs' files, grasps.csv and climbs.csv, and both as .json");
  add_words(grasp.add_option("--side", arguments->side, "hand that grasps (default: the scene's)"), kSides);
  add_overrides(grasp, arguments->overrides);
  grasp.add_option("--friction", arguments->friction, "of every surface, in place of the scenes'")
      ->check(number_from(0, 10, false, "a coefficient of friction, 0 to 10"));
  grasp.add_flag("--friction-search", arguments->friction_search,
                 "also find the smallest friction that still holds (seven more runs per scene)");
  grasp.add_flag(
      "--margin", arguments->margin,
      "run each grasp again with 5 % more and less friction and mass: marginal if that changes the verdict");
  grasp.add_flag("--pictures", arguments->pictures, "a picture at every phase");
  add_drawing(grasp, arguments->drawing, "a name without a folder, for each run's own");
  CLI::Option* agree = grasp.add_option(
      "--agree", arguments->agree,
      "random grasps around the one scene, on ODE and the articulated engine: how often they agree");
  agree->check(CLI::Range(1, 100000));
  grasp.add_option("--seed", arguments->seed, "of the random grasps (default: 1)")->needs(agree);
  grasp
      .add_option("--quarter-steps", arguments->quarter_steps,
                  "of so many also ODE at a quarter of the step (default: where the engines differ)")
      ->check(CLI::Range(1, 100000))
      ->needs(agree);
}

void add_accuracy(CommandLine& line) {
  const auto arguments = std::make_shared<AccuracyArguments>();
  CLI::App& accuracy =
      line.add("accuracy", "Errors and CPU times of methods and steps, as table, CSV, JSON and plots",
               "handsim accuracy config/accuracy_slider_crank.yaml --out out/accuracy --target 1e-3",
               accuracy_command, arguments);
  accuracy.add_option("study", arguments->study, "study file")->required();
  add_out(accuracy, arguments->out, "folder for the study's files");
  accuracy
      .add_option("--target", arguments->target,
                  "name the cheapest method and step that reaches this error; exit 1 if none does")
      ->check(number_from(std::numeric_limits<double>::min(), std::numeric_limits<double>::max(), false,
                          "an error above 0, such as 1e-3"));
  CLI::Option* peers = accuracy.add_option(
      "--peers", arguments->peers, "folder of other engines' programs (default: where the build puts them)");
  accuracy.add_option("--costs", arguments->costs,
                      "table of costs for engine auto: replaces its part on this kind of scene");
  accuracy.add_flag("--no-peers", arguments->no_peers, "omit the rows of other engines")->excludes(peers);
}

void add_stability(CommandLine& line) {
  const auto arguments = std::make_shared<StabilityArguments>();
  CLI::App& stability = line.add(
      "stability",
      "Hard cases: every engine, method and step against an oracle, as table, CSV, JSON, plots and pictures",
      "handsim stability config/stability.yaml --out out/stability --quick", stability_command, arguments);
  stability.add_option("study", arguments->study, "study file")->required();
  add_out(stability, arguments->out, "folder for the study's files");
  stability.add_option("--case", arguments->cases, "run this case alone; may be repeated")
      ->allow_extra_args(false);
  stability.add_flag("--quick", arguments->quick, "shorter runs of most cases, at most a minute in all");
  stability.add_flag("--no-pictures", arguments->no_pictures, "draw no scenes");
}

void add_contacts(CommandLine& line) {
  const auto arguments = std::make_shared<ContactsArguments>();
  add_out(line.add("contacts", "CPU time of a step by method and number of contacts",
                   "handsim contacts --out out/contacts", contacts_command, arguments),
          arguments->out, "folder for the study's files");
}

void add_effects(CommandLine& line) {
  const auto arguments = std::make_shared<EffectsArguments>();
  CLI::App& effects = line.add(
      "effects",
      "CPU time and influence of each effect of a scene: table, CSV, JSON and a plot of the scene without "
      "each effect in turn",
      "handsim effects config/dropped_hand.yaml --out out/effects --set duration=\"1 s\"", effects_command,
      arguments);
  effects.add_option("scene", arguments->scene, "scene file")->required();
  add_out(effects, arguments->out, "folder for the study's files");
  add_overrides(effects, arguments->overrides);
  effects.add_option("--repeats", arguments->repeats, "timed rounds, for the median (default 7)")
      ->check(number_from(1, 1000, true, "a whole number of timed rounds, 1 to 1000"));
  effects.add_flag("--json", arguments->json, "print effects.json in place of the table");
}

constexpr int kMostCount = 100'000'000;

void add_rollouts(CommandLine& line) {
  const auto arguments = std::make_shared<RolloutsArguments>();
  CLI::App& rollouts =
      line.add("rollouts",
               "Thousands of runs of a scene, each with its own person, mass, friction or pose, on all cores "
               "and under mpirun on many machines: one table, what makes them held, a plot",
               "handsim rollouts config/rollouts_power_can.yaml --out out/power_can --count 100",
               rollouts_command, arguments);
  CLI::Option* study = rollouts.add_option("study", arguments->study, "study file");
  CLI::Option* out =
      rollouts.add_option("--out", arguments->out, "folder for the study's files")->check(check_path);
  add_overrides(rollouts, arguments->overrides);
  const auto whole = [](int least, int most) {
    return number_from(least, most, true, fmt::format("a whole number, {} to {}", least, most));
  };
  rollouts.add_option("--count", arguments->count, "draws, in place of the study's")
      ->check(whole(1, kMostCount));
  rollouts.add_option("--seed", arguments->seed, "in place of the study's")
      ->check(whole(0, std::numeric_limits<int>::max()));
  rollouts.add_option("--jobs", arguments->jobs, "threads (default: as many as the machine has)")
      ->check(whole(1, 4096));
  rollouts.add_option("--chunk", arguments->chunk, "rollouts that are written down together (default 8)")
      ->check(whole(1, 100'000));
  rollouts.add_flag("--resume", arguments->resume, "go on with a study that was stopped");
  rollouts.add_option("--shard", arguments->shard,
                      "this share of the rollouts alone, such as 3/16, for merge");
  CLI::App* merge = rollouts.add_subcommand("merge", "Make the table of all shards");
  merge->footer("Example: handsim rollouts merge out/power_can");
  merge->add_option("folders", arguments->folders, "folders of --shard runs")->required();
  merge->add_option("--out", arguments->out, "folder for the table (default: the first of the folders)")
      ->check(check_path);
  rollouts.parse_complete_callback([merge, study, out] {
    if (merge->parsed()) return;
    for (const CLI::Option* option : {study, out})
      if (option->empty()) throw CLI::RequiredError(option->get_name());
  });
  line.commands.back().second = [merge, arguments] {
    return merge->parsed() ? merge_command(*arguments) : rollouts_command(*arguments);
  };
}

void add_export(CommandLine& line) {
  const auto arguments = std::make_shared<ExportArguments>();
  CLI::App& command = line.add("export", "A scene's model as a file for other engines: MJCF or URDF",
                               "handsim export config/two_hands.yaml --format mjcf --out two_hands.xml",
                               export_command, arguments);
  command.add_option("scene", arguments->scene, "scene file")->required();
  add_words(command.add_option("--format", arguments->format,
                               "mjcf (MuJoCo) or urdf (ROS); default: by the file's ending, else mjcf"),
            "mjcf|urdf");
  add_out(command, arguments->out, "file to write: .xml for mjcf, .urdf for urdf");
  add_overrides(command, arguments->overrides);
}

void add_completion(CommandLine& line) {
  const auto shell = std::make_shared<std::string>();
  CLI::App* command =
      line.app.add_subcommand("completion", "Print a completion script for a shell, or the man page");
  command->footer("Example: handsim completion bash > ~/.local/share/bash-completion/completions/handsim");
  add_words(command->add_option("shell", *shell, "bash, zsh, fish, or man for the man page")->required(),
            "bash|zsh|fish|man");
  line.commands.emplace_back(command, [&app = line.app, shell] {
    print_text(*shell == "man" ? man_page(app, kVersion) : completion_script(app, *shell));
    return 0;
  });
}

/// The error of a missing or unknown command; CLI11 reports both as missing.
Error command_error(const CLI::App& app, int argc, const char* const* argv) {
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    known.push_back(command->get_name());
  const std::string got = argc > 1 ? argv[1] : "nothing";
  return input_error("command", got, need_word(got, known));
}

/// The error of an unknown option or of an additional word; nothing for other problems.
std::optional<Error> option_error(const CLI::App& command) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (const std::string& word : command.remaining()) {
    if (!word.starts_with('-'))
      return input_error("arguments", "one too many, " + word,
                         "no more; put a value that contains a blank in quotes");
    const std::string option = word.substr(0, word.find('='));
    return input_error(option, "an unknown option", need_word(option, known));
  }
  return std::nullopt;
}

/// Reads the words and calls their command.
int parse_and_call(int argc, const char* const* argv) {
  CommandLine line;
  CLI::App& app = line.app;
  app.set_version_flag("--version",
                       fmt::format("handsim {}, commit {}\n{}\n{}", kVersion, kCommit, kCompiler, kOde));
  app.require_subcommand(1);
  app.footer(
      "Details: handsim COMMAND --help. Exit status: 0 done, all criteria held; 1 a criterion failed, the "
      "simulation diverged, or output was lost; 2 bad input.");
  for (const auto add : {add_hand, add_check, add_run, add_render, add_accuracy, add_grasp, add_effects,
                         add_export, add_contacts, add_stability, add_rollouts, add_schema, add_completion})
    add(line);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 has many codes; here usage problems have exit status 2.
    if (error.get_exit_code() != 0) {
      if (app.get_subcommands().empty()) throw command_error(app, argc, argv);
      if (const std::optional<Error> unknown = option_error(*app.get_subcommands().front())) throw *unknown;
    }
    std::ostringstream help, problem;
    const int status = app.exit(error, help, problem) == 0 ? 0 : kBadInput;
    print_text(help.str());
    print_error_text(problem.str());
    return status;
  }
  for (const auto& [command, call] : line.commands)
    if (command->parsed()) return call();
  return 0;
}

}  // namespace

int run_command_line(int argc, const char* const* argv) {
  return guarded([&] { return parse_and_call(argc, argv); });
}

}  // namespace handsim::app
