#include <cmath>

#include <fmt/format.h>

#include "handsim/core/data_folder.h"
#include "handsim/core/units.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/output/table/table_files.h"
#include "handsim/study/report.h"
#include "handsim/study/track/track.h"
#include "handsim/study/track/track_checks.h"

namespace handsim::study {

namespace {

constexpr const char* kInks[] = {"#1b6ca8", "#c8553d"};  ///< of the hands
constexpr FrameStatus kStatuses[] = {FrameStatus::tracked, FrameStatus::missing, FrameStatus::swapped,
                                     FrameStatus::poor};

bool is_tracked(const TrackedFrame& frame) { return frame.status == FrameStatus::tracked; }

/// [mm]
double deepest_overlap(const TrackedHand& hand) {
  return hand.overlaps.pairs.empty() ? 0 : 1e3 * hand.overlaps.deepest()->second.depth;
}

/// Angles and wrist poses of the tracked frames.
void write_hand(const TrackResult& result, const TrackedHand& hand, const std::filesystem::path& out) {
  output::MotionHead head{hand.name + " hand, tracked", {}, hand.count(FrameStatus::tracked)};
  for (std::size_t i = 0; i < hand.axes.size(); ++i)
    if (hand.determined[i]) head.names.push_back(hand.name + "." + hand.axes[i]);
  std::optional<output::MotionTableWriter> angles;
  if (!head.names.empty()) angles.emplace(out / (hand.name + ".mot"), head);
  output::AtomicFile wrist(out / (hand.name + "_wrist.csv"));
  std::string columns = "time[s]";
  for (const char* part : {"x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz"})
    columns += fmt::format(",{}.wrist.{}", hand.name, part);
  wrist.write(columns + "\n");
  std::vector<double> row;
  for (std::size_t k = 0; k < hand.frames.size(); ++k) {
    if (!is_tracked(hand.frames[k])) continue;
    const HandPose& pose = hand.frames[k].pose;
    row.clear();
    for (std::size_t i = 0; i < pose.angles.size(); ++i)
      if (hand.determined[i]) row.push_back(kDegreesPerRadian * pose.angles[i]);
    if (angles) angles->add(result.times[k], row);
    const Vec3& p = pose.wrist.p;
    const Quat& q = pose.wrist.q;
    wrist.write(fmt::format("{:.12g},{},{},{},{},{},{},{}\n", result.times[k], p.x(), p.y(), p.z(), q.w(),
                            q.x(), q.y(), q.z()));
  }
  if (angles) angles->finish();
  wrist.commit();
}

/// Status and residuals of every frame; an empty field is a point that was not seen or was left out.
void write_frames(const TrackResult& result, const std::filesystem::path& out) {
  output::AtomicFile file(out / "frames.csv");
  std::string head = "time[s]";
  for (const TrackedHand& hand : result.hands) {
    head += fmt::format(",{0}.status,{0}.rms[mm]", hand.name);
    for (const std::string& feature : hand.features) head += fmt::format(",{}[mm]", feature);
  }
  file.write(head + "\n");
  for (std::size_t k = 0; k < result.times.size(); ++k) {
    std::string row = fmt::format("{:.12g}", result.times[k]);
    for (const TrackedHand& hand : result.hands) {
      const TrackedFrame& frame = hand.frames[k];
      row += fmt::format(",{},", name(frame.status));
      if (!frame.distances.empty()) row += fmt::format("{:.4g}", 1e3 * frame.rms);
      for (std::size_t i = 0; i < hand.features.size(); ++i) {
        row += ",";
        if (!frame.distances.empty() && frame.distances[i])
          row += fmt::format("{:.4g}", 1e3 * *frame.distances[i]);
      }
    }
    file.write(row + "\n");
  }
  file.commit();
}

/// `, filter: "6 Hz"`, or nothing where a hand has too few tracked frames a second for such a filter.
std::string filter_of(const TrackResult& result) {
  constexpr double kCutoff = 6, kLeast = 2.001 * kCutoff;  // [Hz]
  for (const TrackedHand& hand : result.hands) {
    double count = 0, first = 0, last = 0;
    for (std::size_t k = 0; k < hand.frames.size(); ++k) {
      if (!is_tracked(hand.frames[k])) continue;
      last = result.times[k];
      if (count++ == 0) first = last;
    }
    if (count > 1 && count - 1 < kLeast * (last - first)) return {};
  }
  return fmt::format(", filter: \"{:g} Hz\"", kCutoff);
}

/// A scene in which the tracked hands move.
std::string scene_text(const TrackInput& input, const TrackResult& result) {
  std::string out = fmt::format(
      "# Written by handsim track from {}. Frames without a tracked hand have no angles: the motion runs on\n"
      "# between the neighbouring frames (frames.csv lists them).\ntitle: tracked hands\nhands:\n",
      input.recording.filename().string());
  const std::string filter = filter_of(result);
  std::string programs;
  double end = 1e-3;
  for (const TrackedHand& hand : result.hands) {
    for (std::size_t k = 0; k < hand.frames.size(); ++k)
      if (is_tracked(hand.frames[k])) end = std::max(end, result.times[k]);
    if (hand.count(FrameStatus::tracked) == 0) continue;
    out += fmt::format(
        "  - model: \"{}\"\n    person: person.yaml\n    side: {}\n"
        "    wrist: {{mount: driven, motion: {{table: {}_wrist.csv{}}}}}\n",
        std::filesystem::absolute(input.model_file).lexically_normal().string(), hand.name, hand.name,
        filter);
    const TrackedFrame& first = *std::ranges::find_if(hand.frames, is_tracked);
    std::string pose;
    for (std::size_t i = 0; i < hand.axes.size(); ++i) {
      const std::string joint = hand.axes[i].substr(0, hand.axes[i].find('.'));
      const bool more = i + 1 < hand.axes.size() && hand.axes[i + 1].starts_with(joint + ".");
      const bool begun = i > 0 && hand.axes[i - 1].starts_with(joint + ".");
      if (!begun) pose += fmt::format("{}{}: [", pose.empty() ? "" : ", ", joint);
      pose += fmt::format("{:.17g}{}", first.pose.angles[i], more ? ", " : "]");
    }
    out += fmt::format("    pose: {{{}}}\n", pose);
    if (std::ranges::find(hand.determined, true) != hand.determined.end())
      programs += fmt::format("{}{}: {}.mot", programs.empty() ? "" : ", ", hand.name, hand.name);
  }
  // Markers of the palm alone show no angle: the fingers are at rest.
  if (!programs.empty())
    out += fmt::format("control:\n  controller: \"{}\"\n  program: {{{}}}\n  motion: {{clamp: true{}}}\n",
                       (data_folder() / "controllers/feed_forward.yaml").string(), programs, filter);
  out += fmt::format(
      "effects: [gravity, joint_stops, passive_tissue, {}wrist_motion, self_contact, friction]\n"
      "solver: {{engine: ode, method: world_step, step: \"1 ms\"}}\nduration: {}\nrecord: {{every: \"10 "
      "ms\"}}\n",
      programs.empty() ? "" : "actuation, ", std::max(1e-3, std::floor(1e3 * end) * 1e-3));
  return out;
}

std::string summary_rows(const TrackResult& result) {
  std::string out =
      "hand,frames,tracked,missing,swapped,poor,noise[mm],rms[mm],overlapping_frames,deepest_overlap[mm]\n";
  for (const TrackedHand& hand : result.hands) {
    double squares = 0, count = 0;
    for (const TrackedFrame& frame : hand.frames)
      if (is_tracked(frame)) squares += frame.rms * frame.rms, count += 1;
    out += fmt::format("{},{}", hand.name, hand.frames.size());
    for (const FrameStatus status : kStatuses) out += fmt::format(",{}", hand.count(status));
    out += fmt::format(",{:.4g},{:.4g},{},{:.3g}\n", 1e3 * hand.noise,
                       count > 0 ? 1e3 * std::sqrt(squares / count) : 0, hand.overlaps.frames,
                       deepest_overlap(hand));
  }
  return out;
}

/// Angles of one hand by finger, from its .mot.
Plot angle_plot(const TrackedHand& hand) {
  constexpr int kPanels = 5;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < hand.axes.size(); ++i)
    if (hand.determined[i] && !hand.axes[i].starts_with("wrist")) names.push_back(hand.axes[i]);
  std::string commands = fmt::format(
      "  set multiplot layout {},1 title '{} hand: tracked joint angles'\nset datafile separator '\\t'\n"
      "set autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top\nset lmargin 10\n"
      "set rmargin 34\nset ylabel 'angle [deg]'\n",
      kPanels, hand.name);
  const auto panels = output::hand_panels(names, [&](std::size_t i, const char* colour) {
    return fmt::format("'{}.mot' skip 7 using 1:{} with lines lw 1.4 lc rgb '{}' title '{}'", hand.name,
                       i + 2, colour, names[i]);
  });
  for (const output::Panel& panel : panels)
    commands += fmt::format("{}set title '{}'\n{}", &panel == &panels.back() ? "set xlabel 'time [s]'\n" : "",
                            panel.part, panel.commands);
  return {hand.name + "_angles",
          fmt::format("noenhanced size 1200,{} font 'DejaVu Sans,10'", 60 + 220 * kPanels),
          commands + "  unset multiplot\nunset xlabel\n"};
}

/// RMS distance of each frame, and the frames that are marked.
Plot residual_plot(const TrackResult& result) {
  std::string commands =
      "  set datafile separator ','\nset grid lc rgb '#d0d0d0'\nset xlabel 'time [s]'\n"
      "set ylabel 'RMS distance [mm]'\nset key outside right top\nset title 'distance of the points from the "
      "fitted hand'\n"
      "set yrange [0:1e-3<*]\nplot ";
  std::size_t column = 2;
  int ink = 0;
  for (const TrackedHand& hand : result.hands) {
    commands += fmt::format(
        "{0}'frames.csv' skip 1 using 1:(strcol({1}) eq 'tracked' ? ${2} : NaN) with lines lw 1.4 lc rgb "
        "'{3}' title '{4}', '' skip 1 using 1:(strcol({1}) eq 'tracked' ? NaN : 0) with points pt {5} lc rgb "
        "'{3}' title '{4}: no hand'",
        ink > 0 ? ", " : "", column, column + 1, kInks[ink], hand.name, 5 + 2 * ink);
    column += 2 + hand.features.size();
    ++ink;
  }
  return {"residuals", "noenhanced size 1200,420 font 'DejaVu Sans,10'", commands + "\n"};
}

double rms_of(const std::vector<TruthFigures>& truth, bool fingers) {
  double squares = 0, count = 0;
  for (const TruthFigures& axis : truth) {
    if (fingers && (!axis.axis.ends_with(".flexion") || axis.axis.starts_with("thumb"))) continue;
    squares += axis.rms * axis.rms;
    count += 1;
  }
  return count > 0 ? std::sqrt(squares / count) : 0;
}

}  // namespace

