#include "handsim/scene/compile/scene.h"

#include <set>

#include <fmt/format.h>

#include "handsim/scene/compile/model_builder.h"
#include "handsim/scene/compile/overruled.h"

namespace handsim::scene {

namespace {

/// Factors on the torque limits of the hands: a person's strength, if a task knows it, over the controller's.
std::vector<double> strengths(const Scene& scene, const control::ControllerSpec& controller) {
  std::vector<double> out(scene.spec.hands.size(), 1);
  if (!controller.grip_strength) return out;
  for (const ClimbPlan& climb : scene.plans.climbs)
    out[climb.hand] = climb.strength.own / *controller.grip_strength;
  for (const GraspPlan& grasp : scene.plans.grasps)
    if (grasp.strength) out[grasp.hand] = grasp.strength->own / *controller.grip_strength;
  return out;
}

control::Plan plan_control(const Scene& scene, const ControlSpec& spec, Diagnostics& diagnostics) {
  const engine::Settings& solver = scene.spec.solver;
  const bool implicit = spec.controller.form == control::Form::implicit_gain;
  if (implicit && solver.engine() == engine::EngineKind::dae)
    diagnostics.problems.push_back(
        {spec.place, "control.controller.form",
         fmt::format("implicit with {}", engine::name(solver.method())),
         "explicit, or the ode or articulated engine, which solve implicit gains within their step"});
  control::PlanInput input;
  input.controller = &spec.controller;
  input.poses = spec.poses ? &*spec.poses : nullptr;
  input.motion = spec.motion;
  input.programs = spec.programs;
  for (const HandEntry& hand : scene.spec.hands) {
    std::vector<std::string>& absent = input.absent.emplace_back();
    if (hand.has_wrist_joint()) continue;
    absent.push_back(hand.model->wrist.name);
    if (hand.model->forearm) absent.push_back(hand.model->forearm->joint.name);
  }
  input.strength = strengths(scene, spec.controller);
  input.effects = solver.effects;
  input.step = solver.step;
  input.allow_unstable = spec.allow_unstable;
  return control::make_plan(scene.model, input, diagnostics);
}

std::optional<control::MusclePlan> plan_muscles(const Scene& scene, Diagnostics& diagnostics) {
  const std::optional<ExcitationSpec>& file = scene.spec.excitations;
  const bool by_torques = scene.plans.control && scene.plans.control->by_muscles;
  if (file && by_torques)
    diagnostics.problems.push_back(
        {file->place, "excitations", "a table beside control with drive: muscles", "one of the two"});
  if (!scene.spec.solver.effects.has(model::Effect::muscles)) return std::nullopt;
  if (by_torques) return control::MusclePlan{};
  if (!file) return std::nullopt;
  try {
    return control::table_plan(scene.model,
                               file->file.empty()
                                   ? file->table
                                   : control::read_motion(file->file, control::TableContent::excitations),
                               diagnostics);
  } catch (const Error& error) {
    diagnostics.add(error);
  }
  return std::nullopt;
}

void check_climb_load(YamlNode& criteria, const Scene& scene, Diagnostics& diagnostics) {
  const std::optional<double>& limit = scene.spec.criteria.climb_load;
  for (const ClimbPlan& climb : scene.plans.climbs)
    if (limit && *limit > climb.load.most)
      MapReader(criteria, "criteria", diagnostics)
          .problem("climb_load",
                   fmt::format("{:g} N of a climb whose load ends at {:g} N", *limit, climb.load.most),
                   "at most the climb's load.max");
}

/// Collects the YAML files from which a tree's values come.
void collect_files(const YamlNode& node, std::set<std::filesystem::path>& out) {
  if (node.file) out.insert(*node.file);
  for (const YamlNode& item : node.items) collect_files(item, out);
  for (const YamlEntry& entry : node.entries) collect_files(entry.value, out);
}

}  // namespace

Scene compile_scene(YamlNode root) {
  Diagnostics diagnostics;
  SceneSpec spec = read_scene(root, task_kinds(), diagnostics);
  diagnostics.throw_if_any();
  Scene scene = compile_scene(std::move(spec), std::move(root));
  scene.warnings.insert(scene.warnings.begin(), diagnostics.warnings.begin(), diagnostics.warnings.end());
  return scene;
}

Scene compile_scene(SceneSpec spec, YamlNode root) {
  Diagnostics diagnostics;
  Scene scene;
  scene.spec = std::move(spec);
  scene.hands = build_hands(scene.spec.hands);
  scene.plans = make_plans(scene.spec, scene.hands, diagnostics);
  if (YamlNode* criteria = root.find("criteria")) check_climb_load(*criteria, scene, diagnostics);
  diagnostics.throw_if_any();
  scene.model = build_model(scene.spec, scene.hands, scene.plans);
  if (scene.plans.control) {
    scene.control = plan_control(scene, *scene.plans.control, diagnostics);
    diagnostics.throw_if_any();
    check_tracked(root, *scene.control, diagnostics);
    diagnostics.throw_if_any();
    diagnostics.warnings.insert(diagnostics.warnings.end(), scene.control->warnings.begin(),
                                scene.control->warnings.end());
  }
  scene.muscles = plan_muscles(scene, diagnostics);
  diagnostics.throw_if_any();
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
  out.model = build_model(out.spec, out.hands, out.plans);
  out.control.reset();
  if (!effects.has(model::Effect::muscles)) out.muscles.reset();
  if (!effects.has(model::Effect::actuation)) out.plans.control.reset();
  if (!out.plans.control) return out;
  Diagnostics diagnostics;
  out.control = plan_control(out, *out.plans.control, diagnostics);
  diagnostics.throw_if_any();
  return out;
}

Scene load_scene(YamlNode root, const std::vector<std::string>& overrides, Diagnostics diagnostics) {
  for (const std::string& assignment : overrides) {
    try {
      apply_override(root, assignment, diagnostics.budget);
    } catch (const Error& error) {
      diagnostics.add(error);
    }
  }
  diagnostics.throw_if_any();
  Scene scene = compile_scene(std::move(root));
  for (const Overruled& each : overruled(scene))
    scene.warnings.push_back(fmt::format("--set {}: {}", each.path, each.text()));
  return scene;
}

Scene load_scene(const std::filesystem::path& path, const std::vector<std::string>& overrides) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  return load_scene(std::move(root), overrides, std::move(diagnostics));
}

std::vector<std::filesystem::path> files_read(const Scene& scene) {
  std::set<std::filesystem::path> out;
  collect_files(scene.resolved, out);
  for (const InputFile& input : scene.inputs) out.insert(input.path);
  return {out.begin(), out.end()};
}

}  // namespace handsim::scene
