#include "handsim/hand/muscle_file.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "handsim/core/index.h"

namespace handsim::hand {

namespace {

constexpr std::size_t kMostMuscles = 200;
const Quantity kArmTerm = {Dimension::none, -0.2, 0.2};
/// An arm's polynomial holds this far beyond the range of its joint [rad].
constexpr double kBeyond = 0.1;

int find_axis(const std::vector<HandAxis>& axes, std::string_view name) {
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (axes[i].name == name) return static_cast<int>(i);
  return -1;
}

/// Reads the rows of one file.
class FileReader {
 public:
  FileReader(const std::optional<std::vector<HandAxis>>& axes, MuscleFile& file)
      : axes_(axes.value_or(std::vector<HandAxis>())), any_axis_(!axes), file_(file) {
    for (const HandAxis& axis : axes_) names_.push_back(axis.name);
  }

  void read_muscle(MapReader reader) {
    MuscleSpec muscle;
    muscle.tendon = read_tendon(reader);
    muscle.nerve = reader.maybe_text("nerve").value_or("");
    reader.fields(muscle);
    reader.maybe_text("source");
    reader.finish();
    file_.muscles.push_back(std::move(muscle));
  }

  /// A band with arms of its own, or between two muscles' tendons.
  void read_band(MapReader reader) {
    BandSpec band;
    if (reader.has("between"))
      band.tendon = read_difference(reader, band.between);
    else
      band.tendon = read_tendon(reader);
    reader.fields(band);
    reader.maybe_text("source");
    reader.finish();
    file_.bands.push_back(std::move(band));
  }

  /// Shares of muscles by a nerve, or by a muscle.
  void read_shares(MapReader reader, std::map<std::string, std::map<std::string, double>>& out,
                   bool by_muscle) {
    for (const std::string& from : reader.keys()) {
      if (by_muscle) check_muscle(reader, from, from);
      MapReader shares = reader.map(from);
      for (const std::string& name : shares.keys()) {
        out[from][name] = shares.number(name, {Dimension::none, 0, 1});
        check_muscle(shares, name, name);
      }
    }
  }

  void read_feeling(MapReader reader) {
    for (const std::string& nerve : reader.keys()) {
      std::vector<std::string> known;
      for (const auto& [name, muscles] : file_.nerves) known.push_back(name);
      if (!file_.nerves.contains(nerve))
        reader.problem(nerve, nerve, "one of nerves" + nearest_hint(nerve, known));
      MapReader shares = reader.map(nerve);
      for (const std::string& finger : shares.keys()) {
        file_.feeling[nerve][finger] = shares.number(finger, {Dimension::none, 0, 1});
        if (std::ranges::none_of(axes_, [&](const HandAxis& axis) { return turns(axis, finger); }))
          shares.problem(finger, finger, "a finger of the hand");
      }
    }
  }

  void read_common_drive(MapReader& reader) {
    file_.common_drive = reader.texts("common_drive", 2, kMostMuscles, "two muscles or more, of this file");
    std::set<std::string> names;
    for (const std::string& name : file_.common_drive) {
      check_muscle(reader, "common_drive", name);
      if (!names.insert(name).second) reader.problem("common_drive", name + " a second time", "each once");
    }
  }

  void read_pulley(MapReader reader) {
    PulleySpec pulley;
    pulley.name = reader.name("name");
    pulley.finger = reader.name("finger");
    pulley.gained.name = reader.name("tendon");
    check_muscle(reader, "tendon", pulley.gained.name);
    read_path(reader, pulley.gained.path);
    reader.finish();
    file_.pulleys.push_back(std::move(pulley));
  }

 private:
  bool check_muscle(MapReader& reader, std::string_view key, const std::string& name) {
    std::vector<std::string> known;
    for (const MuscleSpec& each : file_.muscles) known.push_back(each.tendon.name);
    const bool found = std::ranges::find(known, name) != known.end();
    if (!found) reader.problem(key, name, "a muscle of this file" + nearest_hint(name, known));
    return found;
  }

  std::string read_name(MapReader& reader) {
    std::string name = reader.name("name");
    if (std::ranges::find(taken_, name) != taken_.end() && !name.empty())
      reader.problem("name", name + " a second time", "a unique name for each muscle and band");
    taken_.push_back(name);
    return name;
  }

  TendonSpec read_tendon(MapReader& reader) {
    TendonSpec out;
    out.name = read_name(reader);
    read_path(reader, out.path);
    return out;
  }

