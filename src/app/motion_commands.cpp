// Commands for recorded motion: inverse dynamics, tracking.
#include <memory>

#include "handsim/app/command_line.h"
#include "handsim/app/motion_command.h"

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
  inverse.add_option("--names", arguments->names, "file of the names that the motion's columns have");
  inverse.add_flag("--clamp", arguments->clamp, "move angles beyond a stop to it, and count them");
  add_parsed(inverse, "--cutoff", arguments->cutoff, parse_cutoff, "a frequency such as \"6 Hz\", or none",
             "of the low-pass filter on the motion's angles (default 6 Hz), or none");
  inverse.add_option("--loads", arguments->loads,
                     "forces from outside: a table of loads, or the contacts.csv of a run");
  inverse.add_flag("--no-check", arguments->no_check, "do not simulate with the torques");
  CLI::Option* muscles = inverse.add_flag(
      "--muscles", arguments->muscles,
      "activations of the muscles by static optimisation, and the torques that they leave undone (reserves)");
  inverse
      .add_option("--co-contraction", arguments->co_contraction,
                  "least activation of every muscle (default 0)")
      ->check(CLI::Range(0.0, 0.9))
      ->needs(muscles);
  add_overrides(inverse, arguments->overrides);
  inverse.add_flag("--json", arguments->json, "print summary.json in place of the table");
}

void add_track(CommandLine& line) {
  const auto arguments = std::make_shared<TrackArguments>();
  CLI::App& track = line.add(
      "track",
      "Inverse kinematics: joint angles and wrist poses of recorded hands, from 21 keypoints, markers or the "
      "sensors of a glove, and the measured hand of the person",
      "handsim track keypoints.csv --out out/tracked", track_command, arguments);
  track.add_option("recording", arguments->recording, "recording: .csv, .json or .trc")->required();
  add_out(track, arguments->out, "folder for angles, wrists, residuals, person.yaml and scene.yaml");
  track.add_option("--person", arguments->person,
                   "person file: stature, mass and sex beside the measured hand (default: the median man)");
  add_input(track, "--model", arguments->model, "hand model file (default: the anatomical hand)",
            "handmodels");
  track.add_option("--markers", arguments->markers,
                   "marker set file, for markers and sensors (default: 21 keypoints)");
  track.add_flag("--keep-person", arguments->keep_person, "do not fit hand length, breadth and bones");
  track.add_flag("--activations", arguments->activations,
                 "then inverse --muscles of the tracked motion, into the folder activations");
  track.add_flag("--no-smoothing", arguments->no_smoothing, "every frame for itself");
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

}  // namespace

void add_motion_commands(CommandLine& line) {
  add_inverse(line);
  add_track(line);
}

}  // namespace handsim::app
