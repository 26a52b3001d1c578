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

/// Calls a command; an exception is printed, without taking memory, and becomes its exit status.
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

/// An option that takes one of some words. Its type, with bars, is for the help and for completion.
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

/// An option whose text is read by `parse`, which gives nothing for a bad one.
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

/// The command line and what its commands call.
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

/// `--set`, and `--engine` for `--set solver.engine=...`. CLI11 lets an option that may be repeated take
/// every word after it; these take one.
void add_overrides(CLI::App& app, std::vector<std::string>& overrides) {
  const auto engine = std::make_shared<std::string>();
  add_words(
      app.add_option("--engine", *engine,
                     "in place of the scene's, with that engine's default method; settings that it does "
                     "not have are left out"),
      "ode|dae|articulated|auto");
  // Before the others, which may then set what that engine has.
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
  measure("--hand-length-percentile", "hand_length_percentile", "among people of this body, 0.01 to 99.99");
  hand.add_option("--model", arguments->model, "hand model file (default: the anatomical hand)");
  add_words(hand.add_option("--side", arguments->side, "which hands (default both)"), kSides);
  hand.add_option("--out", arguments->out, "folder for hand.yaml and hand.png")->check(check_path);
}

void add_check(CommandLine& line) {
  const auto arguments = std::make_shared<CheckArguments>();
  CLI::App& check =
      line.add("check",
               "Validate scenes, persons, hand models, controllers, poses and motions: say every "
               "problem, run nothing",
               "handsim check config/two_hands.yaml config/persons/child.yaml", check_command, arguments);
  check.add_option("files", arguments->files, "YAML files")->required();
  check.add_flag("--engines", arguments->engines,
                 "print which engines run each scene as it stands, and why others do not");
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
  CLI::Option* frames =
      run.add_option("--frames", arguments->frames, "pictures over the run, and a contact sheet of them")
          ->check(number_from(0, 10000, true, "a whole number of pictures, 0 to 10000"));
  run.add_flag("--poses", arguments->poses,
               "a picture at the end of every hold of a controlled scene, in place of --frames")
      ->excludes(frames);
  run.add_flag("--plots", arguments->plots,
               "plots of a controlled scene: angles, errors, torques (needs gnuplot)");
  add_time(run, "--snapshot-at", arguments->snapshot_at,
           "write the run as it stands at this time as snapshot.bin");
  run.add_option("--from-snapshot", arguments->from_snapshot,
                 "go on from a snapshot.bin of this scene: tables and pictures of the rest, a summary of all")
      ->check(check_path);
  add_parsed(run, "--expect-hash", arguments->expected_hash, simulation::parse_hash,
             "the 16 hexadecimal digits of state_hash in summary.json",
             "exit 1 where the hash of all states (state_hash in summary.json) is another");
  run.add_flag("--quiet", arguments->quiet, "print nothing but problems");
  run.add_flag("--json", arguments->json, "print summary.json in place of the table");
}

void add_render(CommandLine& line) {
  const auto arguments = std::make_shared<RenderArguments>();
  CLI::App& render =
      line.add("render", "One picture of a scene at a time of its motion",
               "handsim render config/two_hands.yaml --out hands.png --time 0.2", render_command, arguments);
  render.add_option("scene", arguments->scene, "scene file")->required();
  add_out(render, arguments->out, "PNG file: .png");
  add_overrides(render, arguments->overrides);
  add_time(render, "--time", arguments->time, "simulated time (default 0)");
}