  void read_path(MapReader& reader, model::TendonPath& path) {
    MapReader arms = reader.required_map("arms", "a mapping of axes to moment arms");
    for (const std::string& name : arms.keys(model::kMostArms)) {
      if (any_axis_ && find_axis(axes_, name) < 0) axes_.push_back({name});
      const int axis = find_axis(axes_, name);
      const YamlNode* node = arms.value(
          name, {{YamlNode::Kind::sequence, YamlNode::Kind::scalar}, "a moment arm or its coefficients"});
      if (axis < 0 || !node) continue;
      path.arms.push_back(read_arm(arms, name, axis, *node));
    }
    for (const YamlEntry& given : arms.node().entries)
      if (find_axis(axes_, given.key) < 0) arms.unknown_key(given, "an unknown axis", names_);
    reader.each("products", 0, 20, [&](MapReader row) { read_product(std::move(row), path); });
  }

  /// `0.0101`, or coefficients [m], [m/rad], [m/rad^2], ...
  model::MomentArm read_arm(MapReader& arms, const std::string& name, int axis, const YamlNode& node) {
    model::MomentArm arm;
    arm.dof = axis;
    arm.low = axes_[as_index(axis)].low - kBeyond;
    arm.high = axes_[as_index(axis)].high + kBeyond;
    const bool list = node.kind == YamlNode::Kind::sequence;
    const std::size_t count = list ? node.items.size() : 1;
    if (count < 1 || count > model::kArmTerms) {
      arms.problem(name, fmt::format("{} coefficients", count),
                   fmt::format("1 to {} coefficients [m/rad^k]", model::kArmTerms));
      return arm;
    }
    for (std::size_t k = 0; k < count; ++k) {
      const YamlNode& item = list ? node.items[k] : node;
      const std::string path = list ? fmt::format("{}.{}", arms.path_of(name), k) : arms.path_of(name);
      arm.c[k] = read_number(item, path, kArmTerm, arms.diagnostics()).value_or(0);
    }
    return arm;
  }

  void read_product(MapReader reader, model::TendonPath& path) {
    model::ArmProduct product;
    const std::vector<std::string> of = reader.texts("axes", 2, 2, "two axes of this tendon's arms");
    product.power_a = reader.integer("power_a", 1, 4, 1);
    product.power_b = reader.integer("power_b", 1, 4, 1);
    product.factor = reader.number("factor", kArmTerm);
    reader.finish();
    if (of.size() != 2) return;
    const auto place = [&](const std::string& name) {
      for (std::size_t i = 0; i < path.arms.size(); ++i)
        if (axes_[as_index(path.arms[i].dof)].name == name) return static_cast<int>(i);
      reader.problem("axes", name, "an axis among this tendon's arms");
      return 0;
    };
    product.a = place(of[0]);
    product.b = place(of[1]);
    if (product.a == product.b && reader.sound())
      reader.problem("axes", of[0] + " twice", "two axes that differ");
    if (reader.sound()) path.products.push_back(product);
  }

  /// The path by which the second muscle's tendon runs ahead of the first one's.
  TendonSpec read_difference(MapReader& reader, std::vector<std::string>& of) {
    TendonSpec out;
    out.name = read_name(reader);
    of = reader.texts("between", 2, 2, "two muscles above this row");
    if (of.size() != 2) return out;
    for (std::size_t side = 0; side < 2; ++side) {
      const auto found = std::ranges::find_if(
          file_.muscles, [&](const MuscleSpec& each) { return each.tendon.name == of[side]; });
      if (!check_muscle(reader, "between", of[side])) return out;
      add_path(found->tendon.path, side == 0 ? 1.0 : -1.0, out.path);
    }
    if (out.path.arms.size() > model::kMostArms)
      reader.problem("between", fmt::format("tendons that cross {} axes", out.path.arms.size()),
                     fmt::format("at most {}", model::kMostArms));
    return out;
  }

