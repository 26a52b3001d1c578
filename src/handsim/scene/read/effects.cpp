#include "handsim/scene/read/effects.h"

#include <algorithm>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/contact_groups.h"

namespace handsim::scene {

namespace {

using model::Effect;
using model::Effects;

/// True if something can be touched: an object, or beside a hand a body of a mechanism.
bool has_touched(const SceneSpec& scene) {
  return !scene.objects.empty() ||
         (!scene.hands.empty() && std::ranges::any_of(scene.mechanism.bodies, &BodySpec::collides));
}

/// The smallest set of effects for the scene's content; self contact only if a contact rule needs it.
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
    for (const hand::SegmentSpec& segment : hand.model->segments) add_joint(segment.joint);
    if (hand.model->forearm && hand.has_wrist_joint()) add_joint(hand.model->forearm->joint);
    if (hand.placement.mount == hand::Mount::driven) effects.add(Effect::wrist_motion);
  }
  for (const MechanismJointSpec& joint : scene.mechanism.joints)
    for (const model::JointAxis& axis : joint.axes) {
      if (axis.stop) effects.add(Effect::joint_stops);
      if (axis.torque != 0) effects.add(Effect::actuation);
    }
  if (scene.control) effects.add(Effect::actuation);
  if (scene.contacts.rules) {
    const Effects of_rules = effects_of_rules(scene);
    for (const Effect effect : {Effect::object_contact, Effect::self_contact, Effect::ground_contact})
      if (of_rules.has(effect)) effects.add(effect);
  } else {
    if (has_touched(scene)) effects.add(Effect::object_contact);
    if (scene.ground) effects.add(Effect::ground_contact);
  }
  if (effects.any_contact()) effects.add(Effect::friction);
  return effects;
}

YamlNode list_of_effects(const Effects& effects, const YamlNode& place) {
  YamlNode list = yaml_sequence();
  for (int i = 0; i < model::kEffectCount; ++i)
    if (effects.has(static_cast<Effect>(i)))
      list.items.push_back(yaml_scalar(std::string(model::kEffectNames[static_cast<std::size_t>(i)])));
  list.file = place.file;
  list.line = place.line;
  list.column = place.column;
  return list;
}

void read_effect(const YamlNode& item, const std::string& path, Effects& effects, Diagnostics& diagnostics) {
  const std::vector<std::string> known(model::kEffectNames.begin(), model::kEffectNames.end());
  const auto at = std::ranges::find(known, item.text);
  if (at == known.end()) {
    diagnostics.problems.push_back({item.place(), path, item.described(), need_word(item.text, known)});
    return;
  }
  const auto effect = static_cast<Effect>(at - known.begin());
  if (effects.has(effect))
    diagnostics.problems.push_back({item.place(), path, item.text + " a second time", "each effect once"});
  effects.add(effect);
}

template <class Predicate>
bool any_axis(const MechanismSpec& mechanism, Predicate predicate) {
  return std::ranges::any_of(mechanism.joints, [&](const MechanismJointSpec& joint) {
    return std::ranges::any_of(joint.axes, predicate);
  });
}

bool any_tissue(const SceneSpec& scene) {
  const auto has_tissue = [](const hand::JointSpec& joint) {
    return std::ranges::any_of(joint.axes, [](const auto& axis) { return axis.tissue.has_value(); });
  };
  for (const HandEntry& hand : scene.hands) {
    if (has_tissue(hand.model->wrist)) return true;
    if (hand.model->forearm && has_tissue(hand.model->forearm->joint)) return true;
    for (const hand::SegmentSpec& segment : hand.model->segments)
      if (has_tissue(segment.joint)) return true;
  }
  return false;
}

