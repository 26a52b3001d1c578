#include "handsim/hand/what_if.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "handsim/core/index.h"
#include "handsim/core/units.h"

namespace handsim::hand {

namespace {

constexpr const char* kSpill = "spill";  ///< of efforts to neighbours, under `without`
constexpr const char* kCommonDrive = "common_drive";
constexpr const char* kFeeling = "_feeling";  ///< of a finger
constexpr double kLeastForce = 1e-6;          ///< of a muscle that is gone [N]
const Quantity kLost = {Dimension::none, 0, 1};
const Quantity kHeldAngle = {Dimension::angle, -M_PI, M_PI};
using Names = std::vector<std::string>;

/// True, or a problem.
bool known(MapReader& reader, std::string_view key, const std::string& name, const Names& names,
           const char* need) {
  if (std::ranges::find(names, name) != names.end()) return true;
  reader.problem(key, name, need + nearest_hint(name, names));
  return false;
}

/// Changes the muscles of a hand.
class Muscles {
 public:
  Muscles(HandSpec& spec)
      : file_(spec.muscles ? *spec.muscles : none_), axes_(hand_axes(spec)), before_(file_.muscles) {
    for (const MuscleSpec& each : before_) names_.push_back(each.tendon.name);
  }

  /// A list of names, or shares by name.
  void read_without(MapReader& reader) {
    const bool shares = reader.child("without") && reader.child("without")->kind == YamlNode::Kind::map;
    if (shares || reader.diagnostics().recorder) {
      MapReader map = reader.map("without");
      for (const std::string& name : map.keys()) lose(map, name, name, map.number(name, kLost));
    }
    if (shares) return;
    for (const std::string& name : reader.texts("without", 1, 200, "nerves and muscles, or shares of them"))
      lose(reader, "without", name, 1);
  }

  void read_strength(MapReader& reader) {
    const double factor = reader.maybe_number("strength", {Dimension::none, 0, 10, true}).value_or(1);
    for (MuscleSpec& each : file_.muscles) each.force = std::max(kLeastForce, factor * each.force);
  }

  /// The tendon takes the path of the other one, across the wrist its own where the other has none there.
  void read_transfers(MapReader& reader) {
    reader.each("transfers", 1, 50, [&](MapReader row) {
      const std::string from = row.name("from"), to = row.name("to");
      const auto rest = row.maybe_number("rest", {Dimension::none, 0.5, 1.5});
      row.finish();
      if (!row.sound() || !known(row, "from", from, names_, kMuscle) ||
          !known(row, "to", to, names_, kMuscle))
        return;
      if (from == to) row.problem("to", to, "another muscle than from");
      if (of(from).excitable <= 0 || !used_.insert(from).second)
        row.problem("from", from + ", which is lost or moved", "a muscle that is neither");
      MuscleSpec &donor = of(from), receiver = in(before_, to);
      if (!is_extrinsic(receiver, axes_))
        for (const model::MomentArm& arm : donor.tendon.path.arms)
          if (axes_[as_index(arm.dof)].name.starts_with("wrist.")) receiver.tendon.path.arms.push_back(arm);
      donor.tendon.path = receiver.tendon.path;
      donor.rest = rest.value_or(donor.rest);
      std::erase_if(file_.bands, [&](const BandSpec& band) {
        return std::ranges::find(band.between, from) != band.between.end();
      });
    });
  }

  /// Reads the torn pulleys: of all fingers (`A2`) or of one (`middle_A2`).
  void read_pulleys(MapReader& reader) {
    MapReader map = reader.map("pulleys");
    Names names;
    for (const PulleySpec& each : file_.pulleys)
      names.insert(names.end(), {each.name, each.finger + "_" + each.name});
    std::set<std::string> torn;
    for (const std::string& name : map.keys()) {
      map.choice<int>(name, {{"none", 0}});
      if (!known(map, name, name, names, "a pulley of the muscles' file")) continue;
      for (const PulleySpec& each : file_.pulleys) {
        if (name != each.name && name != each.finger + "_" + each.name) continue;
        if (!torn.insert(each.gained.name).second)
          map.problem(name, "a second pulley of the " + each.finger + " finger", "one pulley in a finger");
        for (std::vector<MuscleSpec>* muscles : {&file_.muscles, &before_})
          add_path(each.gained.path, 1, in(*muscles, each.gained.name).tendon.path);
      }
    }
  }

 private:
  static constexpr const char* kMuscle = "a muscle of the hand";

  MuscleSpec& in(std::vector<MuscleSpec>& muscles, const std::string& name) {
    return muscles[static_cast<std::size_t>(std::ranges::find(names_, name) - names_.begin())];
  }
  MuscleSpec& of(const std::string& name) { return in(file_.muscles, name); }

