#include "handsim/scene/compile/scene.h"

#include <algorithm>
#include <array>
#include <set>

#include <fmt/format.h>

#include "handsim/core/text.h"
#include "handsim/scene/build/model_parts.h"
#include "handsim/scene/compile/idle_tables.h"
#include "handsim/scene/compile/overruled.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

namespace {

/// Problems: joints that start beyond their stops. ODE would correct a share of the angle, erp = 0.2, in the
/// first step: 1 rad at 1 ms gives 200 rad/s. Up to 1e-3 is rounding in the file.
std::vector<Problem> start_defects(const model::Model& model, const model::Effects& effects,
                                   const model::Origins& origins) {
  constexpr double kRounding = 1e-3;
  std::vector<Problem> problems;
  if (!effects.has(model::Effect::joint_stops)) return problems;
  for (std::size_t i = 0; i < model.joints.size(); ++i)
    for (std::size_t a = 0; a < model.joints[i].axes.size(); ++a) {
      const model::Joint& joint = model.joints[i];
      const model::JointAxis& axis = joint.axes[a];
      if (!axis.stop) continue;
      if (axis.initial >= axis.stop->low - kRounding && axis.initial <= axis.stop->high + kRounding) continue;
      const char* unit = joint.unit(a);
      problems.push_back(
          {origins.joints[i], joint.name + "." + axis.name,
           fmt::format("a start at {:.4g} {}", axis.initial, unit),
           fmt::format("{:.4g} to {:.4g} {}, within its stops", axis.stop->low, axis.stop->high, unit)});
    }
  return problems;
}

/// Adds problems of a hand, which have keys of its own files, with the path of this hand in the scene.
void add_hand_problems(const Error& error, std::size_t i, const HandEntry& hand, Diagnostics& diagnostics) {
  for (Problem problem : error.problems()) {
    if (!problem.place) problem.place = hand.place;
    problem.key = fmt::format("hands.{}.{}", i, problem.key);
    diagnostics.problems.push_back(std::move(problem));
  }
}

bool same_hand(const HandEntry& a, const HandEntry& b) {
  return a.model == b.model && hand::same_body(a.person, b.person);
}

/// Adds the parts one after the other, and records their contact groups and places in the file.
class Builder {
 public:
  Builder(const SceneSpec& scene, const Plans& plans)
      : scene_(scene), plans_(plans), effects_(scene.solver.effects), model_(model::make_model()) {
    model_.gravity = scene.gravity;
    origins_.add(model_, std::nullopt);
  }

  model::Model build(const std::vector<hand::BuiltHand>& hands) {
    add_hands(hands);
    keep_tendons_in_effect();
    if (!plans_.objects.empty()) add_objects();
    if (scene_.ground) groups_.add({add_ground(model_, *scene_.ground), Owner::ground}, {"ground"});
    origins_.add(model_, std::nullopt);
    if (!scene_.mechanism.bodies.empty()) add_mechanism();
    diagnostics_.throw_if_any();
    add_contact_rules(model_, scene_.contacts, groups_, effects_, &origins_);
    diagnostics_.problems = model::defects(model_, origins_);
    if (diagnostics_.problems.empty()) diagnostics_.problems = start_defects(model_, effects_, origins_);
    diagnostics_.throw_if_any();
    return std::move(model_);
  }

 private:
  using Owner = ContactGroups::Owner;

  void add_hands(const std::vector<hand::BuiltHand>& hands) {
    for (std::size_t i = 0; i < hands.size(); ++i) {
      const hand::Placement& placement = plans_.hands[i];
      try {
        groups_.add_hand(placement.name, hand::add_hand(model_, hands[i], placement));
      } catch (const Error& error) {
        add_hand_problems(error, i, scene_.hands[i], diagnostics_);
      }
      origins_.add(model_, scene_.hands[i].place);
    }
  }

  /// A model has only the muscles and bands that its scene asks for: its state has their activations.
  void keep_tendons_in_effect() {
    if (!effects_.has(model::Effect::muscles)) {
      model_.muscles.clear();
      for (model::HandIndex& hand : model_.hands) hand.muscles.clear();
    }
    if (effects_.has(model::Effect::tendon_coupling)) return;
    model_.bands.clear();
    for (model::HandIndex& hand : model_.hands) hand.bands.clear();
  }

