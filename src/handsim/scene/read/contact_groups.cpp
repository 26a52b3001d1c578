#include "handsim/scene/read/contact_groups.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

using Owner = ContactGroups::Owner;
using model::Effect;
using model::Effects;

constexpr std::size_t kMostPairs = 10'000'000;  ///< Largest number of pairs of groups in all rules.

/// The names and owners of the groups of the scene's model; their numbers are not known yet: 0.
ContactGroups groups_of(const SceneSpec& scene) {
  ContactGroups groups;
  for (const HandEntry& hand : scene.hands) groups.add_hand(hand.placement.name, {});
  if (!scene.objects.empty()) groups.add({0, Owner::object}, {"objects"});
  for (const std::string& object : scene.object_names())
    if (names_object(scene.contacts, object)) groups.add({0, Owner::object}, {"objects", object});
  if (scene.ground) groups.add({0, Owner::ground}, {"ground"});
  if (!scene.mechanism.bodies.empty()) groups.add({0, Owner::mechanism}, {"mechanism"});
  return groups;
}

}  // namespace

void ContactGroups::add(Group group, const std::vector<std::string>& names) {
  all.push_back(group);
  for (const std::string& name : names) by_name[name].push_back(group);
}

void ContactGroups::add_hand(const std::string& hand, const hand::HandGroups& groups) {
  add({groups.palm, Owner::hand}, {"hands", "hand-" + hand, "palm", "palm-" + hand});
  add({groups.fingers, Owner::hand}, {"hands", "hand-" + hand, "fingers", "fingers-" + hand});
  add({groups.fingertips, Owner::hand},
      {"hands", "hand-" + hand, "fingers", "fingers-" + hand, "fingertips", "fingertips-" + hand});
}

std::optional<Effect> effect_of(const ContactGroups::Group& a, const ContactGroups::Group& b) {
  const auto either = [&](Owner owner) { return a.owner == owner || b.owner == owner; };
  if (a.owner == Owner::ground && b.owner == Owner::ground) return std::nullopt;
  if (either(Owner::ground)) return Effect::ground_contact;
  if (a.owner == Owner::hand && b.owner == Owner::hand) return Effect::self_contact;
  if (either(Owner::object) || either(Owner::hand)) return Effect::object_contact;
  return std::nullopt;
}

bool names_object(const ContactsSpec& contacts, const std::string& object) {
  if (!contacts.rules) return false;
  return std::any_of(contacts.rules->begin(), contacts.rules->end(), [&](const ContactRuleSpec& rule) {
    return rule.between[0] == object || rule.between[1] == object;
  });
}

void check_contact_groups(const SceneSpec& scene, Diagnostics& diagnostics) {
  if (!scene.contacts.rules) return;
  const ContactGroups groups = groups_of(scene);
  std::size_t pairs = 0;
  std::vector<std::string> known;
  for (const auto& [name, some] : groups.by_name) known.push_back(name);
  for (std::size_t i = 0; i < scene.contacts.rules->size(); ++i) {
    const ContactRuleSpec& rule = (*scene.contacts.rules)[i];
    const std::string path = item_path("contacts.rules", i) + ".between";
    bool both = true;
    for (const std::string& name : rule.between) {
      if (groups.by_name.contains(name)) continue;
      both = false;
      diagnostics.problems.push_back({rule.place, path, name,
                                      fmt::format("one of {}, or an object's name{}", fmt::join(known, ", "),
                                                  nearest_hint(name, known))});
    }
    const auto count = [&](const std::string& name) {
      return groups.by_name.contains(name) ? groups.by_name.at(name).size() : 0;
    };
    pairs += count(rule.between[0]) * count(rule.between[1]);
    if (pairs > kMostPairs) {
      diagnostics.problems.push_back({rule.place, path,
                                      fmt::format("rules for more than {} pairs", kMostPairs),
                                      "fewer rules, or fewer objects named in them"});
      return;
    }
    bool touch = false;
    for_each_pair(groups, rule, [&](const auto& a, const auto& b) { touch = touch || effect_of(a, b); });
    if (both && !touch)
      diagnostics.problems.push_back({rule.place, path, rule.between[0] + " and " + rule.between[1],
                                      "two groups that can touch: not ground and ground, not mechanism and "
                                      "mechanism"});
  }
}

Effects effects_of_rules(const SceneSpec& scene) {
  Effects effects;
  if (!scene.contacts.rules) return effects;
  const ContactGroups groups = groups_of(scene);
  for (const ContactRuleSpec& rule : *scene.contacts.rules)
    for_each_pair(groups, rule, [&](const auto& a, const auto& b) {
      if (const auto effect = effect_of(a, b)) effects.add(*effect);
    });
  return effects;
}

}  // namespace handsim::scene
