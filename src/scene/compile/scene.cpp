#include "handsim/scene/compile/scene.h"

#include <fmt/format.h>

#include "handsim/model/validate.h"
#include "handsim/scene/compile/contacts.h"
#include "handsim/scene/read/criteria.h"

namespace handsim::scene {

namespace {

void add_object(model::Model& model, const ObjectSpec& object, int group) {
  const int material = static_cast<int>(model.materials.size());
  model.materials.push_back(object.material);
  Pose x_BO = object.pose;
  int on = model::kWorld;
  if (!object.is_static) {
    model::Body body;
    body.name = object.name;
    body.mass = object.body.mass;
    body.inertia = object.body.inertia;
    body.zero_pose = object.pose * object.body_frame();
    body.initial_velocity = object.velocity;
    body.initial_angular_velocity = object.angular_velocity;
    x_BO = object.body_frame().inverse();
    on = static_cast<int>(model.bodies.size());
    model.bodies.push_back(std::move(body));
  }
  for (std::size_t i = 0; i < object.shapes.size(); ++i) {
    model::Shape shape = object.shapes[i];
    shape.name = object.name;
    if (object.shapes.size() > 1) shape.name += ".part" + std::to_string(i);
    shape.part = model::Part::object;
    shape.group = group;
    shape.material = material;
    shape.body = on;
    shape.pose = x_BO * shape.pose;
    model.shapes.push_back(std::move(shape));
  }
}

void add_ground(model::Model& model, const GroundSpec& ground) {
  model::Shape plane;
  plane.name = "ground";
  plane.kind = model::ShapeKind::plane;
  plane.pose.p.z() = ground.height;
  plane.part = model::Part::ground;
  plane.group = static_cast<int>(model.groups.size());
  plane.material = static_cast<int>(model.materials.size());
  model.groups.push_back({"ground"});
  model.materials.push_back(ground.material);
  model.shapes.push_back(std::move(plane));
}

void add_hands(model::Model& model, const SceneSpec& spec, Diagnostics& diagnostics) {
  for (std::size_t i = 0; i < spec.hands.size(); ++i) {
    const HandEntry& entry = spec.hands[i];
    try {
      hand::add_hand(model, hand::build_hand(entry.model, entry.person), entry.placement);
    } catch (const Error& error) {
      // Builders speak of their own keys; put them under this hand.
      for (Problem problem : error.problems()) {
        if (!problem.place)
          problem.place = problem.key.starts_with("person") ? entry.person_place : entry.place;
        problem.key = "hands." + std::to_string(i) + "." + problem.key;
        diagnostics.problems.push_back(std::move(problem));
      }
    }
  }
}

/// What is wrong with the compiled model stands where the part of the scene stands that it came from.
void place_defects(std::vector<Problem>& problems, const SceneSpec& spec) {
  for (Problem& problem : problems) {
    const auto of = [&](const std::string& name, const Place& place) {
      if (problem.key == name || problem.key.starts_with(name + ".")) problem.place = place;
    };
    for (const HandEntry& hand : spec.hands) of(hand.placement.name, hand.place);
    for (const ObjectSpec& object : spec.objects) of(object.name, object.place);
    for (const MechanismJointSpec& joint : spec.mechanism.joints) of(joint.name, joint.place);
    for (const BodySpec& body : spec.mechanism.bodies) of(body.name, body.place);
  }
}

/// A joint that starts beyond its stop would be driven back by a share of the angle in each step: 1 rad at
/// 1 ms throws it at 200 rad/s. Less than a thousandth is rounding of whoever wrote the angle.
std::vector<Problem> start_defects(const model::Model& model, const model::Effects& effects) {
  constexpr double kSlack = 1e-3;
  std::vector<Problem> problems;
  if (!effects.has(model::Effect::joint_stops)) return problems;
  for (const model::Joint& joint : model.joints)
    for (const model::JointAxis& axis : joint.axes) {
      if (!axis.stop) continue;
      if (axis.initial >= axis.stop->low - kSlack && axis.initial <= axis.stop->high + kSlack) continue;
      const char* unit = joint.kind == model::JointKind::slider ? "m" : "rad";
      problems.push_back(
          {std::nullopt, joint.name + "." + axis.name,
           fmt::format("a start at {:.4g} {}", axis.initial, unit),
           fmt::format("{:.4g} to {:.4g} {}, within its stops", axis.stop->low, axis.stop->high, unit)});
    }
  return problems;
}

/// @throws Error (input) with all that is wrong with it.
model::Model compile_model(const SceneSpec& spec) {
  Diagnostics diagnostics;
  model::Model model = model::make_model();
  model.gravity = spec.gravity;
  add_hands(model, spec, diagnostics);
  if (!spec.objects.empty()) {
    const int all = static_cast<int>(model.groups.size());
    model.groups.push_back({"objects"});
    for (const ObjectSpec& object : spec.objects) {
      const int group = object_group(spec, object);
      if (group != all) model.groups.push_back({object.name});
      add_object(model, object, group);
    }
  }
  if (spec.ground) add_ground(model, *spec.ground);
  add_mechanism(model, spec.mechanism);
  diagnostics.throw_if_any();
  add_contact_rules(model, spec);
  diagnostics.problems = model::defects(model);
  if (diagnostics.problems.empty()) diagnostics.problems = start_defects(model, spec.solver.effects);
  place_defects(diagnostics.problems, spec);
  diagnostics.throw_if_any();
  return model;
}

/// A climb knows how strong its hand is.
control::Plan plan_control(const SceneSpec& spec, const model::Model& model, Diagnostics& diagnostics) {
  std::vector<std::optional<double>> strengths(spec.hands.size());
  for (const ClimbPlan& climb : spec.climb_plans) strengths[climb.hand] = climb.strength.own;
  return compile_control(*spec.control, spec.hands, strengths, model, spec.solver, diagnostics);
}

}  // namespace

Scene compile_scene(YamlNode root) {
  Diagnostics diagnostics;
  Scene scene;
  scene.spec = read_scene(root, diagnostics);
  diagnostics.throw_if_any();
  scene.model = compile_model(scene.spec);
  if (scene.spec.control) {
    scene.control = plan_control(scene.spec, scene.model, diagnostics);
    diagnostics.throw_if_any();
    check_tracked(root, scene.spec, *scene.control, diagnostics);
    diagnostics.throw_if_any();
    diagnostics.warnings.insert(diagnostics.warnings.end(), scene.control->warnings.begin(),
                                scene.control->warnings.end());
  }
  scene.resolved = std::move(root);
  scene.inputs = collect_inputs(scene.resolved);
  scene.warnings = std::move(diagnostics.warnings);
  return scene;
}

Scene without_effect(const Scene& scene, model::Effect effect) {
  Scene out = scene;
  model::Effects& effects = out.spec.solver.effects;
  effects.remove(effect);
  if (!effects.any_contact()) effects.remove(model::Effect::friction);
  out.model = compile_model(out.spec);
  out.control.reset();
  if (!effects.has(model::Effect::actuation)) out.spec.control.reset();
  if (!out.spec.control) return out;
  Diagnostics diagnostics;
  out.control = plan_control(out.spec, out.model, diagnostics);
  diagnostics.throw_if_any();
  return out;
}

Scene load_scene(const std::filesystem::path& path, const std::vector<std::string>& overrides) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  for (const std::string& assignment : overrides) {
    try {
      apply_override(root, assignment, diagnostics.budget);
    } catch (const Error& error) {
      diagnostics.take(error);
    }
  }
  diagnostics.throw_if_any();
  return compile_scene(std::move(root));
}

}  // namespace handsim::scene