std::string track_json(const TrackInput& input, const TrackResult& result) {
  Json out = {
      {"recording", input.recording.filename().string()},
      {"frames", result.times.size()},
      {"start_s", result.start},
      {"added_noise_mm", 1e3 * input.noise},
      {"cpu_s", result.cpu},
      {"frames_of_a_hand_per_s",
       result.cpu > 0 ? static_cast<double>(result.times.size() * result.hands.size()) / result.cpu : 0}};
  add_origin(out);
  Json person = {{"bones_mm", Json::object()}};
  if (result.person.hand_length) person["hand_length_mm"] = 1e3 * *result.person.hand_length;
  if (result.person.hand_breadth) person["hand_breadth_mm"] = 1e3 * *result.person.hand_breadth;
  for (const auto& [bone, length] : result.person.bones) person["bones_mm"][bone] = 1e3 * length;
  out["person"] = std::move(person);
  if (!result.shares.empty())
    for (std::size_t i = 0; i < result.shares.size(); ++i) {
      const std::string& feature = result.hands.front().features[i];
      out["points"][feature.substr(feature.find('.') + 1)] = result.shares[i];
    }
  out["warnings"] = result.warnings;
  out["hands"] = Json::array();
  for (const TrackedHand& hand : result.hands) {
    Json entry = {{"hand", hand.name}};
    for (const FrameStatus status : kStatuses) entry[std::string(name(status))] = hand.count(status);
    entry["noise_mm"] = 1e3 * hand.noise;
    entry["undetermined_axes"] = Json::array();
    for (std::size_t i = 0; i < hand.axes.size(); ++i)
      if (!hand.determined[i]) entry["undetermined_axes"].push_back(hand.axes[i]);
    entry["overlaps"] = {{"frames_tested", hand.overlaps.tested},
                         {"frames_overlapping", hand.overlaps.frames},
                         {"deepest_mm", deepest_overlap(hand)},
                         {"pairs", Json::array()}};
    for (const auto& [where, pair] : hand.overlaps.pairs)
      entry["overlaps"]["pairs"].push_back(
          {{"where", where}, {"deepest_mm", 1e3 * pair.depth}, {"time_s", pair.time}});
    if (!hand.truth.empty()) {
      entry["difference_rms_deg"] = kDegreesPerRadian * rms_of(hand.truth, false);
      entry["finger_flexion_difference_rms_deg"] = kDegreesPerRadian * rms_of(hand.truth, true);
      for (const TruthFigures& axis : hand.truth)
        entry["difference_by_axis_rms_deg"][axis.axis] = kDegreesPerRadian * axis.rms;
    }
    out["hands"].push_back(std::move(entry));
  }
  return out.dump(2) + "\n";
}

std::vector<std::string> track_files() {
  std::vector<std::string> out = report_files("summary", {"right_angles", "left_angles", "residuals"});
  out.insert(out.end(), {"right.mot", "left.mot", "right_wrist.csv", "left_wrist.csv", "frames.csv",
                         "person.yaml", "scene.yaml"});
  return out;
}

bool write_track(const TrackInput& input, const TrackResult& result, const std::filesystem::path& out) {
  output::make_folder(out);
  Report report{summary_rows(result), track_json(input, result), {}, {}};
  bool any = false;
  for (const TrackedHand& hand : result.hands) {
    if (hand.count(FrameStatus::tracked) == 0) continue;
    any = true;
    write_hand(result, hand, out);
    if (std::ranges::find(hand.determined, true) != hand.determined.end())
      report.plots.push_back(angle_plot(hand));
  }
  write_frames(result, out);
  output::write_file(out / "person.yaml", person_text(result.person));
  if (any) output::write_file(out / "scene.yaml", scene_text(input, result));
  report.plots.push_back(residual_plot(result));
  return write_report(out, "summary", report);
}

}  // namespace handsim::study
