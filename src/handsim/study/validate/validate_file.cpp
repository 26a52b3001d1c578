#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/hand/what_if.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/study/validate/subject.h"
#include "handsim/study/validate/validate.h"

namespace handsim::study {

namespace {

/// A kind of row: dimension, printed unit and scale of its values, its own keys, and its directions.
struct KindForm {
  std::string_view word;
  Measured kind;
  Dimension dimension;
  const char* unit;
  double scale;
  std::string_view keys = {}, directions = {};
};
using D = Dimension;
constexpr double kDegree = 1 / kDegreesPerRadian;
constexpr KindForm kForms[] = {
    {"moment_arms", Measured::moment_arms, D::length, "mm", 1e-3, "muscle axis"},
    {"excursion", Measured::excursion, D::length, "mm", 1e-3, "muscles"},
    {"tip_force_share", Measured::tip_force_share, D::none, "1", 1, "finger muscles",
     "any palmar dorsal distal proximal"},
    {"tip_force", Measured::tip_force, D::force, "N", 1, "finger friction balanced",
     "palmar dorsal distal proximal ulnar radial"},
    {"pinch_force", Measured::pinch_force, D::force, "N", 1, "finger friction balanced"},
    {"grip_force", Measured::grip_force, D::force, "N", 1, "friction balanced"},
    {"joint_moment", Measured::joint_moment, D::torque, "N m", 1, "axis balanced muscles",
     "positive negative"},
    {"passive_moment", Measured::passive_moment, D::torque, "N m", 1, "axis"},
    {"loaded_rotation", Measured::loaded_rotation, D::angle, "deg", kDegree, "finger muscle axis"},
    {"coupled_angle", Measured::coupled_angle, D::angle, "deg", kDegree, "axis"},
    {"pulley_force", Measured::pulley_force, D::force, "N", 1},
    {"sheath_friction", Measured::sheath_friction, D::none, "1", 1},
    {"hand_mass", Measured::hand_mass, D::mass, "kg", 1},
    {"centre_of_mass", Measured::centre_of_mass, D::none, "1", 1},
    {"gyration", Measured::gyration, D::none, "1", 1, {}, "sagittal transverse longitudinal"},
    {"simulation", Measured::simulation, D::none, "1", 1}};

const KindForm& form_of(Measured kind) { return kForms[static_cast<std::size_t>(kind)]; }

std::vector<std::string> words_of(std::string_view text) {
  std::istringstream in{std::string(text)};
  return {std::istream_iterator<std::string>(in), {}};
}

constexpr const char* kFigures = "figures such as climbs.0.load_N";
const ::handsim::Quantity kAngle = {Dimension::angle, -M_PI, M_PI};

Angles read_angles(MapReader pose, std::vector<std::string>& axes) {
  Angles out;
  for (const std::string& axis : pose.keys()) {
    out[axis] = pose.maybe_number(axis, kAngle).value_or(0);
    axes.push_back(axis);
  }
  pose.finish();
  return out;
}

Angles read_pose(MapReader& reader, std::string_view key, std::vector<std::string>& axes) {
  return reader.has(key) ? read_angles(reader.map(key), axes) : Angles{};
}

std::vector<double> read_numbers(MapReader& reader, std::string_view key,
                                 const ::handsim::Quantity& quantity) {
  std::vector<double> out;
  if (const YamlNode* list = reader.list(key, true, 1000))
    for (std::size_t i = 0; i < list->items.size(); ++i)
      out.push_back(read_number(list->items[i], fmt::format("{}.{}", reader.path_of(key), i), quantity,
                                reader.diagnostics())
                        .value_or(0));
  return out;
}

/// Reads the rows of a file.
class RowReader {
 public:
  explicit RowReader(ValidateSpec& spec) : spec_(spec) {
    for (const hand::HandAxis& axis : hand::hand_axes(spec.hand)) axes_.push_back(axis.name);
    if (spec.hand.muscles)
      for (const hand::MuscleSpec& each : spec.hand.muscles->muscles) muscles_.push_back(each.tendon.name);
    for (const hand::SegmentSpec& segment : spec.hand.segments)
      if (const auto cut = segment.name.rfind("_distal"); cut != std::string::npos)
        fingers_.push_back(segment.name.substr(0, cut));
    for (const auto& [name, person] : spec.people) people_.push_back(name);
    for (const auto& [name, changed] : spec.hands) hands_.push_back(name);
  }

