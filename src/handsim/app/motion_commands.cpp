// The command of inverse dynamics.
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/app/motion_command.h"
#include "handsim/app/progress.h"
#include "handsim/output/output_folder.h"

namespace handsim::app {

namespace {

/// A cut-off, or `none`.
std::optional<std::optional<double>> parse_cutoff(const std::string& text) {
  if (text == "none") return std::optional<double>();
  const auto value = parse_quantity(text, Dimension::frequency);
  if (!value || !(*value > 0 && *value <= 1e4)) return std::nullopt;
  return std::optional<double>(*value);
}

void add_inverse(CommandLine& line) {
  const auto arguments = std::make_shared<InverseArguments>();
  CLI::App& inverse =
      line.add("inverse",
               "Inverse dynamics: the torques about every axis that make a motion, and a simulation with "
               "them as a check",
               "handsim inverse config/every_pose.yaml --motion out/every/trajectory.mot --out out/inverse",
               inverse_command, arguments);
  add_input(inverse, "scene", arguments->scene, "scene file")->required();
  inverse.add_option("--motion", arguments->motion,
                     "joint angles: .csv, .mot or .sto (default: the programs of the scene)");
  add_out(inverse, arguments->out, "folder for torques.sto, summary.json and plots");
  add_input(inverse, "--names", arguments->names, "file of the names that the motion's columns have",
            "controllers");
  inverse.add_flag("--clamp", arguments->options.clamp, "move angles beyond a stop to it, and count them");
  add_parsed(inverse, "--cutoff", arguments->options.filter, parse_cutoff,
             "a frequency such as \"6 Hz\", or none",
             "of the low-pass filter on the motion's angles (default 6 Hz), or none");
  inverse.add_option("--loads", arguments->loads,
                     "forces from outside: a table of loads, or the contacts.csv of a run");
  inverse.add_flag_callback(
      "--no-check", [arguments] { arguments->forward = false; }, "do not simulate with the torques");
  CLI::Option* muscles = inverse.add_flag(
      "--muscles", arguments->muscles,
      "activations of the muscles by static optimisation, and the torques that they leave undone (reserves)");
  inverse
      .add_option("--co-contraction", arguments->co_contraction,
                  "least activation of every muscle (default 0)")
      ->check(CLI::Range(0.0, 0.9))
      ->needs(muscles);
  add_overrides(inverse, arguments->overrides);
  CLI::Option* json = inverse.add_flag("--json", arguments->json, "print summary.json in place of the table");
  CLI::Option* uncertain = add_uncertain_runs(inverse, *arguments)->excludes(json);
  add_report_flag(inverse, *arguments)->needs(uncertain);
}

/// The scene's overrides; --muscles adds one that puts the muscles in effect.
std::vector<std::string> with_muscles(const InverseArguments& arguments) {
  const scene::Scene scene = scene::load_scene(arguments.scene, arguments.overrides);
  using model::Effect;
  const auto touches = [&](Effect effect) {
    return effect == Effect::self_contact || effect == Effect::object_contact || effect == Effect::friction;
  };
  if (!arguments.muscles || (!scene.model.muscles.empty() && !arguments.apart)) return arguments.overrides;
  std::string effects = "muscles, tendon_coupling";
  for (int i = 0; i < model::kEffectCount; ++i)
    if (const auto effect = static_cast<Effect>(i);
        scene.spec.solver.effects.has(effect) && !(arguments.apart && touches(effect)))
      effects += fmt::format(", {}", model::name(effect));
  std::vector<std::string> overrides = arguments.overrides;
  overrides.push_back("effects=[" + effects + "]");
  return overrides;
}

/// Hands that are drawn: becomes the command that draws them.
[[noreturn]] void uncertain_inverse(const InverseArguments& arguments) {
  std::vector<std::string> words = {"inverse", arguments.scene.string()};
  study::Json files;
  for (const auto& [name, file] :
       {std::pair("motion", arguments.motion), {"names", arguments.names}, {"loads", arguments.loads}}) {
    files.push_back(file ? study::Json(file->string()) : study::Json());
    if (file) words.insert(words.end(), {std::string("--") + name, file->string()});
  }
  words.insert(
      words.end(),
      {"--cutoff", arguments.options.filter ? fmt::format("{}", *arguments.options.filter) : "none"});
  if (arguments.options.clamp) words.emplace_back("--clamp");
  if (arguments.muscles)
    words.insert(words.end(), {"--muscles", "--co-contraction", fmt::format("{}", arguments.co_contraction)});
  words.insert(words.end(), {"--uncertain", fmt::format("{}", *arguments.uncertain)});
  study::Json cutoff, least;
  if (arguments.options.filter) cutoff = *arguments.options.filter;
  if (arguments.muscles) least = arguments.co_contraction;
  run_drawn({{"file", arguments.scene.string()},
             {"overrides", with_muscles(arguments)},
             {"count", *arguments.uncertain},
             {"out", arguments.out.string()},
             {"report", arguments.report},
             {"on", arguments.on},
             {"command", study::command_text(words, arguments.overrides)},
             {"inverse", {files[0], files[1], files[2], cutoff, arguments.options.clamp, least}}});
}

}  // namespace

void add_motion_commands(CommandLine& line) { add_inverse(line); }

study::InverseInput inverse_input(const InverseArguments& arguments) {
  study::InverseInput input = arguments;
  if (arguments.names)
    input.options.names =
        load_kind(*arguments.names, scene::FileKind::motion_names, control::read_motion_names);
  if (arguments.muscles) input.least_activation = arguments.co_contraction;
  return input;
}

int inverse_command(const InverseArguments& arguments) {
  if (arguments.uncertain) uncertain_inverse(arguments);
  const scene::Scene scene = scene::load_scene(arguments.scene, with_muscles(arguments));
  print_warnings(scene.warnings);
  const study::InverseInput input = inverse_input(arguments);
  const output::OutputFolder folder(arguments.out, study::inverse_files(), [&] {
    std::vector<std::filesystem::path> read = scene::files_read(scene);
    for (const auto& file : {arguments.motion, arguments.names, arguments.loads})
      if (file) read.push_back(*file);
    return read;
  });
  const auto result = with_progress([&](const auto& show) { return study::run_inverse(scene, input, show); });
  print_warnings(result.warnings);
  folder.clear();
  study::StudyEnd end{scene.spec.title + "\n" + study::inverse_table(result)};
  end.plotted = study::write_inverse(scene, input, result, arguments.out);
  if (result.fault) print_error("the check ended early: {}\n", *result.fault);
  if (result.rms_error && !result.agrees() && !result.fault)
    print_error(
        "the check misses the motion: RMS error {:.3g} deg, limit {:g} deg: contacts between bodies are "
        "no part of the torques, and without feedback differences grow\n",
        kDegreesPerRadian * *result.rms_error, kDegreesPerRadian * study::kLargestCheckError);
  if (result.cutoff)
    end.text += fmt::format("filter: Butterworth, second order, forwards and backwards, cut-off {:g} Hz\n",
                            *result.cutoff);
  if (result.reserve_share)
    end.text +=
        fmt::format("muscles leave {:.2g} % of the torques undone (RMS over all axes): reserves.sto\n",
                    100 * *result.reserve_share) +
        (result.undone ? study::undone_text(*result.undone) : "");
  if (result.rms_error)
    end.text += fmt::format(
        "a simulation with these {}: RMS error {:.3g} deg over all axes\n",
        arguments.muscles
            ? fmt::format("excitations and reserves, from the motion anew each {:g} s", study::kCheckWindow)
            : "torques alone",
        kDegreesPerRadian * *result.rms_error);
  end.json = study::inverse_json(scene, input, result);
  const int status = print_study(end, arguments.out, arguments.json);
  return result.agrees() ? status : 1;
}

}  // namespace handsim::app
