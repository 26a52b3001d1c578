// Commands for one hand, scene or file.
#include <algorithm>
#include <limits>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/simulation/watch/state_hash.h"

namespace handsim::app {

namespace {

void add_check(CommandLine& line) {
  const auto arguments = std::make_shared<CheckArguments>();
  CLI::App& check =
      line.add("check",
               "Validate scenes, persons, hand models, controllers, poses and motions: report every "
               "problem, run nothing",
               "handsim check config/two_hands.yaml config/persons/child.yaml", check_command, arguments);
  add_input(check, "files", arguments->files, "YAML files", "")->required();
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
  arguments->page = line.page;
  add_input(run, "scene", arguments->scene, "scene file")->required();
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
  add_uncertain_runs(run, *arguments);
  CLI::Option* frames =
      run.add_option("--frames", arguments->frames, "pictures over the run, and a contact sheet of them")
          ->check(number_from(0, 10000, true, "a whole number of pictures, 0 to 10000"));
  run.add_flag("--poses", arguments->pose_pictures,
               "a picture at the end of every hold of a controlled scene, in place of --frames")
      ->excludes(frames);
  add_drawing(run, arguments->video, arguments->gl, "of the run");
  run.add_flag("--plots", arguments->plots,
               "plots of a controlled scene: angles, errors, torques (needs gnuplot)");
  run.add_flag("--report", arguments->report,
               "report.html: motion in 3D, curves and verdicts on one page for a browser; records contacts, "
               "energies and residuals");
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
  add_input(render, "scene", arguments->scene, "scene file")->required();
  render.add_option("--out", arguments->out, "PNG file: .png (default without --video: out/NAME.png)")
      ->check(check_path);
  add_overrides(render, arguments->overrides);
  add_time(render, "--time", arguments->time,
           "simulated time of the picture (default 0), end of the video (default: the scene's)");
  add_drawing(render, arguments->video, arguments->gl, "in place of --out or beside it");
  render.parse_complete_callback([arguments, &render] {
    if (!arguments->out && !arguments->video) arguments->out = default_out(render, ".png");
  });
}

}  // namespace

void add_drawing(CLI::App& command, std::optional<simulation::VideoSpec>& video,
                 std::optional<output::Gl>& gl, const std::string& where) {
  CLI::Option* file = command.add_option_function<std::filesystem::path>(
      "--video", [&](const std::filesystem::path& path) { video = simulation::VideoSpec{path}; },
      "video in real time, .mp4 or .gif (needs ffmpeg), " + where);
  file->check(check_path);
  const auto add = [&](const char* name, double simulation::VideoSpec::*field, double least, double most,
                       const char* need, const char* help) {
    const auto set = [&video, field](double value) {
      if (video) (*video).*field = value;
    };
    command.add_option_function<double>(name, set, help)
        ->check(number_from(least, most, false, need))
        ->needs(file);
  };
  add("--fps", &simulation::VideoSpec::fps, 0.1, 240, "a number of frames, 0.1 to 240",
      "frames in a second of the video (default 30)");
  add("--speed", &simulation::VideoSpec::speed, 1e-4, 1e4,
      "a factor, 0.0001 to 10000; below 1 it is slow motion",
      "simulated seconds in a second of the video (default 1)");
  add_words(
      command.add_option_function<std::string>(
          "--gl", [&](const std::string& word) { gl = word == "egl" ? output::Gl::egl : output::Gl::osmesa; },
          "OpenGL without a display (default: osmesa, if built in)"),
      "osmesa|egl");
}

void add_scene_commands(CommandLine& line) {
  for (const auto add : {add_check, add_run, add_render, add_schema}) add(line);
}

}  // namespace handsim::app
