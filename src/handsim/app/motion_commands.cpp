// Commands for recorded motion: inverse dynamics, tracking.
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/app/motion_command.h"
#include "handsim/app/progress.h"
#include "handsim/core/data_folder.h"
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

void add_track(CommandLine& line) {
  const auto arguments = std::make_shared<TrackArguments>();
  CLI::App& track = line.add(
      "track",
      "Inverse kinematics: joint angles and wrist poses of recorded hands, from 21 keypoints, markers or the "
      "sensors of a glove, and the measured hand of the person",
      "handsim track keypoints.csv --out out/tracked", track_command, arguments);
  track.add_option("recording", arguments->recording, "recording: .csv, .json, .trc or .c3d")->required();
  add_out(track, arguments->out, "folder for angles, wrists, residuals, person.yaml and scene.yaml");
  add_input(track, "--person", arguments->person_file,
            "person file: stature, mass and sex beside the measured hand (default: the median man)",
            "config/persons");
  add_input(track, "--model", arguments->hand_file, "hand model file (default: the anatomical hand)",
            "handmodels");
  CLI::Option* markers = track.add_option("--markers", arguments->marker_file,
                                          "marker set file, for markers and sensors (default: 21 keypoints)");
  add_input(track, "--points", arguments->points_file, "convention of the tracker: where its points lie",
            "handmodels/points")
      ->excludes(markers);
  track
      .add_option("--up", arguments->up,
                  "axis of the recording that points up (default: the convention's, or z)")
      ->transform(CLI::IsMember({"y", "z"}));
  track
      .add_option_function<std::string>(
          "--handedness", [arguments](const std::string& side) { arguments->left_handed = side == "left"; },
          "of the recording's axes (default: the convention's, or right)")
      ->check(CLI::IsMember({"left", "right"}));
  track.add_flag_callback(
      "--keep-person", [arguments] { arguments->fit_bones = false; },
      "do not fit hand length, breadth and bones");
  track.add_flag("--activations", arguments->activations,
                 "then inverse --muscles of the tracked motion, into the folder activations");
  track.add_flag_callback(
      "--no-smoothing", [arguments] { arguments->smooth = false; }, "every frame for itself");
  const auto parse_length = [](const std::string& text) {
    const auto value = parse_quantity(text, Dimension::length);
    return value && *value >= 0 && *value < 1 ? value : std::nullopt;
  };
  add_parsed(track, "--noise", arguments->noise, parse_length, "a length such as \"2 mm\"",
             "for trials: normal noise of this standard deviation is added to every coordinate");
  track.add_option("--seed", arguments->seed, "of the noise (default 1)");
  track.add_option("--truth", arguments->truth, "known joint angles (.mot, .csv), to compare with");
  track.add_flag("--json", arguments->json, "print summary.json in place of the table");
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

void print_track(const study::TrackInput& input, const study::TrackResult& result) {
  print_warnings(result.warnings);
  for (const study::TrackedHand& hand : result.hands) {
    using Status = study::FrameStatus;
    print(
        "{:<6} {} frames: {} tracked, {} without a hand, {} swapped, {} poor; noise {:.3g} mm a coordinate\n",
        hand.name, hand.frames.size(), hand.count(Status::tracked), hand.count(Status::missing),
        hand.count(Status::swapped), hand.count(Status::poor), 1e3 * hand.noise);
    if (const auto open = std::ranges::count(hand.determined, false);
        open > 0 && hand.count(Status::tracked) > 0)
      print("       {} axes that no point or sensor determines: left out\n", open);
    if (hand.overlaps.frames > 0)
      print(
          "       parts inside each other in {} of {} frames tested, up to {:.2g} mm ({} at {:.2f} s): "
          "handsim "
          "run of scene.yaml resolves them by contact\n",
          hand.overlaps.frames, hand.overlaps.tested, 1e3 * hand.overlaps.deepest()->second.depth,
          hand.overlaps.deepest()->first, hand.overlaps.deepest()->second.time);
    double squares = 0, count = 0;
    for (const study::TruthFigures& axis : hand.truth)
      if (axis.axis.ends_with(".flexion") && !axis.axis.starts_with("thumb"))
        squares += axis.rms * axis.rms, count += 1;
    if (count > 0)
      print("       difference from the known angles at the flexion axes of the fingers: {:.3g} deg RMS\n",
            kDegreesPerRadian * std::sqrt(squares / count));
  }
  if (result.person.hand_length && result.person.hand_breadth)
    print("hand length {:.1f} mm, breadth {:.1f} mm; ", 1e3 * *result.person.hand_length,
          1e3 * *result.person.hand_breadth);
  print("{:.3g} s of CPU time\n", result.cpu);
  if (!input.person_named)
    print("stature, mass and sex are those of the {}: --person states others\n", input.person.title);
}

}  // namespace

void add_motion_commands(CommandLine& line) {
  add_inverse(line);
  add_track(line);
}

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

study::TrackInput track_input(const TrackArguments& arguments) {
  study::TrackInput out = arguments;
  out.model_file = arguments.hand_file.value_or(data_folder() / "handmodels/anatomical.yaml");
  out.model = load_kind(out.model_file, scene::FileKind::hand_model, hand::read_hand_spec);
  out.person = load_kind(arguments.person_file.value_or(data_folder() / "config/persons/median_man.yaml"),
                         scene::FileKind::person, hand::read_person);
  if (const auto& file = arguments.marker_file ? arguments.marker_file : arguments.points_file)
    out.markers = load_kind(*file, scene::FileKind::marker_set, study::read_marker_set);
  out.person_named = arguments.person_file.has_value();
  return out;
}

int track_command(const TrackArguments& arguments) {
  const study::TrackInput input = track_input(arguments);
  const output::OutputFolder folder(arguments.out, study::track_files(), [&] {
    std::vector<std::filesystem::path> read = {input.recording, input.model_file};
    for (const auto& file :
         {arguments.person_file, arguments.marker_file, arguments.points_file, arguments.truth})
      if (file) read.push_back(*file);
    return read;
  });
  const auto result = with_progress([&](const auto& show) { return study::run_track(input, show); });
  folder.clear();
  study::StudyEnd end;
  end.plotted = study::write_track(input, result, arguments.out);
  const bool tracked = std::ranges::any_of(
      result.hands, [](const auto& hand) { return hand.count(study::FrameStatus::tracked) > 0; });
  if (!tracked) print_error("no frame of any hand is tracked: frames.csv says why of each\n");
  if (arguments.json)
    end.json = study::track_json(input, result);
  else
    print_track(input, result);
  const int status = print_study(end, arguments.out, arguments.json);
  if (!tracked || !arguments.activations) return tracked ? status : 1;
  InverseArguments inverse;
  inverse.scene = arguments.out / "scene.yaml";
  inverse.out = arguments.out / "activations";
  inverse.muscles = inverse.apart = true;
  return std::max(status, inverse_command(inverse));
}

}  // namespace handsim::app