  std::vector<HandAxis> axes_;
  bool any_axis_;
  MuscleFile& file_;
  std::vector<std::string> names_, taken_;
};

model::TendonPath scaled(model::TendonPath path, double factor) {
  for (model::MomentArm& arm : path.arms)
    for (double& c : arm.c) c *= factor;
  for (model::ArmProduct& each : path.products) each.factor *= factor;
  return path;
}

}  // namespace

void add_path(const model::TendonPath& path, double sign, model::TendonPath& to) {
  std::vector<int> place;
  for (model::MomentArm arm : path.arms) {
    for (double& c : arm.c) c *= sign;
    const auto same =
        std::ranges::find_if(to.arms, [&](const model::MomentArm& each) { return each.dof == arm.dof; });
    place.push_back(static_cast<int>(same - to.arms.begin()));
    if (same == to.arms.end())
      to.arms.push_back(arm);
    else
      for (std::size_t k = 0; k < arm.c.size(); ++k) same->c[k] += arm.c[k];
  }
  for (model::ArmProduct each : path.products) {
    each.a = place[as_index(each.a)];
    each.b = place[as_index(each.b)];
    each.factor *= sign;
    to.products.push_back(each);
  }
}

std::map<std::string, double> read_spread(MapReader reader, std::initializer_list<const char*> names) {
  std::map<std::string, double> out;
  for (const char* name : names) {
    const bool angle = std::string_view(name) == "ranges";
    if (const auto spread = reader.maybe_number(
            name, angle ? Quantity{Dimension::angle, 0, 1} : Quantity{Dimension::none, 0, 1}))
      out[name] = *spread;
  }
  reader.finish();
  return out;
}

MuscleFile read_muscle_file(const YamlNode& node, const std::string& path,
                            const std::optional<std::vector<HandAxis>>& axes, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  MuscleFile file;
  file.title = reader.text("title", "muscles of a hand");
  file.sources = reader.named_texts("sources");
  MapReader reference = reader.required_map("reference", "a mapping with hand_length and grip_strength");
  file.hand_length = reference.number("hand_length", {Dimension::length, 0.03, 0.5});
  file.grip_strength = reference.number("grip_strength", {Dimension::force, 1, 3000});
  reference.finish();
  if (const YamlNode* norms = reader.file_or_block("norms", "a table of grip strength"))
    file.norms = read_grip_table(*norms, reader.path_of("norms"), diagnostics);
  if (reader.has("spread"))
    file.spread = read_spread(reader.map("spread"),
                              {"extrinsic_arms", "intrinsic_arms", "extrinsic_forces", "intrinsic_forces"});
  FileReader rows(axes, file);
  reader.each("muscles", 1, kMostMuscles, [&](MapReader row) { rows.read_muscle(std::move(row)); });
  reader.each("bands", 0, kMostMuscles, [&](MapReader row) { rows.read_band(std::move(row)); });
  if (reader.has("nerves")) rows.read_shares(reader.map("nerves"), file.nerves, false);
  if (reader.has("feeling")) rows.read_feeling(reader.map("feeling"));
  file.numb = reader.maybe_number("numb", {Dimension::none, 0, 1}).value_or(0);
  if (reader.has("spill")) rows.read_shares(reader.map("spill"), file.spill, true);
  if (reader.has("common_drive")) rows.read_common_drive(reader);
  reader.each("pulleys", 0, kMostMuscles, [&](MapReader row) { rows.read_pulley(std::move(row)); });
  reader.finish();
  return file;
}

bool turns(const HandAxis& axis, const std::string& finger) { return axis.name.starts_with(finger + "_"); }

bool is_extrinsic(const MuscleSpec& muscle, const std::vector<HandAxis>& axes) {
  return std::ranges::any_of(muscle.tendon.path.arms, [&](const model::MomentArm& arm) {
    return axes[as_index(arm.dof)].name.starts_with("wrist.");
  });
}

HandMuscles build_muscles(const MuscleFile& file, const std::vector<HandAxis>& axes, const HandSize& size,
                          const Person& person) {
  HandMuscles out;
  const double scale = size.length / file.hand_length;
  out.strength = grip_strength(file.norms, person).own / file.grip_strength;
  std::vector<double> rest;
  for (const HandAxis& axis : axes) rest.push_back(axis.rest);
  for (const MuscleSpec& spec : file.muscles) {
    model::Muscle& muscle = out.muscles.emplace_back();
    muscle.name = spec.tendon.name;
    muscle.nerve = spec.nerve;
    muscle.extrinsic = is_extrinsic(spec, axes);
    muscle.path = scaled(spec.tendon.path, scale);
    muscle.force = spec.force * out.strength;
    muscle.fibre_length = spec.fibre_length * scale;
    muscle.slack_length = spec.tendon_length * scale;
    muscle.pennation = spec.pennation;
    muscle.activation_time = spec.activation_time;
    muscle.deactivation_time = spec.deactivation_time;
    muscle.excitable = spec.excitable;
    muscle.effort = spec.effort;
    const double across = std::sin(spec.pennation);
    const double along = std::sqrt(std::max(0.01, spec.rest * spec.rest - across * across));
    muscle.length =
        muscle.slack_length + muscle.fibre_length * along + model::path_state(muscle.path, rest).excursion;
  }
  const auto place = [&](const std::string& name) {
    return std::ranges::find(out.muscles, name, &model::Muscle::name) - out.muscles.begin();
  };
  for (const auto& [from, shares] : file.spill)
    for (const auto& [to, share] : shares)
      if (share > 0)
        out.muscles[as_index(place(to))].spills.push_back({static_cast<int>(place(from)), share});
  for (const std::string& name : file.common_drive)
    out.muscles[as_index(place(name))].common_drive = file.common_share;
  for (const BandSpec& spec : file.bands)
    out.bands.push_back({spec.tendon.name, scaled(spec.tendon.path, scale), spec.stiffness * scale,
                         spec.damping * scale * scale, spec.rest * scale, spec.both_ways});
  return out;
}

}  // namespace handsim::hand
