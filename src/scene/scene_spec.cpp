#include "handsim/scene/scene_spec.h"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace handsim::scene {

namespace {

using model::Effect;
using model::Effects;
using model::ShapeKind;

const Quantity kCoordinate = {Dimension::length, -1000, 1000};
const Quantity kSize = {Dimension::length, 1e-4, 100};
const Quantity kVelocity = {Dimension::speed, -100, 100};
const Quantity kAngularVelocity = {Dimension::angular_speed, -1000, 1000};
const Quantity kMoment = {Dimension::time, 0, 1e6};

std::string item_path(std::string_view list, std::size_t i) { return fmt::format("{}.{}", list, i); }

/// A referenced file or an inline block; nothing where it cannot be read.
YamlNode* referenced(MapReader& reader, std::string_view key, const char* what) {
  YamlNode* node = reader.child(key);
  if (!node) {
    reader.problem(key, "nothing", fmt::format("{}: the path of its file, or the block itself", what));
    return nullptr;
  }
  try {
    follow_reference(*node, reader.path_of(key));
    return node;
  } catch (const Error& error) {
    reader.diagnostics().take(error);
    return nullptr;
  }
}

void read_start_pose(MapReader& reader, hand::Placement& placement) {
  YamlNode* pose = reader.child("pose");
  if (!pose) return;
  if (pose->kind != YamlNode::Kind::map) return reader.problem("pose", pose->described(), "a mapping of joints to angles");
  const Quantity angle = {Dimension::angle, -M_PI, M_PI};
  for (YamlEntry& entry : pose->entries) {
    const std::string path = reader.path_of("pose") + "." + entry.key;
    std::vector<double>& out = placement.start[entry.key];
    if (entry.value.kind == YamlNode::Kind::sequence) {
      for (const YamlNode& item : entry.value.items)
        out.push_back(read_number(item, path, angle, reader.diagnostics()).value_or(0));
    } else {
      out.push_back(read_number(entry.value, path, angle, reader.diagnostics()).value_or(0));
    }
  }
}

Pose read_pose(MapReader& reader, std::optional<Vec3> fallback = {}) {
  Pose pose;
  pose.p = reader.vector("position", kCoordinate, fallback);
  pose.q = reader.rotation("rotation");
  return pose;
}

model::PoseMotion read_motion(MapReader reader) {
  model::PoseMotion motion;
  motion.interpolation = reader.choice<model::Interpolation>(
      "interpolation",
      {{"minimum_jerk", model::Interpolation::minimum_jerk}, {"linear", model::Interpolation::linear}},
      model::Interpolation::minimum_jerk);
  if (YamlNode* keys = reader.list("keyframes", true)) {
    if (keys->items.empty()) reader.problem("keyframes", "an empty list", "at least one keyframe");
    for (std::size_t i = 0; i < keys->items.size(); ++i) {
      MapReader key(keys->items[i], item_path(reader.path_of("keyframes"), i), reader.diagnostics());
      model::PoseKey out;
      out.time = key.number("time", kMoment);
      out.pose = read_pose(key);
      if (!motion.keys.empty() && !(out.time > motion.keys.back().time))
        key.problem("time", fmt::format("{:g} s after {:g} s", out.time, motion.keys.back().time), "times that rise");
      key.finish();
      motion.keys.push_back(out);
    }
  }
  reader.finish();
  if (motion.keys.empty()) motion.keys.emplace_back();
  return motion;
}

void read_wrist(MapReader reader, hand::Placement& placement) {
  placement.mount = reader.choice<hand::Mount>("mount", hand::mounts(), hand::Mount::fixed);
  if (placement.mount == hand::Mount::driven) {
    placement.motion = read_motion(reader.map("motion"));
    placement.pose = placement.motion.keys.front().pose;
  } else {
    placement.pose = read_pose(reader, Vec3::Zero());
  }
  if (placement.mount == hand::Mount::free) {
    placement.velocity = reader.vector("velocity", kVelocity, Vec3::Zero());
    placement.angular_velocity = reader.vector("angular_velocity", kAngularVelocity, Vec3::Zero());
  }
  reader.finish();
}

HandEntry read_hand(MapReader reader) {
  HandEntry entry;
  entry.place = reader.node().place();
  Diagnostics& diagnostics = reader.diagnostics();
  if (YamlNode* node = referenced(reader, "model", "a hand model"))
    entry.model = hand::read_hand_spec(*node, reader.path_of("model"), diagnostics);
  if (YamlNode* node = referenced(reader, "person", "a person"))
    entry.person = hand::read_person(*node, reader.path_of("person"), diagnostics);
  entry.placement.side =
      reader.choice<model::Side>("side", {{"right", model::Side::right}, {"left", model::Side::left}});
  read_wrist(reader.map("wrist"), entry.placement);
  read_start_pose(reader, entry.placement);
  MapReader tissue = reader.map("tissue");
  entry.placement.tissue_stiffness = tissue.number("stiffness", {Dimension::none, 0, 1000}, 1.0);
  entry.placement.tissue_damping = tissue.number("damping", {Dimension::none, 0, 1000}, 1.0);
  tissue.finish();
  reader.finish();

  const auto warn_outside = [&](const char* key, double value, std::pair<double, double> range, const char* unit) {
    if (value < range.first || value > range.second)
      diagnostics.warnings.push_back(fmt::format("{}.{}: {:g} {} is outside the survey ({:g} to {:g} {}): extrapolated",
                                                 reader.path_of("person"), key, value, unit, range.first, range.second, unit));
  };
  if (!entry.model.segments.empty()) {
    warn_outside("stature", entry.person.stature, entry.model.anthropometry.stature_range, "m");
    warn_outside("mass", entry.person.mass, entry.model.anthropometry.mass_range, "kg");
  }
  return entry;
}

/// `right`, `left`, and `right2`, ... where a scene has more of a side.
void name_hands(std::vector<HandEntry>& hands) {
  int count[2] = {0, 0};
  for (HandEntry& entry : hands) {
    const bool right = entry.placement.side == model::Side::right;
    const int n = ++count[right ? 0 : 1];
    entry.placement.name = (right ? "right" : "left") + (n > 1 ? std::to_string(n) : std::string());
  }
}

model::Material read_surface(MapReader& reader, std::string name) {
  model::Material material;
  material.name = std::move(name);
  material.friction = reader.number("friction", {Dimension::none, 0, 10}, 0.8);
  material.restitution = reader.number("restitution", {Dimension::none, 0, 1}, 0.0);
  return material;
}

double solid_volume(const model::Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::box:
      return shape.edges.prod();
    case ShapeKind::sphere:
      return 4.0 / 3.0 * M_PI * std::pow(shape.radius, 3);
    case ShapeKind::cylinder:
      return M_PI * shape.radius * shape.radius * shape.length;
    case ShapeKind::capsule:
      return hand::capsule_inertia(shape.radius, shape.length).volume;
    case ShapeKind::plane:
      return 0;
  }
  return 0;
}