  void read(MapReader reader) {
    Measurement row;
    row.name = reader.text("name");
    std::vector<std::pair<std::string_view, Measured>> kinds;
    for (const KindForm& form : kForms) kinds.emplace_back(form.word, form.kind);
    row.kind = reader.choice<Measured>("kind", kinds);
    const bool kind_known = reader.sound();
    if (!row.has_scene()) {
      row.person = known_name(reader, "person", people_, "a person of this file");
      if (reader.has("hand"))
        row.hand = known_name(reader, "hand", hands_, "one of the variants of this file");
    }
    if (kind_known) read_kind(reader, row);
    row.source = reader.text("source");
    row.reason = reader.maybe_text("reason").value_or("");
    row.required = reader.flag("required", false);
    row.on = word<MeasuredOn>(reader, "of", kMeasuredOn);
    row.spread_is = word<SpreadIs>(reader, "spread_is", kSpreadIs);
    row.value_is = word<ValueIs>(reader, "value_is", kValueIs);
    row.chosen = reader.maybe_text("chosen").value_or("");
    reader.finish();
    spec_.measurements.push_back(std::move(row));
  }

 private:
  template <class Enum, std::size_t N>
  static Enum word(MapReader& reader, std::string_view key, const std::array<const char*, N>& words) {
    std::vector<std::pair<std::string_view, Enum>> known;
    for (std::size_t i = 0; i < N; ++i) known.emplace_back(words[i], static_cast<Enum>(i));
    return reader.choice<Enum>(key, known);
  }

  std::vector<std::string> segments_of(const std::string& finger) const {
    std::vector<std::string> out;
    for (const hand::SegmentSpec& segment : spec_.hand.segments)
      if (finger.empty() || segment.name.starts_with(finger + "_")) out.push_back(segment.name);
    return out;
  }
  static std::string known_name(MapReader& reader, std::string_view key,
                                const std::vector<std::string>& known, const char* need) {
    std::string name = reader.text(key);
    check(reader, key, name, known, need);
    return name;
  }
  static void check(MapReader& reader, std::string_view key, const std::string& name,
                    const std::vector<std::string>& known, const char* need) {
    if (!name.empty() && std::ranges::find(known, name) == known.end())
      reader.problem(key, name, need + nearest_hint(name, known));
  }

  /// The scene's name is relative to this file.
  static void read_scene(MapReader& reader, Measurement& row) {
    row.scene = std::filesystem::path(reader.node().place().file).parent_path() / reader.text("scene");
    if (reader.has("set")) row.changes = reader.texts("set", 1, 100, "overrides such as duration=1");
  }

  static void read_simulation(MapReader& reader, Measurement& row) {
    read_scene(reader, row);
    row.figures = reader.texts("figure", 1, 100, kFigures);
    if (reader.has("over")) row.over = reader.texts("over", 1, 100, kFigures);
    row.unit = row.over_row ? "1" : reader.text("unit");
  }

  void read_balanced(MapReader& reader, Measurement& row) {
    row.balanced = reader.texts("balanced", 1, 100, "axes of the hand");
    for (const std::string& axis : row.balanced) check(reader, "balanced", axis, axes_, "axes of the hand");
    if (reader.has("muscles")) reader.problem("muscles", "muscles beside balanced axes", "one of the two");
  }

  /// The keys of the row's kind.
  void read_keys(MapReader& reader, Measurement& row, const KindForm& form) {
    for (const std::string& key : words_of(form.keys)) {
      if (key == "axis") row.axis = known_name(reader, key, axes_, "an axis of the hand");
      if (key == "muscle") row.muscle = known_name(reader, key, muscles_, "a muscle of the hand");
      if (key == "finger") row.finger = known_name(reader, key, fingers_, "a finger of the hand");
      if (key == "friction") row.friction = reader.number(key, {Dimension::none, 0, 10}, 0);
      if (key == "balanced" && reader.has(key)) read_balanced(reader, row);
      if (key != "muscles" || !row.balanced.empty()) continue;
      row.muscles = reader.texts(key, 1, 100, "muscles of the hand");
      for (const std::string& name : row.muscles) check(reader, key, name, muscles_, "muscles of the hand");
    }
    if (!form.directions.empty())
      row.direction = known_name(reader, "direction", words_of(form.directions), "a direction");
  }

  /// The row becomes a ratio.
  KindForm over_row(MapReader& reader, Measurement& row, const KindForm& form) {
    std::vector<std::string> above;
    for (const Measurement& each : spec_.measurements) above.push_back(each.name);
    const std::string name = known_name(reader, "relative_to", above, "a row above");
    row.over_row = static_cast<std::size_t>(std::ranges::find(above, name) - above.begin());
    if (reader.sound() && spec_.measurements[*row.over_row].kind != row.kind)
      reader.problem("relative_to", name, "a row of the same kind");
    if (row.kind == Measured::moment_arms) reader.problem("relative_to", "moment_arms", "another kind");
    return {form.word, form.kind, D::none, "1", 1, form.keys, form.directions};
  }

