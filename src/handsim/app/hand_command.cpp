#include <algorithm>

#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/core/data_folder.h"
#include "handsim/core/units.h"
#include "handsim/engine/collision/overlap.h"
#include "handsim/hand/doubts.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"
#include "handsim/output/output_folder.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/study/rollouts/population.h"
#include "handsim/study/uncertain.h"

namespace handsim::app {

namespace {

using Size = hand::HandSize;
constexpr std::pair<const char*, double Size::*> kSizes[] = {{"hand length", &Size::length},
                                                             {"hand breadth", &Size::breadth},
                                                             {"palm length", &Size::palm_length},
                                                             {"hand circumference", &Size::circumference},
                                                             {"hand thickness", &Size::thickness}};

std::string ranges(const model::Joint& joint) {
  std::string out;
  for (const model::JointAxis& axis : joint.axes)
    out += fmt::format("{}{} {:.0f}..{:.0f}", out.empty() ? "" : ", ", axis.name,
                       axis.stop ? axis.stop->low * kDegreesPerRadian : -180,
                       axis.stop ? axis.stop->high * kDegreesPerRadian : 180);
  return out + " deg";
}

/// The hand model's rule for the mass, with its source.
std::string mass_rule(const hand::Person& person, const hand::MassRule& rule) {
  const std::string source = rule.source.empty() ? "" : ": " + rule.source;
  if (rule.kind == hand::MassRule::Kind::density) return fmt::format("at {:g} kg/m3{}", rule.density, source);
  if (rule.kind == hand::MassRule::Kind::tissue_density)
    return fmt::format("its volume at {:g} kg/m3{}", rule.density, source);
  const auto [share, whom] = person.sex == hand::Sex::male ? std::pair(rule.male, "men")
                             : person.sex == hand::Sex::female
                                 ? std::pair(rule.female, "women")
                                 : std::pair(rule.unknown, "people of unknown sex");
  return fmt::format("{:g} % of body mass, as of {}{}", 100 * share, whom, source);
}

std::string origin(bool measured) { return measured ? "measured" : "predicted"; }

void print_size(const hand::Person& person, const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  const hand::HandSize& size = hand.size;
  print("person   {:.3f} m, {:.1f} kg, {}{}\n", person.stature, person.mass, hand::name(person.sex),
        person.age ? fmt::format(", {:g} years", *person.age) : "");
  const auto row = [&](const char* what, double value, const std::string& from) {
    print("  {:<18} {:7.1f} mm  {}\n", what, 1e3 * value, from);
  };
  const std::string slab = "of a slab with half-round edges of that breadth and circumference";
  for (std::size_t i = 0; i < 5; ++i)
    row(kSizes[i].first, size.*kSizes[i].second, i < 4 ? origin(i != 2 && size.measured[i]) : slab);
  for (const auto& [name, finger] : size.fingers)
    row((name + " length").c_str(), finger.length,
        origin(person.fingers.contains(name)) + ", crease at the base to tip");
  print("  {:<18} {:7.1f} g   {:.2f} % of body mass; {}\n", "hand mass", 1e3 * hand.mass,
        100 * hand.mass / person.mass, person.hand_mass ? "measured" : mass_rule(person, spec.mass));
  print("  predicted from: {}\n", hand::survey_of(spec.anthropometry, person).source);
}

std::string moments_of(const model::Body& body) {
  const Vec3 moments = 1e6 * body.inertia.diagonal();
  return fmt::format("{:9.4g}, {:9.4g}, {:9.4g}", moments.x(), moments.y(), moments.z());
}

void print_palm(const hand::BuiltHand& hand) {
  const model::Body& body = hand.bodies[0];
  const Vec3 e = 1e3 * hand::palm_box(hand);
  const auto shapes = std::ranges::count_if(
      hand.shapes, [](const model::Shape& shape) { return shape.part == model::Part::palm; });
  print("{:<18} {:>21} {:8.2f}  {}  {} (breadth, length, thickness), {:.0f} cm3, {:.0f} kg/m3\n", body.name,
        fmt::format("{:.1f} x {:.1f} x {:.1f}", e.x(), e.y(), e.z()), 1e3 * body.mass, moments_of(body),
        shapes == 1 ? "box" : fmt::format("{} shapes", shapes), 1e6 * hand.palm_volume,
        body.mass / hand.palm_volume);
}

std::string joint_text(const hand::BuiltHand& hand, const hand::BuiltSegment& segment) {
  if (!segment.joint) return "fixed to " + hand.bodies[as_index(segment.body)].name;
  const model::Joint& joint = hand.joints[as_index(*segment.joint)];
  return fmt::format("{} ({}: {})", joint.name, joint.type().name, ranges(joint));
}

void print_parts(const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  print("\n{:<18} {:>10} {:>10} {:>8}  {:>31}  {}\n", "segment", "length mm", "radius mm", "mass g",
        "inertia kg mm2 (x, y, z)", "joint");
  print_palm(hand);
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    const hand::BuiltSegment& segment = hand.segments[i];
    const model::Body& body = hand.bodies[as_index(segment.body)];
    // The mass of a fixed segment is in that of its parent's body.
    print("{:<18} {:10.2f} {:10.2f} {:>8}  {:>31}  {}\n", spec.segments[i].name, 1e3 * segment.length,
          1e3 * segment.radius, segment.joint ? fmt::format("{:.2f}", 1e3 * body.mass) : "",
          segment.joint ? moments_of(body) : "", joint_text(hand, segment));
  }
  print("wrist: {} axes ({})\n", hand.wrist.axes.size(), ranges(hand.wrist));
}

void print_whole(const hand::Person& person, const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  const hand::WholeHand whole = hand::whole_hand(hand);
  const bool female = person.sex == hand::Sex::female;
  const auto& ref = female ? spec.anthropometry.reference_female : spec.anthropometry.reference_male;
  print("\nwhole hand, fingers straight, in shares of hand length (reference: {}, {})\n",
        spec.anthropometry.reference_source, female ? "women" : "men");
  const auto row = [](const char* what, double value, double reference) {
    print("  {:<42} {:.4f}  reference {:.4f}\n", what, value, reference);
  };
  row("centre of mass from the wrist", whole.shares.centre_of_mass, ref.centre_of_mass);
  row("radius of gyration, sagittal axis", whole.shares.gyration_sagittal, ref.gyration_sagittal);
  row("radius of gyration, transverse axis", whole.shares.gyration_transverse, ref.gyration_transverse);
  row("radius of gyration, longitudinal axis", whole.shares.gyration_longitudinal, ref.gyration_longitudinal);
}

using Figures = std::vector<std::pair<std::string, std::vector<double>>>;

/// Figures of the hands of several persons, by name.
Figures figures_of(const hand::HandSpec& spec, const std::vector<hand::Person>& persons) {
  Figures out;
  for (const hand::Person& person : persons) {
    const hand::BuiltHand hand = hand::build_hand(spec, person);
    std::size_t next = 0;
    const auto add = [&](const std::string& name, double value) {
      if (next == out.size()) out.emplace_back(name, std::vector<double>());
      out[next++].second.push_back(value);
    };
    for (const auto& [name, value] : kSizes) add(fmt::format("{} [mm]", name), 1e3 * hand.size.*value);
    add("hand mass [g]", 1e3 * hand.mass);
    for (std::size_t i = 0; i < spec.segments.size(); ++i)
      if (!spec.segments[i].carrier) add(spec.segments[i].name + " [mm]", 1e3 * hand.segments[i].length);
    for (const model::Joint& joint : hand.joints)
      for (const model::JointAxis& axis : joint.axes)
        if (axis.stop) add(joint.name + "." + axis.name + " to [deg]", axis.stop->high * kDegreesPerRadian);
  }
  return out;
}

/// What the hand's figures are of hands within what is uncertain.
void print_uncertain(const hand::Person& person, const hand::HandSpec& spec, int count) {
  const study::UncertainPersons drawn = study::uncertain_persons(spec, person, false, count);
  print("\n{} hands within what is uncertain of this person\n  {:<32} {:>8}  {:<18} {}\n", count, "figure",
        "mean", "nine in ten", "variance of");
  for (const auto& [name, values] : figures_of(spec, drawn.persons)) {
    const study::Uncertainty of = study::uncertainty_of(drawn.inputs, values);
    print("  {:<32} {:>8.4g}  {:<18} {}\n", name, of.mean, fmt::format("{:.4g} to {:.4g}", of.low, of.high),
          study::owners_text(of.variance));
  }
}

void print_sources(const hand::HandSpec& spec) {
  if (!spec.sources.empty()) print("\nsources ({})\n", spec.title);
  for (const auto& [key, text] : spec.sources) print("  {}: {}\n", key, text);
}

YamlNode node(double value) { return yaml_scalar(number_text(value)); }

YamlNode number_list(std::initializer_list<double> values) {
  YamlNode list = yaml_sequence();
  for (const double value : values) list.items.push_back(node(value));
  return list;
}

YamlNode vector_list(const Vec3& v) { return number_list({v.x(), v.y(), v.z()}); }

YamlNode map_of(std::initializer_list<std::pair<const char*, YamlNode>> entries) {
  YamlNode map = yaml_map();
  for (const auto& [key, value] : entries) yaml_put(map, key, value);
  return map;
}

YamlNode joint_tree(const model::Joint& joint) {
  YamlNode axes = yaml_sequence();
  for (const model::JointAxis& axis : joint.axes) {
    YamlNode entry = map_of({{"name", yaml_scalar(axis.name)}, {"axis", vector_list(axis.axis)}});
    if (axis.stop) yaml_put(entry, "range", number_list({axis.stop->low, axis.stop->high}));
    axes.items.push_back(entry);
  }
  const std::string type(joint.type().name);
  return map_of({{"name", yaml_scalar(joint.name)}, {"type", yaml_scalar(type)}, {"axes", axes}});
}

/// Shapes of a body in its own frame: capsules by their ends, boxes by their edges.
YamlNode shapes_tree(const model::Model& model, int body) {
  YamlNode shapes = yaml_sequence();
  for (const model::Shape& shape : model.shapes) {
    if (shape.body != body) continue;
    YamlNode& entry = shapes.items.emplace_back(map_of({{"name", yaml_scalar(shape.name)}}));
    if (shape.kind == model::ShapeKind::box) {
      yaml_put(entry, "centre", vector_list(shape.pose.p));
      yaml_put(entry, "edges", vector_list(shape.edges));
      continue;
    }
    const Vec3 half = 0.5 * shape.length * (shape.pose.q * Vec3::UnitZ());
    yaml_put(entry, "from", vector_list(shape.pose.p - half));
    yaml_put(entry, "to", vector_list(shape.pose.p + half));
    yaml_put(entry, "radius", node(shape.radius));
  }
  return shapes;
}

/// Bodies of one hand in its hand frame, SI.
YamlNode bodies_tree(const model::Model& model, const model::HandIndex& hand, const hand::BuiltHand& built) {
  const Pose x_HW = (model.bodies[as_index(hand.palm)].zero_pose * hand.wrist_frame).inverse();
  YamlNode bodies = yaml_sequence();
  for (std::size_t i = 0; i < hand.bodies.size(); ++i) {
    const model::Body& body = model.bodies[as_index(hand.bodies[i])];
    YamlNode& entry =
        bodies.items.emplace_back(map_of({{"name", yaml_scalar(body.name)},
                                          {"mass", node(body.mass)},
                                          {"inertia", vector_list(body.inertia.diagonal())},
                                          {"centre_of_mass", vector_list(x_HW * body.zero_pose.p)}}));
    if (i == 0) yaml_put(entry, "edges", vector_list(hand::palm_box(built)));
    for (const hand::BuiltSegment& segment : built.segments) {
      if (!segment.joint || segment.body != static_cast<int>(i)) continue;
      const auto of = std::ranges::find_if(
          hand.joints, [&](int index) { return model.joints[as_index(index)].child == hand.bodies[i]; });
      const model::Joint& joint = model.joints[as_index(*of)];
      yaml_put(entry, "length", node(segment.length));
      yaml_put(entry, "radius", node(segment.radius));
      yaml_put(entry, "joint_centre", vector_list(x_HW * (body.zero_pose * joint.child_frame.p)));
      yaml_put(entry, "joint", joint_tree(joint));
    }
    yaml_put(entry, "shapes", shapes_tree(model, hand.bodies[i]));
  }
  return bodies;
}

std::string hand_yaml(const scene::Scene& scene) {
  const hand::BuiltHand& built = scene.hands.front();
  const hand::HandSize& size = built.size;
  const auto& [model, person, placement, place] = scene.spec.hands.front();
  YamlNode out = map_of({{"title", yaml_scalar(model->title, true)},
                         {"person", map_of({{"stature", node(person.stature)},
                                            {"mass", node(person.mass)},
                                            {"sex", yaml_scalar(std::string(hand::name(person.sex)))}})},
                         {"hand", map_of({{"length", node(size.length)},
                                          {"breadth", node(size.breadth)},
                                          {"palm_length", node(size.palm_length)},
                                          {"circumference", node(size.circumference)},
                                          {"thickness", node(size.thickness)},
                                          {"mass", node(built.mass)}})}});
  for (const model::HandIndex& hand : scene.model.hands)
    yaml_put(out, hand.name, bodies_tree(scene.model, hand, built));
  return "# SI units; positions in the hand frame (origin at the wrist joint centre, y distal, z dorsal), "
         "fingers\n"
         "# straight; inertias about the centre of mass along the segment's x, y (distal) and z axes.\n" +
         emit_yaml(out);
}

/// A person from the options, with the keys of a person file.
YamlNode person_of_options(const HandArguments& arguments) {
  YamlNode person = yaml_map();
  for (const auto& [key, value] : arguments.measures) yaml_put(person, key, yaml_scalar(value));
  return person;
}

/// `--hand-length` for `hand_length` or `hands.0.person.hand_length`.
std::string option_name(const std::string& key) {
  std::string name = key.substr(key.rfind('.') + 1);
  std::ranges::replace(name, '_', '-');
  return "--" + name;
}

/// Problems of a person without a file as problems of the options, those of files with the files' keys.
std::vector<Problem> option_problems(std::vector<Problem> problems) {
  for (Problem& problem : problems) {
    for (const std::string head : {"hands.0.model.", "hands.0.person."})
      if (problem.key.starts_with(head)) problem.key.erase(0, head.size());
    if (!problem.place || !problem.place->file.empty()) continue;
    problem.place.reset();
    problem.key = option_name(problem.key);
  }
  return problems;
}

/// Percentiles of every figure over people of a population, each with a hand within what is uncertain of it.
int print_population(const HandArguments& arguments) {
  constexpr int kPeople = 4000;
  const study::Population* of = study::population(*arguments.population);
  if (arguments.person || arguments.out || arguments.uncertain)
    throw input_error("--population", "a population beside --person, --out or --uncertain", "one of them");
  std::optional<hand::Sex> sex;
  for (const auto& [key, value] : arguments.measures)
    if (key != "sex")
      throw input_error(option_name(key), "a value beside --population", "one of the two");
    else if (value != "unknown")
      sex = value == "male" ? hand::Sex::male : hand::Sex::female;
  const auto spec = load_kind(arguments.model.value_or(data_folder() / "handmodels/anatomical.yaml"),
                              scene::FileKind::hand_model, hand::read_hand_spec);
  std::vector<hand::Person> people;
  for (std::uint64_t i = 0; i < kPeople; ++i) {
    environment::Draws draws(1, i, "person");
    hand::Person& person = people.emplace_back(study::draw_person(*of, sex, draws));
    study::draw_deviations(person, hand::uncertain_of(spec, person, false), i);
  }
  print("{}, {}: percentiles of the hands of {} drawn people\n  {:<32}", of->name,
        !sex                      ? "men and women in equal numbers"
        : *sex == hand::Sex::male ? "men"
                                  : "women",
        kPeople, "figure");
  for (const double percentile : arguments.percentiles) print(" {:>8}", fmt::format("{:g} %", percentile));
  print("\n");
  for (auto& [name, values] : figures_of(spec, people)) {
    std::ranges::sort(values);
    print("  {:<32}", name);
    for (const double percentile : arguments.percentiles)
      print(" {:>8.4g}", study::quantile(values, 0.01 * percentile));
    print("\n");
  }
  return 0;
}

}  // namespace