void read_shape(MapReader& reader, model::Shape& shape) {
  shape.kind = reader.choice<ShapeKind>("shape", {{"box", ShapeKind::box},
                                                  {"sphere", ShapeKind::sphere},
                                                  {"cylinder", ShapeKind::cylinder},
                                                  {"capsule", ShapeKind::capsule}});
  if (shape.kind == ShapeKind::box)
    shape.edges = reader.vector("edges", kSize);
  else
    shape.radius = reader.number("radius", kSize);
  if (shape.kind == ShapeKind::cylinder || shape.kind == ShapeKind::capsule) shape.length = reader.number("length", kSize);
}

ObjectSpec read_object(MapReader reader, const std::vector<ObjectSpec>& before) {
  ObjectSpec object;
  object.name = reader.text("name");
  for (const ObjectSpec& other : before)
    if (other.name == object.name) reader.problem("name", object.name + " a second time", "a name of its own for each object");
  read_shape(reader, object.shape);
  object.is_static = reader.flag("static", false);
  if (!object.is_static) {
    const auto mass = reader.maybe_number("mass", {Dimension::mass, 1e-6, 1e4});
    const auto density = reader.maybe_number("density", {Dimension::density, 1, 1e5});
    if (reader.has("mass") == reader.has("density"))
      reader.problem("mass", reader.has("mass") ? "a mass and a density" : "neither a mass nor a density", "one of the two");
    object.mass = mass.value_or(density.value_or(1000) * solid_volume(object.shape));
    object.velocity = reader.vector("velocity", kVelocity, Vec3::Zero());
    object.angular_velocity = reader.vector("angular_velocity", kAngularVelocity, Vec3::Zero());
  }
  object.pose = read_pose(reader);
  object.material = read_surface(reader, object.name);
  reader.finish();
  return object;
}

/// The smallest set of effects that the scene's content needs. Contact of a hand with itself is never implied.
Effects needed_effects(const SceneSpec& scene) {
  Effects effects;
  effects.add(Effect::gravity);
  const auto add_joint = [&](const hand::JointSpec& joint) {
    for (const model::JointAxis& axis : joint.axes) {
      if (axis.stop) effects.add(Effect::joint_stops);
      if (axis.tissue) effects.add(Effect::passive_tissue);
    }
  };
  for (const HandEntry& hand : scene.hands) {
    for (const hand::SegmentSpec& segment : hand.model.segments) add_joint(segment.joint);
    if (hand.placement.mount == hand::Mount::driven) effects.add(Effect::wrist_motion);
  }
  if (scene.control) effects.add(Effect::actuation);
  if (!scene.objects.empty()) effects.add(Effect::object_contact);
  if (scene.ground) effects.add(Effect::ground_contact);
  if (effects.any_contact()) effects.add(Effect::friction);
  return effects;
}

