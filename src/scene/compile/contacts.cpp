// The `contacts` of a scene: named materials, and the rules of who meets whom; and what they make of the
// model.
#include "handsim/scene/compile/contacts.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/hand/material.h"
#include "handsim/scene/read/readers.h"

namespace handsim::scene {

namespace {

using model::Effect;
using model::Effects;

/// Where a contact group comes from, which tells the effect that a pair belongs to.
enum class Origin { hand, object, ground, mechanism };

/// The names that rules may use, each with the model's groups it stands for.
struct GroupNames {
  std::vector<Origin> origins;  ///< of each group of the model
  std::map<std::string, std::vector<int>> groups;
};

bool names_object(const ContactsSpec& contacts, const std::string& object) {
  if (!contacts.rules) return false;
  return std::any_of(contacts.rules->begin(), contacts.rules->end(), [&](const ContactRuleSpec& rule) {
    return rule.between[0] == object || rule.between[1] == object;
  });
}

/// The groups in the order in which compile_scene makes them: of each hand palm, fingers, fingertips; the
/// objects, those with rules of their own last; the ground; the mechanism.
GroupNames group_names(const SceneSpec& scene) {
  GroupNames names;
  const auto add = [&](Origin origin, const std::vector<std::string>& called) {
    for (const std::string& name : called)
      names.groups[name].push_back(static_cast<int>(names.origins.size()));
    names.origins.push_back(origin);
  };
  for (const HandEntry& hand : scene.hands) {
    const std::string& of = hand.placement.name;
    add(Origin::hand, {"hands", "hand-" + of, "palm", "palm-" + of});
    add(Origin::hand, {"hands", "hand-" + of, "fingers", "fingers-" + of});
    add(Origin::hand, {"hands", "hand-" + of, "fingers", "fingers-" + of, "fingertips", "fingertips-" + of});
  }
  if (!scene.objects.empty()) add(Origin::object, {"objects"});
  for (const ObjectSpec& object : scene.objects)
    if (names_object(scene.contacts, object.name)) add(Origin::object, {"objects", object.name});
  if (scene.ground) add(Origin::ground, {"ground"});
  if (!scene.mechanism.bodies.empty()) add(Origin::mechanism, {"mechanism"});
  return names;
}

/// The effect that lets two groups meet; nothing for parts of the mechanism among each other.
std::optional<Effect> effect_of(Origin a, Origin b) {
  if (a == Origin::ground && b == Origin::ground) return std::nullopt;
  if (a == Origin::ground || b == Origin::ground) return Effect::ground_contact;
  if (a == Origin::hand && b == Origin::hand) return Effect::self_contact;
  if (a == Origin::object || b == Origin::object) return Effect::object_contact;
  return std::nullopt;
}

std::string read_between(const YamlNode& item, const std::string& path, Diagnostics& diagnostics) {
  if (item.kind == YamlNode::Kind::scalar && !item.text.empty()) return item.text;
  diagnostics.problems.push_back({item.place(), path, item.described(), "the name of a contact group"});
  return {};
}

ContactRuleSpec read_rule(MapReader reader, const std::vector<model::Material>& materials) {
  ContactRuleSpec rule;
  rule.place = reader.node().place();
  if (const YamlNode* between = reader.list("between", true)) {
    if (between->items.size() != 2)
      reader.problem("between", between->described(), "two names of contact groups");
    else
      for (std::size_t i = 0; i < 2; ++i)
        rule.between[i] =
            read_between(between->items[i], item_path(reader.path_of("between"), i), reader.diagnostics());
  }
  if (reader.has("material") && named_material(reader, "material", materials))
    rule.material = reader.text("material");
  reader.finish();
  return rule;
}

bool has_key(const YamlNode& entry, const std::string& key) { return entry.find(key) != nullptr; }

template <class Visit>
void for_each_pair(const GroupNames& names, const ContactRuleSpec& rule, const Visit& visit) {
  const auto first = names.groups.find(rule.between[0]);
  const auto second = names.groups.find(rule.between[1]);
  if (first == names.groups.end() || second == names.groups.end()) return;
  for (const int a : first->second)
    for (const int b : second->second)
      visit(
          a, b,
          effect_of(names.origins[static_cast<std::size_t>(a)], names.origins[static_cast<std::size_t>(b)]));
}

model::Material read_sourced_material(MapReader& reader, const std::string& name) {
  for (const char* words : {"title", "source"}) reader.maybe_text(words);
  model::Material material = hand::read_material(reader, name);
  reader.finish();
  return material;
}

}  // namespace

bool inline_file(YamlNode& entry, const std::string& path, FileKind kind,
                 bool (*overridden)(const YamlNode& entry, const std::string& key),
                 Diagnostics& diagnostics) {
  YamlNode* file = entry.find("file");
  if (!file) return true;
  const std::string key = path + ".file";
  try {
    follow_reference(*file, key, diagnostics.budget);
  } catch (const Error& error) {
    diagnostics.take(error);
    return false;
  }
  if (!is_of_kind(*file, key, kind, diagnostics)) return false;
  YamlNode content = std::move(*file);
  entry.entries.remove_if([](const YamlEntry& of) { return of.key == "file"; });
  const YamlNode own = entry;
  for (YamlEntry& of : content.entries)
    if (!overridden(own, of.key)) entry.entries.push_back(std::move(of));
  return true;
}

model::Material read_material_file(YamlNode& root, Diagnostics& diagnostics) {
  if (!is_of_kind(root, "", FileKind::material, diagnostics)) return {};
  MapReader reader(root, "", diagnostics);
  return read_sourced_material(reader, "material");
}

std::optional<model::Material> named_material(MapReader& reader, std::string_view key,
                                              const std::vector<model::Material>& materials) {
  const std::string name = reader.text(key);
  std::vector<std::string> known;
  for (const model::Material& material : materials) {
    if (material.name == name) return material;
    known.push_back(material.name);
  }
  const auto near = nearest_word(name, known);
  reader.problem(key, name,
                 known.empty() ? "a material of contacts.materials, which has none"
                               : fmt::format("one of {}{}", fmt::join(known, ", "),
                                             near ? " (nearest: " + *near + ")" : ""));
  return std::nullopt;
}

ContactsSpec read_contacts(MapReader& scene) {
  ContactsSpec spec;
  if (!scene.has("contacts")) return spec;
  MapReader reader = scene.map("contacts");
  if (YamlNode* list = reader.list("materials", false))
    for (std::size_t i = 0; i < list->items.size(); ++i) {
      const std::string path = item_path(reader.path_of("materials"), i);
      if (!inline_file(list->items[i], path, FileKind::material, has_key, reader.diagnostics())) continue;
      MapReader item(list->items[i], path, reader.diagnostics());
      if (item.has("file"))
        item.problem("file", "a file that names another", "a file with the material itself");
      const std::string name = item.name("name");
      for (const model::Material& other : spec.materials)
        if (!name.empty() && other.name == name)
          item.problem("name", name + " a second time", "a name of its own for each material");
      spec.materials.push_back(read_sourced_material(item, name));
    }
  if (YamlNode* list = reader.list("rules", false)) {
    spec.rules.emplace();
    for (std::size_t i = 0; i < list->items.size(); ++i)
      spec.rules->push_back(
          read_rule(MapReader(list->items[i], item_path(reader.path_of("rules"), i), reader.diagnostics()),
                    spec.materials));
  }
  reader.finish();
  return spec;
}

/// Pairs of groups that rules let meet.
constexpr std::size_t kMostPairs = 10'000'000;

void check_contact_groups(const SceneSpec& scene, Diagnostics& diagnostics) {
  if (!scene.contacts.rules) return;
  const GroupNames names = group_names(scene);
  std::size_t pairs = 0;
  std::vector<std::string> known;
  for (const auto& [name, groups] : names.groups) known.push_back(name);
  for (std::size_t i = 0; i < scene.contacts.rules->size(); ++i) {
    const ContactRuleSpec& rule = (*scene.contacts.rules)[i];
    const std::string path = item_path("contacts.rules", i) + ".between";
    bool both = true;
    for (const std::string& name : rule.between) {
      if (names.groups.contains(name)) continue;
      both = false;
      const auto near = nearest_word(name, known);
      diagnostics.problems.push_back({rule.place, path, name,
                                      fmt::format("one of {}, or an object's name{}", fmt::join(known, ", "),
                                                  near ? " (nearest: " + *near + ")" : "")});
    }
    const auto count = [&](const std::string& name) {
      return names.groups.contains(name) ? names.groups.at(name).size() : 0;
    };
    pairs += count(rule.between[0]) * count(rule.between[1]);
    if (pairs > kMostPairs) {
      diagnostics.problems.push_back({rule.place, path,
                                      fmt::format("rules for more than {} pairs", kMostPairs),
                                      "fewer rules, or fewer objects named in them"});
      return;
    }
    bool meets = false;
    for_each_pair(names, rule, [&](int, int, std::optional<Effect> effect) { meets = meets || effect; });
    if (both && !meets)
      diagnostics.problems.push_back({rule.place, path, rule.between[0] + " and " + rule.between[1],
                                      "two groups that can meet: not ground and ground, not mechanism and "
                                      "mechanism"});
  }
}

Effects effects_of_rules(const SceneSpec& scene) {
  Effects effects;
  if (!scene.contacts.rules) return effects;
  const GroupNames names = group_names(scene);
  for (const ContactRuleSpec& rule : *scene.contacts.rules)
    for_each_pair(names, rule, [&](int, int, std::optional<Effect> effect) {
      if (effect) effects.add(*effect);
    });
  return effects;
}

int object_group(const SceneSpec& scene, const ObjectSpec& object) {
  const GroupNames names = group_names(scene);
  return names.groups.at(names_object(scene.contacts, object.name) ? object.name : "objects").front();
}

void add_contact_rules(model::Model& model, const SceneSpec& scene) {
  const Effects& effects = scene.solver.effects;
  const GroupNames names = group_names(scene);
  const auto add = [&](int a, int b, std::optional<Effect> effect, int material) {
    if (effect && effects.has(*effect)) model.contact_rules.push_back({a, b, material});
  };
  if (scene.contacts.rules) {
    for (const ContactRuleSpec& rule : *scene.contacts.rules) {
      int material = model::kCombined;
      for (const model::Material& named : scene.contacts.materials)
        if (rule.material == named.name) {
          material = static_cast<int>(model.materials.size());
          model.materials.push_back(named);
        }
      for_each_pair(names, rule,
                    [&](int a, int b, std::optional<Effect> effect) { add(a, b, effect, material); });
    }
    return;
  }
  const int count = static_cast<int>(names.origins.size());
  for (int a = 0; a < count; ++a)
    for (int b = a; b < count; ++b)
      add(a, b,
          effect_of(names.origins[static_cast<std::size_t>(a)], names.origins[static_cast<std::size_t>(b)]),
          model::kCombined);
}

}  // namespace handsim::scene
