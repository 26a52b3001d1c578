// Recorded hands, for python/handsim/_track.py.
#include "handsim/study/track/track.h"

#include <cmath>

#include "handsim/app/commands.h"
#include "handsim/core/data_folder.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"
#include "handsim/study/track/track_checks.h"

namespace handsim::python {

namespace {

using std::filesystem::path;

/// The input of a tracking: the recording, with the files that it is read by.
std::unique_ptr<study::TrackInput> track_input(const path& recording, const std::optional<path>& person,
                                               const path& model, const std::optional<path>& markers,
                                               std::optional<char> up, std::optional<bool> left_handed,
                                               const std::optional<path>& truth, bool fit_bones, bool smooth,
                                               double noise, unsigned seed) {
  auto out = std::make_unique<study::TrackInput>();
  out->recording = recording, out->truth = truth;
  out->up = up, out->left_handed = left_handed;
  out->fit_bones = fit_bones, out->smooth = smooth, out->noise = noise, out->seed = seed;
  out->model = app::load_kind(model, scene::FileKind::hand_model, hand::read_hand_spec);
  out->person = app::load_kind(person.value_or(data_folder() / "config/persons/median_man.yaml"),
                               scene::FileKind::person, hand::read_person);
  out->person_named = person.has_value();
  if (markers) out->markers = app::load_kind(*markers, scene::FileKind::marker_set, study::read_marker_set);
  return out;
}

/// The fields of Hand in _track.py.
py::tuple fields_of(const study::TrackedHand& hand) {
  const std::size_t axes = hand.axes.size(), features = hand.features.size();
  std::vector<double> rms, angles, wrist, distances;
  std::vector<py::ssize_t> status;
  for (const study::TrackedFrame& frame : hand.frames) {
    const bool fitted = !frame.distances.empty();
    status.push_back(static_cast<py::ssize_t>(frame.status));
    rms.push_back(fitted ? frame.rms : NAN);
    append(wrist, frame.pose.wrist);
    for (std::size_t i = 0; i < axes; ++i) angles.push_back(fitted ? frame.pose.angles[i] : NAN);
    for (std::size_t i = 0; i < features; ++i)
      distances.push_back(fitted ? frame.distances[i].value_or(NAN) : NAN);
  }
  const study::OverlapFigures& overlaps = hand.overlaps;
  py::list truth, pairs;
  for (const auto& [where, pair] : overlaps.pairs) pairs.append(py::make_tuple(where, pair.depth, pair.time));
  for (const study::TruthFigures& each : hand.truth) truth.append(py::make_tuple(each.axis, each.rms));
  return py::make_tuple(hand.name, hand.axes, hand.determined, hand.features, py::array(py::cast(status)),
                        array_of(rms), array_of(angles, axes), array_of(wrist, 7),
                        array_of(distances, features),
                        py::make_tuple(overlaps.tested, overlaps.frames, pairs), truth, hand.noise);
}

/// The fields of Result in _track.py.
py::dict run(const study::TrackInput& input, const py::object& progress) {
  const study::TrackResult found =
      run_study(progress, [&](StudyHooks& hooks) { return study::run_track(input, hooks.told); });
  py::dict out, size;
  out["times"] = array_of(found.times), out["start"] = found.start, out["cpu"] = found.cpu;
  out["warnings"] = found.warnings;
  py::list hands;
  for (const study::TrackedHand& hand : found.hands) hands.append(fields_of(hand));
  const study::BetweenHands& between = found.between;
  out["between"] = py::make_tuple(between.frames, between.depth, between.time, between.where, between.moved);
  out["hands"] = hands, out["title"] = input.person.title, out["named"] = input.person_named;
  if (found.person.hand_length) size["hand_length"] = *found.person.hand_length;
  if (found.person.hand_breadth) size["hand_breadth"] = *found.person.hand_breadth;
  out["size"] = size, out["bones"] = found.person.bones;
  std::vector<double> shares;
  for (const Vec3& each : found.shares) append(shares, each);
  out["shares"] = array_of(shares, 3);
  out["person"] = study::person_text(found.person);
  return out;
}

}  // namespace

void bind_track(py::module_& module) {
  bind_class<study::TrackInput>(module, "Track").def("run", &run);
  module.def("track", &track_input);
  module.def("plain_name", [](const std::string& name) { return study::plain_name(name); });
  module.def("parse_length", [](const std::string& text) { return parse_quantity(text, Dimension::length); });
  module.def("parse_mass", [](const std::string& text) { return parse_quantity(text, Dimension::mass); });
}

}  // namespace handsim::python