void write_effects(YamlNode& node, const Effects& effects) {
  YamlNode list = yaml_sequence();
  for (int i = 0; i < model::kEffectCount; ++i)
    if (effects.has(static_cast<Effect>(i)))
      list.items.push_back(yaml_scalar(std::string(model::kEffectNames[static_cast<std::size_t>(i)])));
  list.file = node.file;
  list.line = node.line;
  list.column = node.column;
  node = std::move(list);
}

/// Effects without anything to act on, and content whose effect is not asked for.
void check_effects(MapReader& reader, const SceneSpec& scene, const Effects& effects) {
  bool driven = false;
  for (const HandEntry& hand : scene.hands) driven = driven || hand.placement.mount == hand::Mount::driven;
  const char* key = "effects";
  if (effects.has(Effect::wrist_motion) != driven)
    reader.problem(key, driven ? "a driven wrist without wrist_motion" : "wrist_motion without a driven wrist",
                   "both or neither");
  if (effects.has(Effect::ground_contact) && !scene.ground)
    reader.problem(key, "ground_contact without a ground", "both or neither");
  if (effects.has(Effect::object_contact) && scene.objects.empty())
    reader.problem(key, "object_contact without objects", "objects to touch");
  if (effects.has(Effect::friction) && !effects.any_contact())
    reader.problem(key, "friction without contact",
                   "one of object_contact, self_contact, ground_contact with it");
  if (effects.has(Effect::actuation) != scene.control.has_value())
    reader.problem(key, scene.control ? "a control block without actuation" : "actuation without a control block",
                   "both or neither");
}

Effects read_effects(MapReader& reader, const SceneSpec& scene) {
  YamlNode* node = reader.child("effects");
  if (!node) node = &yaml_put(reader.node(), "effects", yaml_scalar("auto"));
  if (node->kind == YamlNode::Kind::scalar && node->text == "auto") {
    const Effects effects = needed_effects(scene);
    write_effects(*node, effects);
    return effects;
  }
  Effects effects;
  if (node->kind != YamlNode::Kind::sequence) {
    reader.problem("effects", node->described(), "auto or a list of effects");
    return effects;
  }
  const std::vector<std::string> known(model::kEffectNames.begin(), model::kEffectNames.end());
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    const YamlNode& item = node->items[i];
    const auto at = std::find(known.begin(), known.end(), item.text);
    if (at != known.end()) {
      effects.add(static_cast<Effect>(at - known.begin()));
      continue;
    }
    const auto near = nearest_word(item.text, known);
    reader.diagnostics().problems.push_back(
        {item.place(), item_path(reader.path_of("effects"), i), item.described(),
         fmt::format("one of {}{}", fmt::join(known, ", "), near ? " (nearest: " + *near + ")" : "")});
  }
  check_effects(reader, scene, effects);
  return effects;
}