  void read_kind(MapReader& reader, Measurement& row) {
    const KindForm form =
        reader.has("relative_to") ? over_row(reader, row, form_of(row.kind)) : form_of(row.kind);
    row.unit = form.unit;
    row.scale = form.scale;
    std::vector<std::string> axes;
    read_keys(reader, row, form);
    if (row.kind == Measured::moment_arms) {
      row.angles = read_numbers(reader, "angles", kAngle);
      row.arms = read_numbers(reader, "arms", {Dimension::length, -0.1, 0.1});
      if (reader.sound() && (row.angles.empty() || row.angles.size() != row.arms.size()))
        reader.problem("arms", fmt::format("{} arms at {} angles", row.arms.size(), row.angles.size()),
                       "one for each angle");
      for (const double arm : row.arms) row.value += arm / static_cast<double>(row.arms.size());
    }
    if (row.kind == Measured::excursion) row.from = read_pose(reader, "from", axes);
    if (row.kind == Measured::coupled_angle && reader.has("finger"))
      row.finger = known_name(reader, "finger", fingers_, "a finger of the hand");
    if (row.kind == Measured::tip_force && reader.has("segment"))
      row.segment = known_name(reader, "segment", segments_of(row.finger), "a segment of the finger");
    if (row.kind == Measured::loaded_rotation) row.load = reader.number("load", {Dimension::none, 0, 1});
    if (row.kind == Measured::pulley_force) {
      row.tension = reader.number("tension", {Dimension::force, 0, 1e4});
      if (reader.has("pulley")) row.segment = known_name(reader, "pulley", {"A2", "A4"}, "A2 or A4");
    }
    if (row.kind == Measured::pulley_force || row.kind == Measured::sheath_friction)
      row.angles = {reader.number("pip", kAngle)};
    if (row.kind == Measured::simulation) read_simulation(reader, row);
    if (row.kind == Measured::grip_force) {
      read_scene(reader, row);
      row.tilts = read_numbers(reader, "tilts", kAngle);
    }
    row.pose = read_pose(reader, "pose", axes);
    if (form_of(row.kind).dimension == D::force && reader.has("or_poses"))
      reader.each("or_poses", 1, 100,
                  [&](MapReader pose) { row.or_poses.push_back(read_angles(std::move(pose), axes)); });
    Dimension dimension = form.dimension;
    if ((dimension == D::force || dimension == D::torque) && reader.has("over_pose")) {
      row.over_pose = read_pose(reader, "over_pose", axes);
      dimension = D::none;
      row.unit = "1";
    }
    for (const std::string& each : axes) check(reader, "pose", each, axes_, "axes of the hand");
    row.hand_length = reader.maybe_number("hand_length", {Dimension::length, 0.03, 0.5});
    if (row.kind != Measured::moment_arms) row.value = reader.number("measured", {dimension, -1e4, 1e4});
    row.spread = reader.number("spread", {dimension, 0, 1e4, true});
    if (reader.sound() && !(row.spread > 0)) reader.problem("spread", "0", "more than 0");
  }

  ValidateSpec& spec_;
  std::vector<std::string> axes_, muscles_, fingers_, people_, hands_;
};

ValidateSpec read(const YamlNode& root, Diagnostics& diagnostics) {
  ValidateSpec spec;
  if (!scene::is_of_kind(root, "", scene::FileKind::measurements, diagnostics)) return spec;
  MapReader reader(root, "", diagnostics);
  spec.title = reader.text("title", "the hand against measurements");
  spec.goal = reader.number("goal", {Dimension::none, 0, 1}, 0.9);
  if (const YamlNode* node = reader.file_or_block("hand", "a hand model"))
    spec.hand = hand::read_hand_spec(*node, reader.path_of("hand"), diagnostics);
  if (reader.sound() && !spec.hand.muscles)
    reader.problem("hand", "a hand model without muscles", "one with a muscles block");
  MapReader hands = reader.map("variants");
  for (const std::string& name : hands.keys()) {
    MapReader keys = hands.map(name);
    spec.hands[name] = hand::read_what_if(keys, spec.hand).value_or(spec.hand);
    keys.finish();
  }
  hands.finish();
  MapReader people = reader.required_map("people", "a mapping of names to persons");
  for (const std::string& name : people.keys())
    if (const YamlNode* node = people.file_or_block(name, "a person"))
      spec.people[name] = hand::read_person(*node, people.path_of(name), diagnostics);
  people.finish();
  RowReader rows(spec);
  reader.each("measurements", 1, 2000, [&](MapReader row) { rows.read(std::move(row)); });
  reader.finish();
  return spec;
}

}  // namespace

std::string_view kind_name(Measured kind) { return form_of(kind).word; }

void read_validate(const YamlNode& root, Diagnostics& diagnostics) { read(root, diagnostics); }

ValidateSpec load_validate(const std::filesystem::path& path) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  ValidateSpec spec = read(root, diagnostics);
  diagnostics.throw_if_any();
  return spec;
}

}  // namespace handsim::study