void add_grasp(CommandLine& line) {
  const auto arguments = std::make_shared<GraspArguments>();
  CLI::App& grasp = line.add("grasp",
                             "Run grasp and climb scenes and say in a table what was held, how firmly, with "
                             "what friction at least, and what load a hand carried on a hold",
                             "handsim grasp config --out out/grasps --side both", grasp_command, arguments);
  grasp.add_option("scenes", arguments->scenes, "scene files, or folders of them")->required();
  add_out(grasp, arguments->out, "folder for the runs' files, grasps.csv and climbs.csv, and both as .json");
  add_words(grasp.add_option("--side", arguments->side, "hand that grasps (default: the scene's)"), kSides);
  add_overrides(grasp, arguments->overrides);
  grasp.add_option("--friction", arguments->friction, "of every surface, in place of the scenes'")
      ->check(number_from(0, 10, false, "a coefficient of friction, 0 to 10"));
  grasp.add_flag("--friction-search", arguments->friction_search,
                 "also find the smallest friction that still holds (seven more runs a scene)");
  grasp.add_flag(
      "--margin", arguments->margin,
      "run each grasp again with 5 % more and less friction and mass: marginal where that turns it");
  grasp.add_flag("--pictures", arguments->pictures, "a picture at every phase");
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
      line.add("accuracy",
               "What accuracy costs: errors and prices of methods and steps, as table, CSV, JSON and plots",
               "handsim accuracy config/accuracy_slider_crank.yaml --out out/accuracy --target 1e-3",
               accuracy_command, arguments);
  accuracy.add_option("study", arguments->study, "study file")->required();
  add_out(accuracy, arguments->out, "folder for the study's files");
  accuracy
      .add_option("--target", arguments->target,
                  "name the cheapest method and step that reaches this error; exit 1 where none does")
      ->check(number_from(std::numeric_limits<double>::min(), std::numeric_limits<double>::max(), false,
                          "an error above 0, such as 1e-3"));
  CLI::Option* peers = accuracy.add_option(
      "--peers", arguments->peers, "folder of other engines' programs (default: where the build puts them)");
  accuracy.add_option("--costs", arguments->costs,
                      "table of costs, for engine auto, whose part on this kind of scene is replaced");
  accuracy.add_flag("--no-peers", arguments->no_peers, "leave the rows of other engines out")
      ->excludes(peers);
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
  add_out(line.add("contacts", "What a step costs by method and number of contacts",
                   "handsim contacts --out out/contacts", contacts_command, arguments),
          arguments->out, "folder for the study's files");
}

void add_effects(CommandLine& line) {
  const auto arguments = std::make_shared<EffectsArguments>();
  CLI::App& effects = line.add(
      "effects",
      "What each effect of a scene costs and what it changes: table, CSV, JSON and a plot of the scene "
      "with each effect taken away in turn",
      "handsim effects config/dropped_hand.yaml --out out/effects --set duration=\"1 s\"", effects_command,
      arguments);
  effects.add_option("scene", arguments->scene, "scene file")->required();
  add_out(effects, arguments->out, "folder for the study's files");
  add_overrides(effects, arguments->overrides);
  effects.add_option("--repeats", arguments->repeats, "timed rounds of which the median counts (default 7)")
      ->check(number_from(1, 1000, true, "a whole number of timed rounds, 1 to 1000"));
  effects.add_flag("--json", arguments->json, "print effects.json in place of the table");
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

/// Reads the words and calls their command.
int parse_and_call(int argc, const char* const* argv) {
  CommandLine line;
  CLI::App& app = line.app;
  app.set_version_flag("--version",
                       fmt::format("handsim {}, commit {}\n{}\n{}", kVersion, kCommit, kCompiler, kOde));
  app.require_subcommand(1);
  app.footer(
      "handsim COMMAND --help says more. Exit status: 0 done, all criteria held; 1 a criterion failed, the "
      "simulation diverged, or output was lost; 2 bad input.");
  for (const auto add : {add_hand, add_check, add_run, add_render, add_accuracy, add_grasp, add_effects,
                         add_export, add_contacts, add_stability, add_schema, add_completion})
    add(line);
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
  for (const auto& [command, call] : line.commands)
    if (command->parsed()) return call();
  return 0;
}

}  // namespace

int run_command_line(int argc, const char* const* argv) {
  return guarded([&] { return parse_and_call(argc, argv); });
}

}  // namespace handsim::app