void read_solver(MapReader reader, model::SolverSettings& solver) {
  reader.choice<int>("engine", {{"ode", 0}}, 0);
  solver.method = reader.choice<model::Method>(
      "method", {{"world_step", model::Method::world_step}, {"quick_step", model::Method::quick_step}},
      model::Method::world_step);
  solver.step = reader.number("step", {Dimension::time, 1e-6, 0.1}, 1e-3);
  solver.erp = reader.number("erp", {Dimension::none, 0, 1}, 0.2);
  solver.cfm = reader.number("cfm", {Dimension::none, 0, 1, true}, 1e-9);
  solver.iterations = reader.integer("iterations", 1, 100'000, 20);
  solver.seed = static_cast<std::uint64_t>(reader.integer("seed", 0, 2'147'483'647, 1));
  reader.finish();
}

PictureSpec read_pictures(MapReader reader) {
  PictureSpec out;
  if (YamlNode* size = reader.list("size", false)) {
    bool valid = size->items.size() == 2;
    for (std::size_t i = 0; valid && i < 2; ++i) {
      const auto pixels = parse_number(size->items[i].text);
      valid = pixels && *pixels >= 16 && *pixels <= 8192 && *pixels == std::floor(*pixels);
      if (valid) out.size[i] = static_cast<int>(*pixels);
    }
    if (!valid) reader.problem("size", size->described(), "[width, height] in pixels, 16 to 8192");
  }
  out.view = reader.choice<View>("view",
                                 {{"dorsal", View::dorsal},
                                  {"palmar", View::palmar},
                                  {"radial", View::radial},
                                  {"three_quarter", View::three_quarter}},
                                 View::three_quarter);
  if (reader.has("camera")) {
    MapReader camera = reader.map("camera");
    CameraSpec spec;
    spec.position = camera.vector("position", kCoordinate);
    spec.target = camera.vector("target", kCoordinate, Vec3::Zero());
    spec.field_of_view = camera.number("field_of_view", {Dimension::angle, 0.01, 2.5}, 0.6);
    if ((spec.position - spec.target).norm() < 1e-6)
      camera.problem("position", "the target itself", "a place apart from the target");
    camera.finish();
    out.camera = spec;
  }
  out.floor = reader.flag("floor", true);
  out.joint_axes = reader.flag("joint_axes", false);
  out.contact_points = reader.flag("contact_points", false);
  reader.finish();
  return out;
}

Criteria read_criteria(MapReader reader) {
  Criteria out;
  out.joint_gap = reader.maybe_number("joint_gap", {Dimension::length, 0, 1});
  out.stop_overshoot = reader.maybe_number("stop_overshoot", {Dimension::angle, 0, 10});
  out.stop_rest = reader.maybe_number("stop_rest", {Dimension::angle, 0, 10});
  if (reader.has("lcp_failures")) out.lcp_failures = reader.integer("lcp_failures", 0, 1'000'000'000, 0);
  out.tracking = read_tracking_criteria(reader);
  reader.finish();
  return out;
}

/// One clear sentence for a file of another kind.
bool is_other_file(const YamlNode& root, Diagnostics& diagnostics) {
  const auto say = [&](const char* got) {
    diagnostics.problems.push_back({root.place(), "", got, "a scene (a mapping with hands, effects, duration)"});
    return true;
  };
  if (root.kind == YamlNode::Kind::null) return say("an empty file");
  if (root.kind != YamlNode::Kind::map) return say("no mapping");
  if (root.find("hands") || root.find("objects")) return false;
  if (root.find("stature")) return say("a person file");
  if (root.find("segments")) return say("a hand model file");
  if (root.find("fits")) return say("an anthropometry file");
  if (root.find("gains")) return say("a controller file");
  if (root.find("poses")) return say("a pose file");
  return false;
}

void check_times(MapReader& reader, const SceneSpec& scene) {
  const double steps = scene.duration / scene.solver.step;
  if (steps > 1e9) reader.problem("duration", fmt::format("{:g} steps", steps), "at most 1e9 steps");
  const double ratio = scene.record_every / scene.solver.step;
  if (std::abs(ratio - std::round(ratio)) > 1e-6 * ratio || ratio < 0.5)
    reader.warning("record.every", fmt::format("{:g} s is no multiple of the step of {:g} s: rounded to steps",
                                               scene.record_every, scene.solver.step));
}

}  // namespace

SceneSpec read_scene(YamlNode& root, Diagnostics& diagnostics) {
  SceneSpec scene;
  if (is_other_file(root, diagnostics)) return scene;
  MapReader reader(root, "", diagnostics);
  scene.title = reader.text("title", "untitled");
  if (YamlNode* hands = reader.list("hands", false))
    for (std::size_t i = 0; i < hands->items.size(); ++i)
      scene.hands.push_back(read_hand(MapReader(hands->items[i], item_path("hands", i), diagnostics)));
  name_hands(scene.hands);
  if (YamlNode* objects = reader.list("objects", false))
    for (std::size_t i = 0; i < objects->items.size(); ++i)
      scene.objects.push_back(
          read_object(MapReader(objects->items[i], item_path("objects", i), diagnostics), scene.objects));
  if (scene.hands.empty() && scene.objects.empty()) reader.problem("hands", "no hand and no object", "at least one");
  if (reader.has("ground")) {
    MapReader ground = reader.map("ground");
    scene.ground = GroundSpec{ground.number("height", kCoordinate, 0.0), read_surface(ground, "ground")};
    ground.finish();
  }
  scene.gravity = reader.vector("gravity", {Dimension::acceleration, -1000, 1000}, scene.gravity);
  read_solver(reader.map("solver"), scene.solver);
  if (reader.has("control")) scene.control = read_control(reader.map("control"), scene.hands);
  scene.solver.effects = read_effects(reader, scene);
  scene.duration = reader.number("duration", {Dimension::time, 1e-6, 1e5});
  MapReader record = reader.map("record");
  scene.record_every = record.number("every", {Dimension::time, 1e-6, 1e5}, 0.01);
  record.finish();
  scene.pictures = read_pictures(reader.map("pictures"));
  scene.criteria = read_criteria(reader.map("criteria"));
  check_times(reader, scene);
  reader.finish();
  return scene;
}

}  // namespace handsim::scene