  void add_objects() {
    const int all = model_.add_group("objects");
    groups_.add({all, Owner::object}, {"objects"});
    for (const ObjectSpec& object : plans_.objects) {
      int group = all;
      if (names_object(scene_.contacts, object.name)) {
        group = model_.add_group(object.name);
        groups_.add({group, Owner::object}, {"objects", object.name});
      }
      add_object(model_, object, group);
      origins_.add(model_, object.place);
    }
  }

  void add_mechanism() {
    const int touching = model_.add_group("mechanism"), drawn = model_.add_group("drawn");
    groups_.add({touching, Owner::mechanism}, {"mechanism"});
    for (const BodySpec& body : scene_.mechanism.bodies) {
      add_body(model_, body, body.collides ? touching : drawn);
      origins_.add(model_, body.place);
    }
    for (const MechanismJointSpec& joint : scene_.mechanism.joints) {
      add_joint(model_, joint);
      origins_.add(model_, joint.place);
    }
  }

  const SceneSpec& scene_;
  const Plans& plans_;
  const model::Effects& effects_;
  model::Model model_;
  model::Origins origins_;
  ContactGroups groups_;
  Diagnostics diagnostics_;
};

/// @throws Error (input) if a person and a hand model do not give a valid hand.
std::vector<hand::BuiltHand> build_hands(const std::vector<HandEntry>& hands) {
  Diagnostics diagnostics;
  std::vector<hand::BuiltHand> out(hands.size());
  for (std::size_t i = 0; i < hands.size(); ++i) try {
      // The two hands of a person are built once.
      std::size_t same = 0;
      while (same < i && (out[same].bodies.empty() || !same_hand(hands[same], hands[i]))) ++same;
      out[i] = same < i ? out[same] : hand::build_hand(*hands[i].model, hands[i].person);
    } catch (const Error& error) {
      add_hand_problems(error, i, hands[i], diagnostics);
    }
  diagnostics.throw_if_any();
  return out;
}

/// @throws Error (input) with all defects of the model, each with the place of its part in the file.
model::Model build_model(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands,
                         const Plans& plans) {
  return Builder(scene, plans).build(hands);
}

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

void check_climb_load(const YamlNode& criteria, const Scene& scene, Diagnostics& diagnostics) {
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
  Scene scene = compile_scene(std::move(spec), diagnostics.resolution.applied(std::move(root)));
  scene.warnings.insert(scene.warnings.begin(), diagnostics.warnings.begin(), diagnostics.warnings.end());
  return scene;
}

Scene compile_scene(SceneSpec spec, YamlNode root) {
  Diagnostics diagnostics;
  Scene scene;
  scene.spec = std::move(spec);
  scene.hands = build_hands(scene.spec.hands);
  scene.plans = make_plans(scene.spec, scene.hands, diagnostics);
  if (const YamlNode* criteria = root.find("criteria")) check_climb_load(*criteria, scene, diagnostics);
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
  warn_of_idle_tables(scene, diagnostics);
  scene.resolved = std::move(root);
  scene.inputs = collect_inputs(scene.spec.files);
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

namespace {

/// Adds to the title what `--set` has put in the place of the scene's objects, unless it sets the title, too.
void retitle(YamlNode& root, const std::vector<std::string>& overrides) {
  YamlNode* title = root.find("title");
  const auto sets_title = [](const std::string& assignment) { return assignment.starts_with("title="); };
  if (!title || title->kind != YamlNode::Kind::scalar || std::ranges::any_of(overrides, sets_title)) return;
  for (const std::string& assignment : overrides) {
    const std::string path = assignment.substr(0, assignment.find('='));
    const std::string last = path.substr(path.rfind('.') + 1);
    const bool form = std::ranges::any_of(std::array{"file", "shape", "parts", "mesh"},
                                          [&](const char* key) { return last == key; });
    const bool whole = last.find_first_not_of("0123456789") == std::string::npos || path == "objects";
    if (path.starts_with("objects") && (form || whole)) title->text += " with " + printable(assignment);
  }
}

}  // namespace

Scene load_scene(YamlNode root, const std::vector<std::string>& overrides, Diagnostics diagnostics) {
  for (const std::string& assignment : overrides) {
    try {
      apply_override(root, assignment, diagnostics.budget);
    } catch (const Error& error) {
      diagnostics.add(error);
    }
  }
  diagnostics.throw_if_any();
  retitle(root, overrides);
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
  for (const ReferencedFile& input : scene.inputs) out.insert(input.path);
  return {out.begin(), out.end()};
}

}  // namespace handsim::scene