int hand_command(const HandArguments& arguments) {
  if (arguments.population) return print_population(arguments);
  PersonHands input = read_person_hands(arguments);
  const std::vector<std::string> warnings = std::move(input.warnings);
  const scene::Scene scene = compile_hands(arguments.side, hand::Mount::fixed, {}, std::move(input));
  const scene::HandEntry& entry = scene.spec.hands.front();
  const hand::BuiltHand& built = scene.hands.front();
  std::optional<output::OutputFolder> folder;
  if (arguments.out)
    folder.emplace(*arguments.out, std::vector<std::string>{"hand.yaml", "hand.png"},
                   [&] { return scene::files_read(scene); });

  print_warnings(warnings);
  print_size(entry.person, *entry.model, built);
  print_parts(*entry.model, built);
  print_whole(entry.person, *entry.model, built);
  for (const std::string& text :
       overlap_texts(scene.model, engine::initial_overlaps(scene.model, model::initial_state(scene.model))))
    print("{}\n", text);
  if (arguments.uncertain) print_uncertain(entry.person, *entry.model, *arguments.uncertain);
  print_sources(*entry.model);
  if (!arguments.out) return 0;
  folder->clear();
  output::write_file(*arguments.out / "hand.yaml", hand_yaml(scene));
  const auto draw = [&](const output::Progress&) {
    output::write_png(
        simulation::draw({scene.model, scene.spec.pictures}, {model::initial_state(scene.model), {}}),
        *arguments.out / "hand.png");
  };
  const auto failure = output::run_in_child(draw, {});
  if (failure) print_error("missing: hand.png: {}\n", *failure);
  print("\nwritten: {}{}\n", (*arguments.out / "hand.yaml").string(), failure ? "" : " and hand.png");
  return failure ? 1 : 0;
}

