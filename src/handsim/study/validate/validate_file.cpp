#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/hand/what_if.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/study/report.h"
#include "handsim/study/validate/validate.h"

namespace handsim::study {

namespace {

/// A kind of row: dimension, printed unit and scale of its values, its own keys, and its directions.
struct KindForm {
  std::string_view word;
  Dimension dimension;
  const char* unit;
  double scale;
  std::string_view keys = {}, directions = {};
};
using D = Dimension;
constexpr double kDegree = 1 / kDegreesPerRadian;
constexpr KindForm kForms[] = {
    {"moment_arms", D::length, "mm", 1e-3, "muscle axis angles arms"},
    {"excursion", D::length, "mm", 1e-3, "muscles from"},
    {"tip_force_share", D::none, "1", 1, "finger muscles", "any palmar dorsal distal proximal"},
    {"tip_force", D::force, "N", 1, "finger friction balanced segment",
     "palmar dorsal distal proximal ulnar radial"},
    {"enslaving", D::none, "1", 1, "finger by"},
    {"pinch_force", D::force, "N", 1, "finger friction balanced"},
    {"grip_force", D::force, "N", 1, "friction balanced scene tilts"},
    {"joint_moment", D::torque, "N m", 1, "axis balanced muscles", "positive negative"},
    {"passive_moment", D::torque, "N m", 1, "axis"},
    {"loaded_rotation", D::angle, "deg", kDegree, "finger muscle axis load"},
    {"coupled_angle", D::angle, "deg", kDegree, "axis free_finger"},
    {"pulley_force", D::force, "N", 1, "tension pulley pip"},
    {"sheath_friction", D::none, "1", 1, "pip"},
    {"hand_mass", D::mass, "kg", 1},
    {"centre_of_mass", D::none, "1", 1},
    {"gyration", D::none, "1", 1, {}, "sagittal transverse longitudinal"},
    {"simulation", D::none, "1", 1, "scene figure"}};

std::vector<std::string> words_of(std::string_view text) {
  std::istringstream in{std::string(text)};
  return {std::istream_iterator<std::string>(in), {}};
}

constexpr const char* kFigures = "figures such as climbs.0.load_N";
const Quantity kAngle = {Dimension::angle, -M_PI, M_PI};

std::vector<double> read_numbers(MapReader& reader, std::string_view key, const Quantity& quantity) {
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
  explicit RowReader(const Measurements& file) : hand_(*file.hand) {
    for (const hand::HandAxis& axis : hand::hand_axes(hand_)) axes_.push_back(axis.name);
    if (hand_.muscles)
      for (const hand::MuscleSpec& each : hand_.muscles->muscles) muscles_.push_back(each.tendon.name);
    for (const hand::SegmentSpec& segment : hand_.segments)
      if (const auto cut = segment.name.rfind("_distal"); cut != std::string::npos)
        fingers_.push_back(segment.name.substr(0, cut));
    for (const auto& [name, person] : file.people) people_.push_back(name);
    for (const auto& [name, changed] : file.variants) variants_.push_back(name);
  }

  void read(MapReader reader) {
    Json row = {{"name", reader.text("name")}};
    std::vector<std::pair<std::string_view, const KindForm*>> kinds;
    for (const KindForm& form : kForms) kinds.emplace_back(form.word, &form);
    const KindForm& form = *reader.choice<const KindForm*>("kind", kinds);
    const bool kind_known = reader.sound();
    row["kind"] = form.word;
    if (form.word != "simulation" && form.word != "grip_force") {
      row["person"] = known_name(reader, "person", people_, "a person of this file");
      if (reader.has("hand"))
        row["hand"] = known_name(reader, "hand", variants_, "one of the variants of this file");
    }
    if (kind_known) read_kind(reader, row, form);
    row["source"] = reader.text("source");
    row["reason"] = reader.maybe_text("reason").value_or("");
    row["required"] = reader.flag("required", false);
    for (const auto& [key, words] : {std::pair("of", "people cadavers model"),
                                     {"spread_is", "source chosen"},
                                     {"value_is", "fitted norm scaled predicted"}})
      row[key] = word(reader, key, words);
    row["chosen"] = reader.maybe_text("chosen").value_or("");
    reader.finish();
    rows_.push_back(std::move(row));
  }

  const Json& rows() const { return rows_; }

 private:
  static std::string word(MapReader& reader, std::string_view key, std::string_view of) {
    const std::vector<std::string> words = words_of(of);
    std::vector<std::pair<std::string_view, std::string>> known;
    for (const std::string& each : words) known.emplace_back(each, each);
    return reader.choice<std::string>(key, known);
  }

  std::vector<std::string> segments_of(const std::string& finger) const {
    std::vector<std::string> out;
    for (const hand::SegmentSpec& segment : hand_.segments)
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
  static std::vector<std::string> known_names(MapReader& reader, std::string_view key,
                                              const std::vector<std::string>& known, const char* need) {
    std::vector<std::string> names = reader.texts(key, 1, 100, need);
    for (const std::string& name : names) check(reader, key, name, known, need);
    return names;
  }

  /// Angles by axis.
  Json angles(MapReader pose) {
    Json out = Json::object();
    for (const std::string& axis : pose.keys()) {
      out[axis] = pose.maybe_number(axis, kAngle).value_or(0);
      named_.push_back(axis);
    }
    pose.finish();
    return out;
  }

  /// A key of the row's kind.
  void read_key(MapReader& reader, Json& row, std::string_view key) {
    if (key == "axis") row[key] = known_name(reader, key, axes_, "an axis of the hand");
    if (key == "muscle") row[key] = known_name(reader, key, muscles_, "a muscle of the hand");
    if (key == "finger" || (key == "free_finger" && reader.has("finger")))
      row["finger"] = known_name(reader, "finger", fingers_, "a finger of the hand");
    if (key == "by") row[key] = known_name(reader, key, fingers_, "a finger of the hand");
    if (key == "friction") row[key] = reader.number(key, {Dimension::none, 0, 10}, 0);
    if (key == "balanced" && reader.has(key)) {
      row[key] = known_names(reader, key, axes_, "axes of the hand");
      if (reader.has("muscles")) reader.problem("muscles", "muscles beside balanced axes", "one of the two");
    }
    if (key == "muscles" && !row.contains("balanced"))
      row[key] = known_names(reader, key, muscles_, "muscles of the hand");
    if (key == "angles" || key == "tilts") row[key] = read_numbers(reader, key, kAngle);
    if (key == "arms") read_arms(reader, row);
    if (key == "from" && reader.has(key)) row[key] = angles(reader.map(key));
    if (key == "segment" && reader.has(key))
      row[key] = known_name(reader, key, segments_of(row["finger"]), "a segment of the finger");
    if (key == "load") row[key] = reader.number(key, {Dimension::none, 0, 1});
    if (key == "tension") row[key] = reader.number(key, {Dimension::force, 0, 1e4});
    if (key == "pulley" && reader.has(key)) row[key] = known_name(reader, key, {"A2", "A4"}, "A2 or A4");
    if (key == "pip") row[key] = reader.number(key, kAngle);
    if (key == "scene") {  // relative to this file
      const std::filesystem::path folder = std::filesystem::path(reader.node().place().file).parent_path();
      row[key] = (folder / reader.text(key)).string();
      if (reader.has("set")) row["set"] = reader.texts("set", 1, 100, "overrides such as duration=1");
    }
    if (key == "figure") {
      row[key] = reader.texts(key, 1, 100, kFigures);
      if (reader.has("over")) row["over"] = reader.texts("over", 1, 100, kFigures);
      if (!row.contains("over_row")) row["unit"] = reader.text("unit");
    }
  }

  static void read_arms(MapReader& reader, Json& row) {
    const std::vector<double> arms = read_numbers(reader, "arms", {Dimension::length, -0.1, 0.1});
    const std::size_t angles = row["angles"].size();
    if (reader.sound() && (angles == 0 || angles != arms.size()))
      reader.problem("arms", fmt::format("{} arms at {} angles", arms.size(), angles), "one for each angle");
    row["arms"] = arms;
    double mean = 0;
    for (const double arm : arms) mean += arm / static_cast<double>(arms.size());
    row["measured"] = mean;
  }

  /// The row is a ratio.
  void read_over_row(MapReader& reader, Json& row) const {
    std::vector<std::string> above;
    for (const Json& each : rows_) above.push_back(each["name"]);
    const std::string name = known_name(reader, "relative_to", above, "a row above");
    const auto index = static_cast<std::size_t>(std::ranges::find(above, name) - above.begin());
    row["over_row"] = index;
    if (reader.sound() && rows_[index]["kind"] != row["kind"])
      reader.problem("relative_to", name, "a row of the same kind");
    if (row["kind"] == "moment_arms") reader.problem("relative_to", "moment_arms", "another kind");
  }

  void read_kind(MapReader& reader, Json& row, const KindForm& form) {
    named_.clear();
    bool is_ratio = reader.has("relative_to");
    if (is_ratio) read_over_row(reader, row);
    row["unit"] = form.unit;
    for (const std::string& key : words_of(form.keys)) read_key(reader, row, key);
    if (!form.directions.empty())
      row["direction"] = known_name(reader, "direction", words_of(form.directions), "a direction");
    row["pose"] = reader.has("pose") ? angles(reader.map("pose")) : Json::object();
    if (form.dimension == D::force && reader.has("or_poses"))
      reader.each("or_poses", 1, 100,
                  [&](MapReader pose) { row["or_poses"].push_back(angles(std::move(pose))); });
    if ((form.dimension == D::force || form.dimension == D::torque) && reader.has("over_pose")) {
      row["over_pose"] = angles(reader.map("over_pose"));
      is_ratio = true;
    }
    const Dimension dimension = is_ratio ? D::none : form.dimension;
    if (is_ratio) row["unit"] = "1";
    row["scale"] = is_ratio ? 1 : form.scale;
    for (const std::string& each : named_) check(reader, "pose", each, axes_, "axes of the hand");
    if (const auto length = reader.maybe_number("hand_length", {Dimension::length, 0.03, 0.5}))
      row["hand_length"] = *length;
    if (!row.contains("arms")) row["measured"] = reader.number("measured", {dimension, -1e4, 1e4});
    const double spread = reader.number("spread", {dimension, 0, 1e4, true});
    row["spread"] = spread;
    if (reader.sound() && !(spread > 0)) reader.problem("spread", "0", "more than 0");
  }

  const hand::HandSpec& hand_;
  Json rows_ = Json::array();
  std::vector<std::string> axes_, muscles_, fingers_, people_, variants_;
  std::vector<std::string> named_;  ///< axes of the row's poses
};

Measurements read(const YamlNode& root, Diagnostics& diagnostics) {
  Measurements out;
  if (!scene::is_of_kind(root, "", scene::FileKind::measurements, diagnostics)) return out;
  MapReader reader(root, "", diagnostics);
  Json text = {{"title", reader.text("title", "the hand against measurements")},
               {"goal", reader.number("goal", {Dimension::none, 0, 1}, 0.9)}};
  const auto kept = [](hand::HandSpec spec) {
    return std::make_shared<const hand::HandSpec>(std::move(spec));
  };
  out.hand = kept({});
  if (const YamlNode* node = reader.file_or_block("hand", "a hand model"))
    out.hand = kept(hand::read_hand_spec(*node, reader.path_of("hand"), diagnostics));
  if (reader.sound() && !out.hand->muscles)
    reader.problem("hand", "a hand model without muscles", "one with a muscles block");
  MapReader variants = reader.map("variants");
  for (const std::string& name : variants.keys()) {
    MapReader keys = variants.map(name);
    out.variants[name] = kept(hand::read_what_if(keys, *out.hand).value_or(*out.hand));
    keys.finish();
  }
  variants.finish();
  MapReader people = reader.required_map("people", "a mapping of names to persons");
  for (const std::string& name : people.keys())
    if (const YamlNode* node = people.file_or_block(name, "a person"))
      out.people[name] = hand::read_person(*node, people.path_of(name), diagnostics);
  people.finish();
  RowReader rows(out);
  reader.each("measurements", 1, 2000, [&](MapReader row) { rows.read(std::move(row)); });
  reader.finish();
  text["rows"] = rows.rows();
  out.text = text.dump(-1, ' ', false, Json::error_handler_t::replace);
  return out;
}

}  // namespace

void read_measurements(const YamlNode& root, Diagnostics& diagnostics) { read(root, diagnostics); }

Measurements load_measurements(const std::filesystem::path& path) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  Measurements out = read(root, diagnostics);
  diagnostics.throw_if_any();
  return out;
}

}  // namespace handsim::study
