#include <algorithm>
#include <cmath>

#include "handsim/app/console.h"
#include "handsim/app/motion_command.h"
#include "handsim/app/progress.h"
#include "handsim/core/data_folder.h"
#include "handsim/output/output_folder.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::app {

namespace {

/// Reads a file of a known kind. @throws Error (input) with all its problems.
template <class Read>
auto load_kind(const std::filesystem::path& path, scene::FileKind kind, const Read& read) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  decltype(read(root, diagnostics)) out{};
  if (scene::is_of_kind(root, "", kind, diagnostics)) out = read(root, diagnostics);
  diagnostics.throw_if_any();
  print_warnings(diagnostics.warnings);
  return out;
}

}  // namespace

study::TrackInput track_input(const TrackArguments& arguments) {
  study::TrackInput out;
  out.recording = arguments.recording;
  out.model_file = arguments.model.value_or(data_folder() / "handmodels/anatomical.yaml");
  out.model = load_kind(
      out.model_file, scene::FileKind::hand_model,
      [](YamlNode& root, Diagnostics& diagnostics) { return hand::read_hand_spec(root, "", diagnostics); });
  out.person = load_kind(
      arguments.person.value_or(data_folder() / "config/persons/median_man.yaml"), scene::FileKind::person,
      [](YamlNode& root, Diagnostics& diagnostics) { return hand::read_person(root, "", diagnostics); });
  if (arguments.markers)
    out.markers = load_kind(*arguments.markers, scene::FileKind::marker_set,
                            [](YamlNode& root, Diagnostics& diagnostics) {
                              return study::read_marker_set(root, "", diagnostics);
                            });
  out.person_named = arguments.person.has_value();
  out.fit_bones = !arguments.keep_person;
  out.smooth = !arguments.no_smoothing;
  out.noise = arguments.noise;
  out.seed = arguments.seed;
  out.truth = arguments.truth;
  return out;
}

namespace {

void print_track(const study::TrackInput& input, const study::TrackResult& result) {
  print_warnings(result.warnings);
  for (const study::TrackedHand& hand : result.hands) {
    using Status = study::FrameStatus;
    print(
        "{:<6} {} frames: {} tracked, {} without a hand, {} swapped, {} poor; noise {:.3g} mm a coordinate\n",
        hand.name, hand.frames.size(), hand.count(Status::tracked), hand.count(Status::missing),
        hand.count(Status::swapped), hand.count(Status::poor), 1e3 * hand.noise);
    if (const auto open = std::count(hand.determined.begin(), hand.determined.end(), false);
        open > 0 && hand.count(Status::tracked) > 0)
      print("       {} axes that no point or sensor determines: left out\n", open);
    if (hand.overlaps.frames > 0)
      print(
          "       fingers inside each other in {} of {} frames tested, up to {:.2g} mm ({}): handsim run of "
          "scene.yaml resolves them by contact\n",
          hand.overlaps.frames, hand.overlaps.tested, 1e3 * hand.overlaps.deepest, hand.overlaps.where);
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

int track_command(const TrackArguments& arguments) {
  const study::TrackInput input = track_input(arguments);
  const output::OutputFolder folder(arguments.out, study::track_files(), [&] {
    std::vector<std::filesystem::path> read = {input.recording, input.model_file};
    for (const auto& file : {arguments.person, arguments.markers, arguments.truth})
      if (file) read.push_back(*file);
    return read;
  });
  const study::TrackResult result =
      with_progress([&](const auto& show) { return study::run_track(input, show); });
  folder.clear();
  study::StudyEnd end;
  end.plotted = study::write_track(input, result, arguments.out);
  const bool tracked = std::any_of(result.hands.begin(), result.hands.end(), [](const auto& hand) {
    return hand.count(study::FrameStatus::tracked) > 0;
  });
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
