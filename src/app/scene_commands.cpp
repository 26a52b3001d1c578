// Commands for one hand, scene or file.
#include <limits>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/app/file_readers.h"
#include "handsim/simulation/watch/state_hash.h"

namespace handsim::app {

namespace {

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
      line.add("render", "One picture of a scene at a time of its motion",
               "handsim render config/two_hands.yaml --out hands.png --time 0.2", render_command, arguments);
  render.add_option("scene", arguments->scene, "scene file")->required();
  add_out(render, arguments->out, "PNG file: .png");
  add_overrides(render, arguments->overrides);
  add_time(render, "--time", arguments->time, "simulated time (default 0)");
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

}  // namespace

void add_scene_commands(CommandLine& line) {
  for (const auto add : {add_hand, add_check, add_run, add_render, add_export, add_schema}) add(line);
}

}  // namespace handsim::app
