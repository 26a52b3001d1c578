// The contact groups of a scene by the names that rules use, and the effects that their contacts need.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "handsim/scene/read/scene_file.h"

namespace handsim::scene {

struct ContactGroups {
  /// What a group belongs to. The owners of a pair decide which effect it needs.
  enum class Owner { hand, object, ground, mechanism };
  struct Group {
    int number;  ///< in Model::groups
    Owner owner;
  };

  std::vector<Group> all;
  std::map<std::string, std::vector<Group>> by_name;

  void add(Group group, const std::vector<std::string>& names);
  void add_hand(const std::string& hand, const hand::HandGroups& groups);
};

/// The effect of contact of two groups; nothing for ground with ground and two parts of the mechanism.
std::optional<model::Effect> effect_of(const ContactGroups::Group& a, const ContactGroups::Group& b);

/// Calls visit(a, b) for each pair of groups that a rule names.
template <class Visit>
void for_each_pair(const ContactGroups& groups, const ContactRuleSpec& rule, const Visit& visit) {
  const auto first = groups.by_name.find(rule.between[0]);
  const auto second = groups.by_name.find(rule.between[1]);
  if (first == groups.by_name.end() || second == groups.by_name.end()) return;
  for (const ContactGroups::Group& a : first->second)
    for (const ContactGroups::Group& b : second->second) visit(a, b);
}

/// True if a rule names the object; its shapes are then a group of their own.
bool names_object(const ContactsSpec& contacts, const std::string& object);

/// Problems: rules with unknown names, or with groups that never touch.
void check_contact_groups(const SceneSpec& scene, Diagnostics& diagnostics);

/// The effects that the rules of the contacts block need.
model::Effects effects_of_rules(const SceneSpec& scene);

}  // namespace handsim::scene