/// Problems: effects without anything to act on, and content whose effect is off.
void check_effects(MapReader& reader, const SceneSpec& scene, const Effects& effects) {
  bool driven = false;
  for (const HandEntry& hand : scene.hands) driven = driven || hand.placement.mount == hand::Mount::driven;
  const auto check = [&](bool bad, const char* got, const char* need) {
    if (bad) reader.problem("effects", got, need);
  };
  check(driven && !effects.has(Effect::wrist_motion), "a driven wrist without wrist_motion",
        "both or neither");
  check(!driven && effects.has(Effect::wrist_motion), "wrist_motion without a driven wrist",
        "both or neither");
  check(effects.has(Effect::ground_contact) && !scene.ground, "ground_contact without a ground",
        "both or neither");
  check(effects.has(Effect::object_contact) && !has_touched(scene), "object_contact without objects",
        "at least one object, or beside a hand a body that collides");
  check(effects.has(Effect::self_contact) && scene.hands.empty(), "self_contact without hands",
        "at least one hand");
  const bool stops = !scene.hands.empty() || any_axis(scene.mechanism, [](const model::JointAxis& axis) {
    return axis.stop.has_value();
  });
  check(effects.has(Effect::joint_stops) && !stops, "joint_stops without a stop",
        "a hand, or a joint with a range");
  check(effects.has(Effect::passive_tissue) && !any_tissue(scene), "passive_tissue without tissue",
        "a hand model whose joints have stiffness or damping");
  bool muscles = false, bands = false;
  for (const HandEntry& hand : scene.hands) {
    muscles = muscles || hand.model->muscles;
    bands = bands || (hand.model->muscles && !hand.model->muscles->bands.empty());
  }
  check(effects.has(Effect::muscles) && !muscles, "muscles without a hand that has some",
        "a hand model with a muscles block");
  check(effects.has(Effect::tendon_coupling) && !bands, "tendon_coupling without a hand that has bands",
        "a hand model with bands among its muscles");
  const bool driven_by_muscles = scene.excitations || (scene.control && scene.control->by_muscles);
  check(driven_by_muscles && !effects.has(Effect::muscles), "excitations or muscle control without muscles",
        "muscles among the effects");
  if (scene.contacts.rules) {
    const Effects of_rules = effects_of_rules(scene);
    for (const Effect effect : {Effect::object_contact, Effect::self_contact, Effect::ground_contact}) {
      const std::string name(model::name(effect));
      check(of_rules.has(effect) && !effects.has(effect), ("contact rules that need " + name).c_str(),
            (name + " among the effects, or no such rule").c_str());
      check(!of_rules.has(effect) && effects.has(effect),
            (name + " without a contact rule that needs it").c_str(),
            "a rule with groups that need it, or no rules");
    }
  }
  check(effects.has(Effect::friction) && !effects.any_contact(), "friction without contact",
        "one of object_contact, self_contact, ground_contact with it");
  const bool torque = any_axis(scene.mechanism, [](const auto& axis) { return axis.torque != 0; });
  check(torque && !effects.has(Effect::actuation), "a joint with a torque without actuation",
        "both or neither");
  check(scene.control && !effects.has(Effect::actuation), "a control block without actuation",
        "both or neither");
  check(!torque && !scene.control && effects.has(Effect::actuation),
        "actuation without a control block or a joint with a torque", "one of them, or no actuation");
}

}  // namespace

void check_engine(MapReader& reader, const engine::Settings& solver) {
  for (const Problem& problem : engine::missing_effects(solver, true))
    reader.problem(problem.key, problem.got, problem.need);
}

Effects read_effects(MapReader& reader, const SceneSpec& scene) {
  using Kind = YamlNode::Kind;
  ValueForm form{{Kind::sequence, Kind::scalar}, "auto or a list of effects", false, {"auto"}};
  form.words.insert(form.words.end(), model::kEffectNames.begin(), model::kEffectNames.end());
  const YamlNode* node = reader.value("effects", form);
  Effects effects;
  if (!node && reader.node().find("effects")) return effects;
  if (!node || node->text == "auto") {
    effects = needed_effects(scene);
    reader.resolve("effects", list_of_effects(effects, node ? *node : YamlNode()));
    return effects;
  }
  if (node->kind == Kind::scalar) {
    reader.problem("effects", node->described(), form.need);
    return effects;
  }
  for (std::size_t i = 0; i < node->items.size(); ++i)
    read_effect(node->items[i], item_path(reader.path_of("effects"), i), effects, reader.diagnostics());
  // With problems, some content was not read: the check would report its effects as unused.
  if (reader.sound()) check_effects(reader, scene, effects);
  return effects;
}

}  // namespace handsim::scene