PersonHands read_person_hands(const HandArguments& arguments) {
  YamlNode person = person_of_options(arguments);
  if (arguments.person && !person.entries.empty())
    throw input_error(option_name(person.entries.front().key), "a value beside --person", "one of the two");
  if (arguments.person) person = load_yaml(*arguments.person);
  PersonHands out;
  Diagnostics diagnostics;
  YamlNode& person_node = yaml_put(out.files, "person", std::move(person));
  YamlNode& model_node = yaml_put(
      out.files, "model", load_yaml(arguments.model.value_or(data_folder() / "handmodels/anatomical.yaml")));
  if (!arguments.person || scene::is_of_kind(person_node, "", scene::FileKind::person, diagnostics))
    out.person = hand::read_person(person_node, "", diagnostics);
  const std::size_t of_person = diagnostics.resolution.size();
  if (scene::is_of_kind(model_node, "", scene::FileKind::hand_model, diagnostics))
    out.model = hand::read_hand_spec(model_node, "", diagnostics);
  if (!diagnostics.problems.empty()) throw Error(option_problems(diagnostics.problems));
  model_node = diagnostics.resolution.applied(model_node, "", of_person);
  out.warnings = std::move(diagnostics.warnings);
  const std::string where = person_node.place().text();
  for (const std::string& text : hand::doubts(out.model, out.person)) out.warnings.push_back(where + text);
  return out;
}

scene::Scene compile_hands(const std::string& side, hand::Mount mount, const model::Effects& effects,
                           PersonHands input) {
  scene::SceneSpec spec;
  spec.title = "hands";
  spec.pictures.view = scene::View::dorsal;
  spec.solver.effects = effects;
  // A hand is about 0.11 statures long.
  const double distance = 1.35 * 0.11 * input.person.stature;
  for (const model::Side of : {model::Side::left, model::Side::right}) {
    const bool left = of == model::Side::left;
    if (side != "both" && side != (left ? "left" : "right")) continue;
    scene::HandEntry& entry = spec.hands.emplace_back();
    entry.model = std::make_shared<const hand::HandSpec>(input.model);
    entry.person = input.person;
    entry.placement.name = left ? "left" : "right";
    entry.placement.side = of;
    entry.placement.mount = mount;
    entry.placement.pose.p = {side != "both" ? 0 : (left ? -0.5 : 0.5) * distance, 0.0, 0.2};
  }
  try {
    return scene::compile_scene(std::move(spec), std::move(input.files));
  } catch (const Error& error) {
    throw Error(option_problems(error.problems()));
  }
}

}  // namespace handsim::app
