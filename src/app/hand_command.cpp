#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/overlaps.h"
#include "handsim/core/data_folder.h"
#include "handsim/core/units.h"
#include "handsim/engine/contact/overlap.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"
#include "handsim/output/output_folder.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/scene/read/file_kind.h"
#include "handsim/scene/read/files_read.h"
#include "handsim/simulation/run/pictures.h"

namespace handsim::app {

namespace {

/// The options that describe a person, under the keys of a person file.
YamlNode person_of_options(const HandArguments& arguments) {
  YamlNode person = yaml_map();
  const auto put = [&](const char* key, const std::optional<std::string>& value) {
    if (value) yaml_put(person, key, yaml_scalar(*value));
  };
  put("stature", arguments.stature);
  put("mass", arguments.mass);
  put("sex", arguments.sex);
  put("hand_length", arguments.hand_length);
  put("hand_breadth", arguments.hand_breadth);
  put("hand_circumference", arguments.hand_circumference);
  put("hand_mass", arguments.hand_mass);
  put("hand_length_percentile", arguments.hand_length_percentile);
  return person;
}

/// `--hand-length` for `hand_length` or `hands.0.person.hand_length`.
std::string option_name(const std::string& key) {
  std::string name = key.substr(key.rfind('.') + 1);
  std::replace(name.begin(), name.end(), '_', '-');
  return "--" + name;
}

/// Problems of a person who stands in no file, as problems of the options.
std::vector<Problem> of_options(std::vector<Problem> problems) {
  for (Problem& problem : problems) {
    if (problem.place && !problem.place->file.empty()) continue;
    problem.place.reset();
    problem.key = option_name(problem.key);
  }
  return problems;
}

/// The person that the options or the file describe, as a tree, checked by the reader of persons.
/// @throws Error (input) that speaks of the file's keys or of the options.
YamlNode person_tree(const HandArguments& arguments) {
  YamlNode person = person_of_options(arguments);
  Diagnostics diagnostics;
  if (arguments.person) {
    if (!person.entries.empty())
      throw input_error(option_name(person.entries.front().key), "a value beside --person",
                        "the one or the other");
    person = load_yaml(*arguments.person);
    if (!scene::is_of_kind(person, "", scene::FileKind::person, diagnostics)) diagnostics.throw_if_any();
  }
  // The scene reads the person again, defaults and all; this reading is for its messages.
  YamlNode copy = person;
  hand::read_person(copy, "", diagnostics);
  if (!diagnostics.problems.empty()) throw Error(of_options(diagnostics.problems));
  return person;
}

std::vector<std::string> sides(const std::string& side) {
  return side == "both" ? std::vector<std::string>{"left", "right"} : std::vector<std::string>{side};
}

/// A scene with the wanted hands, straight, side by side, backs up.
YamlNode scene_tree(const HandArguments& arguments, const YamlNode& person) {
  const double stature = parse_quantity(person.find("stature")->text, Dimension::length).value_or(0);
  const double apart = 1.35 * 0.11 * stature;
  YamlNode hands = yaml_sequence();
  for (const std::string& side : sides(arguments.side)) {
    const double x = arguments.side != "both" ? 0 : (side == "left" ? -0.5 : 0.5) * apart;
    YamlNode position = yaml_sequence();
    for (const double value : {x, 0.0, 0.2}) position.items.push_back(yaml_scalar(number_text(value)));
    YamlNode wrist = yaml_map();
    yaml_put(wrist, "mount", yaml_scalar("fixed"));
    yaml_put(wrist, "position", position);
    YamlNode hand = yaml_map();
    yaml_put(hand, "model",
             load_yaml(arguments.model.value_or(data_folder() / "handmodels/anatomical.yaml")));
    yaml_put(hand, "person", person);
    yaml_put(hand, "side", yaml_scalar(side));
    yaml_put(hand, "wrist", wrist);
    hands.items.push_back(hand);
  }
  YamlNode scene = yaml_map();
  yaml_put(scene, "title", yaml_scalar("hands", true));
  yaml_put(scene, "hands", hands);
  yaml_put(scene, "effects", yaml_sequence());
  yaml_put(scene, "duration", yaml_scalar("0.001"));
  YamlNode pictures = yaml_map();
  yaml_put(pictures, "view", yaml_scalar("dorsal"));
  yaml_put(scene, "pictures", pictures);
  return scene;
}

scene::Scene compiled(const HandArguments& arguments) {
  const YamlNode person = person_tree(arguments);
  try {
    return scene::compile_scene(scene_tree(arguments, person));
  } catch (const Error& error) {
    throw Error(of_options(error.problems()));
  }
}

std::string ranges(const model::Joint& joint) {
  std::string out;
  for (const model::JointAxis& axis : joint.axes)
    out += fmt::format("{}{} {:.0f}..{:.0f}", out.empty() ? "" : ", ", axis.name,
                       axis.stop ? axis.stop->low * kDegreesPerRadian : -180,
                       axis.stop ? axis.stop->high * kDegreesPerRadian : 180);
  return out + " deg";
}

/// By which rule of the hand model, and whose.
std::string mass_rule(const hand::Person& person, const hand::MassRule& rule) {
  const std::string source = rule.source.empty() ? "" : ": " + rule.source;
  if (rule.kind == hand::MassRule::Kind::density) return fmt::format("at {:g} kg/m3{}", rule.density, source);
  const bool male = person.sex == hand::Sex::male, female = person.sex == hand::Sex::female;
  return fmt::format("{:g} % of body mass, {}{}",
                     100 * (male     ? rule.male
                            : female ? rule.female
                                     : rule.unknown),
                     male     ? "as of men"
                     : female ? "as of women"
                              : "as of people of unknown sex",
                     source);
}

std::string origin(bool measured) { return measured ? "measured" : "predicted"; }

void print_size(const hand::Person& person, const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  const hand::HandSize& size = hand.size;
  print("person   {:.3f} m, {:.1f} kg, {}\n", person.stature, person.mass, hand::name(person.sex));
  const auto row = [&](const char* what, double value, const std::string& from) {
    print("  {:<18} {:7.1f} mm  {}\n", what, 1e3 * value, from);
  };
  row("hand length", size.length, origin(size.measured[0]));
  row("hand breadth", size.breadth, origin(size.measured[1]));
  row("palm length", size.palm_length, "predicted");
  row("hand circumference", size.circumference, origin(size.measured[3]));
  row("hand thickness", size.thickness, "of a slab with half-round edges of that breadth and circumference");
  print("  {:<18} {:7.1f} g   {}\n", "hand mass", 1e3 * hand.mass,
        person.hand_mass ? "measured" : mass_rule(person, spec.mass));
  print("  predicted from: {}\n", spec.anthropometry.source);
}

void print_parts(const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  print("\n{:<18} {:>10} {:>10} {:>8}  {:>31}  {}\n", "segment", "length mm", "radius mm", "mass g",
        "inertia kg mm2 (x, y, z)", "joint");
  for (std::size_t i = 0; i < hand.bodies.size(); ++i) {
    const model::Body& body = hand.bodies[i];
    const Vec3 moments = 1e6 * body.inertia.diagonal();
    const std::string inertia =
        fmt::format("{:9.4g}, {:9.4g}, {:9.4g}", moments.x(), moments.y(), moments.z());
    if (i == 0) {
      const Vec3 e = 1e3 * hand.shapes[0].edges;
      print("{:<18} {:>21} {:8.2f}  {}  box (breadth, length, thickness)\n", body.name,
            fmt::format("{:.1f} x {:.1f} x {:.1f}", e.x(), e.y(), e.z()), 1e3 * body.mass, inertia);
      continue;
    }
    const hand::SegmentSpec& row = spec.segments[i - 1];
    const model::Joint& joint = hand.joints[i - 1];
    print("{:<18} {:10.2f} {:10.2f} {:8.2f}  {}  {} ({}: {})\n", body.name, 1e3 * row.length.value(hand.size),
          1e3 * row.radius.value(hand.size), 1e3 * body.mass, inertia, joint.name,
          joint.kind == model::JointKind::hinge ? "hinge" : "universal", ranges(joint));
  }
  print("wrist: {} axes ({})\n", hand.wrist.axes.size(), ranges(hand.wrist));
}

void print_whole(const hand::Person& person, const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  const hand::WholeHand whole = hand::whole_hand(hand);
  const bool female = person.sex == hand::Sex::female;
  const hand::HandInertiaShares& ref =
      female ? spec.anthropometry.reference_female : spec.anthropometry.reference_male;
  print("\nwhole hand, fingers straight, in shares of hand length (reference: {}, {})\n",
        spec.anthropometry.reference_source, female ? "women" : "men");
  const auto row = [](const char* what, double mine, double theirs) {
    print("  {:<42} {:.4f}  reference {:.4f}\n", what, mine, theirs);
  };
  row("centre of mass from the wrist", whole.shares.centre_of_mass, ref.centre_of_mass);
  row("radius of gyration, sagittal axis", whole.shares.gyration_sagittal, ref.gyration_sagittal);
  row("radius of gyration, transverse axis", whole.shares.gyration_transverse, ref.gyration_transverse);
  row("radius of gyration, longitudinal axis", whole.shares.gyration_longitudinal, ref.gyration_longitudinal);
}

void print_sources(const hand::HandSpec& spec) {
  if (!spec.sources.empty()) print("\nsources ({})\n", spec.title);
  for (const auto& [key, text] : spec.sources) print("  {}: {}\n", key, text);
}

YamlNode number_list(std::initializer_list<double> values) {
  YamlNode list = yaml_sequence();
  for (const double value : values) list.items.push_back(yaml_scalar(number_text(value)));
  return list;
}

YamlNode vector_list(const Vec3& v) { return number_list({v.x(), v.y(), v.z()}); }

YamlNode joint_tree(const model::Joint& joint) {
  YamlNode out = yaml_map();
  yaml_put(out, "name", yaml_scalar(joint.name));
  yaml_put(out, "type", yaml_scalar(joint.kind == model::JointKind::hinge ? "hinge" : "universal"));
  YamlNode axes = yaml_sequence();
  for (const model::JointAxis& axis : joint.axes) {
    YamlNode entry = yaml_map();
    yaml_put(entry, "name", yaml_scalar(axis.name));
    yaml_put(entry, "axis", vector_list(axis.axis));
    if (axis.stop) yaml_put(entry, "range", number_list({axis.stop->low, axis.stop->high}));
    axes.items.push_back(entry);
  }
  yaml_put(out, "axes", axes);
  return out;
}

/// Bodies of one hand in its hand frame, SI.
YamlNode bodies_tree(const model::Model& model, const model::HandIndex& hand, const hand::BuiltHand& built,
                     const hand::HandSpec& spec) {
  const Pose x_HW =
      (model.bodies[static_cast<std::size_t>(hand.palm)].zero_pose * hand.wrist_frame).inverse();
  YamlNode bodies = yaml_sequence();
  for (std::size_t i = 0; i < hand.bodies.size(); ++i) {
    const auto at = static_cast<std::size_t>(hand.bodies[i]);
    const model::Body& body = model.bodies[at];
    YamlNode entry = yaml_map();
    yaml_put(entry, "name", yaml_scalar(body.name));
    yaml_put(entry, "mass", yaml_scalar(number_text(body.mass)));
    yaml_put(entry, "inertia", vector_list(body.inertia.diagonal()));
    yaml_put(entry, "centre_of_mass", vector_list(x_HW * body.zero_pose.p));
    if (i == 0) {
      yaml_put(entry, "edges", vector_list(built.shapes[0].edges));
    } else {
      const model::Joint& joint = model.joints[static_cast<std::size_t>(hand.joints[i - 1])];
      yaml_put(entry, "length", yaml_scalar(number_text(spec.segments[i - 1].length.value(built.size))));
      yaml_put(entry, "radius", yaml_scalar(number_text(built.shapes[i].radius)));
      yaml_put(entry, "joint_centre", vector_list(x_HW * (body.zero_pose * joint.child_frame.p)));
      yaml_put(entry, "joint", joint_tree(joint));
    }
    bodies.items.push_back(entry);
  }
  return bodies;
}

std::string hand_yaml(const scene::Scene& scene, const hand::BuiltHand& built) {
  const scene::HandEntry& entry = scene.spec.hands.front();
  YamlNode out = yaml_map();
  yaml_put(out, "title", yaml_scalar(entry.model.title, true));
  YamlNode person = yaml_map();
  yaml_put(person, "stature", yaml_scalar(number_text(entry.person.stature)));
  yaml_put(person, "mass", yaml_scalar(number_text(entry.person.mass)));
  yaml_put(person, "sex", yaml_scalar(std::string(hand::name(entry.person.sex))));
  yaml_put(out, "person", person);
  YamlNode size = yaml_map();
  yaml_put(size, "length", yaml_scalar(number_text(built.size.length)));
  yaml_put(size, "breadth", yaml_scalar(number_text(built.size.breadth)));
  yaml_put(size, "palm_length", yaml_scalar(number_text(built.size.palm_length)));
  yaml_put(size, "circumference", yaml_scalar(number_text(built.size.circumference)));
  yaml_put(size, "thickness", yaml_scalar(number_text(built.size.thickness)));
  yaml_put(size, "mass", yaml_scalar(number_text(built.mass)));
  yaml_put(out, "hand", size);
  for (const model::HandIndex& hand : scene.model.hands)
    yaml_put(out, hand.name, bodies_tree(scene.model, hand, built, entry.model));
  return "# SI units; positions in the hand frame (origin at the wrist joint centre, y distal, z dorsal), "
         "fingers\n"
         "# straight; inertias about the centre of mass along the segment's x, y (distal) and z axes.\n" +
         emit_yaml(out);
}

}  // namespace

int hand_command(const HandArguments& arguments) {
  const scene::Scene scene = compiled(arguments);
  const scene::HandEntry& entry = scene.spec.hands.front();
  const hand::BuiltHand built = hand::build_hand(entry.model, entry.person);
  std::optional<output::OutputFolder> folder;
  if (arguments.out)
    folder.emplace(*arguments.out, std::vector<std::string>{"hand.yaml", "hand.png"},
                   [&] { return scene::files_read(scene); });

  for (std::size_t i = 0; i < scene.warnings.size() / scene.spec.hands.size(); ++i) {
    std::string_view text = scene.warnings[i];
    // The scene is the command's own; its keys say nothing to who gave options.
    const std::string_view key = "hands.0.person: ";
    if (text.starts_with(key)) text.remove_prefix(key.size());
    tell("warning: {}\n", text);
  }
  print_size(entry.person, entry.model, built);
  print_parts(entry.model, built);
  print_whole(entry.person, entry.model, built);
  for (const std::string& text :
       overlap_texts(scene.model, engine::initial_overlaps(scene.model, model::initial_state(scene.model))))
    print("{}\n", text);
  print_sources(entry.model);
  if (!arguments.out) return 0;
  folder->clear();
  output::write_file(*arguments.out / "hand.yaml", hand_yaml(scene, built));
  const auto draw = [&](const output::Progress&) {
    output::write_png(simulation::draw(scene, {model::initial_state(scene.model), {}}),
                      *arguments.out / "hand.png");
  };
  const auto failure = output::run_in_child(draw, {});
  if (failure) tell("missing: hand.png: {}\n", *failure);
  print("\nwritten: {}{}\n", (*arguments.out / "hand.yaml").string(), failure ? "" : " and hand.png");
  return failure ? 1 : 0;
}

}  // namespace handsim::app