  /// A blocked nerve leaves its muscles to pull as they rest; a muscle by its own name is gone.
  void lose(MapReader& reader, const std::string& key, const std::string& name, double share) {
    Names names = names_;
    for (const auto& [nerve, muscles] : file_.nerves) names.push_back(nerve);
    if (!file_.spill.empty()) names.emplace_back(kSpill);
    if (!file_.common_drive.empty()) names.emplace_back(kCommonDrive);
    std::map<std::string, std::string> feelings;
    for (const auto& [nerve, fingers] : file_.feeling)
      for (const auto& [finger, part] : fingers) feelings[finger + kFeeling] = finger;
    for (const auto& [feeling, finger] : feelings) names.push_back(feeling);
    if (!known(reader, key, name, names,
               "a nerve at a level, a muscle of the hand, a finger's feeling, spill or common_drive"))
      return;
    if (!used_.insert(name).second) reader.problem(key, name + " a second time", "each once");
    if (name == kSpill) {
      for (auto& [from, shares] : file_.spill)
        for (auto& [to, part] : shares) part *= 1 - share;
      return;
    }
    if (name == kCommonDrive) {
      file_.common_share *= 1 - share;
      return;
    }
    if (const auto feeling = feelings.find(name); feeling != feelings.end())
      return numb(feeling->second, share);
    const auto nerve = file_.nerves.find(name);
    if (nerve == file_.nerves.end()) {
      of(name).force = std::max(kLeastForce, (1 - share) * of(name).force);
      return;
    }
    for (const auto& [muscle, part] : nerve->second)
      of(muscle).excitable = std::min(of(muscle).excitable, 1 - share * part);
    if (const auto fingers = file_.feeling.find(name); fingers != file_.feeling.end())
      for (const auto& [finger, part] : fingers->second) numb(finger, share * part);
  }

  /// A person presses with less of a finger that does not feel.
  void numb(const std::string& finger, double share) {
    for (MuscleSpec& each : file_.muscles)
      if (std::ranges::any_of(each.tendon.path.arms, [&](const model::MomentArm& arm) {
            return turns(axes_[as_index(arm.dof)], finger);
          }))
        each.effort = std::min(each.effort, 1 - file_.numb * share);
  }

  MuscleFile none_;
  MuscleFile& file_;
  std::vector<HandAxis> axes_;
  std::vector<MuscleSpec> before_;  ///< with their own tendons
  Names names_;
  std::set<std::string> used_;  ///< lost or moved
};

/// Narrows the range of an axis, to one angle or more; it starts at the nearest one to 0.
void limit(MapReader& reader, const std::string& key, model::JointAxis& axis, double low, double high) {
  model::Stop stop = axis.stop.value_or(model::Stop{-M_PI, M_PI});
  constexpr double kRounding = 1e-9, kDegrees = kDegreesPerRadian;
  if (stop.stiff) return reader.problem(key, axis.name + " a second time", "one range of an axis");
  if (low < stop.low - kRounding || high > stop.high + kRounding)
    return reader.problem(
        key, fmt::format("{} at {:.4g} deg", axis.name, kDegrees * (low < stop.low ? low : high)),
        fmt::format("within its range, {:.4g} to {:.4g} deg", kDegrees * stop.low, kDegrees * stop.high));
  const double middle = 0.5 * (low + high), half = 0.5 * std::max(high - low, model::kFusedRange);
  stop.low = middle - half;
  stop.high = middle + half;
  stop.stiff = true;
  axis.initial = low == high ? middle : std::clamp(0.0, stop.low, stop.high);
  axis.stop = stop;
}

/// `fused`: angles by joint (its further axes at 0) or axis; `range_limits`: ranges by axis.
void read_ranges(MapReader& reader, const char* key, bool fuses, HandSpec& spec) {
  MapReader map = reader.map(key);
  std::vector<std::pair<std::string, JointSpec*>> joints = {{spec.wrist.name, &spec.wrist}};
  for (SegmentSpec& row : spec.segments)
    if (!row.fixed) joints.emplace_back(row.joint.name, &row.joint);
  Names names;
  for (const auto& [name, joint] : joints) {
    if (fuses) names.push_back(name);
    for (const model::JointAxis& axis : joint->axes) names.push_back(name + "." + axis.name);
  }
  for (const std::string& name : map.keys()) {
    std::optional<std::pair<double, double>> range;
    if (!fuses)
      range = map.maybe_range(name, kHeldAngle);
    else if (const auto angle = map.maybe_number(name, kHeldAngle))
      range = {*angle, *angle};
    if (!known(map, name, name, names, fuses ? "a joint of the hand" : "an axis of the hand") || !range)
      continue;
    for (const auto& [joint, of] : joints)
      for (std::size_t a = 0; a < of->axes.size(); ++a) {
        model::JointAxis& axis = of->axes[a];
        const bool further = name == joint && a > 0;
        if (name == joint || name == joint + "." + axis.name)
          limit(map, name, axis, further ? 0 : range->first, further ? 0 : range->second);
      }
  }
}

}  // namespace

std::optional<HandSpec> read_what_if(MapReader& reader, const HandSpec& spec) {
  std::optional<HandSpec> out;
  const auto asks = [&](const char* key) {
    if (!reader.has(key)) return false;
    if (!out) out = spec;
    return true;
  };
  std::optional<Muscles> muscles;
  const auto asks_muscles = [&](const char* key) {
    if (!asks(key)) return false;
    if (!spec.muscles && !reader.diagnostics().recorder)
      reader.problem(key, "a hand without muscles",
                     "one with muscles, which a scene lists among its effects");
    if (!muscles) muscles.emplace(*out);
    return spec.muscles || reader.diagnostics().recorder;
  };
  if (asks_muscles("without")) muscles->read_without(reader);
  if (asks_muscles("pulleys")) muscles->read_pulleys(reader);
  if (asks_muscles("transfers")) muscles->read_transfers(reader);
  if (asks_muscles("strength")) muscles->read_strength(reader);
  if (asks("fused")) read_ranges(reader, "fused", true, *out);
  if (asks("range_limits")) read_ranges(reader, "range_limits", false, *out);
  return out;
}

}  // namespace handsim::hand
