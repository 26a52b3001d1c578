// The command for recorded motion: tracking.
#include <algorithm>
#include <array>
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

void add_motion_commands(CommandLine& line) { add_track(line); }

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
  finish_output(status);
  const std::string scene = (arguments.out / "scene.yaml").string(),
                    out = (arguments.out / "activations").string();
  run_other_command(7, std::array<const char*, 7>{"handsim", "inverse", scene.c_str(), "--muscles", "--apart",
                                                  "--out", out.c_str()}
                           .data());
}

}  // namespace handsim::app
