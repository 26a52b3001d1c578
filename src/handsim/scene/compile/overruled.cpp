#include "handsim/scene/compile/overruled.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace handsim::scene {

namespace {

using model::Effect;
using Path = std::vector<std::string>;

constexpr std::string_view kOrigin = "--set ";

template <class Words>
bool among(const std::string& word, const Words& words) {
  return std::ranges::find(words, word) != words.end();
}

/// Why a value acts on nothing, or in part of its contacts only.
struct Reason {
  std::string by;
  bool wholly = true;
};

/// Which materials act on contacts, and which contact rules overrule the others.
class Surfaces {
 public:
  explicit Surfaces(const Scene& scene) : scene_(scene), model_(scene.model) {
    std::map<std::pair<int, int>, std::optional<int>> pairs;
    for (const model::ContactRule& rule : model_.contact_rules)
      pairs[std::minmax(rule.group_a, rule.group_b)] = rule.material;
    std::map<int, std::vector<const model::Shape*>> groups;
    for (const model::Shape& shape : model_.shapes) groups[shape.group].push_back(&shape);
    for (const auto& [pair, material] : pairs)
      for (const model::Shape* a : groups[pair.first])
        for (const model::Shape* b : groups[pair.second])
          if (a->body != b->body) add(*a, *b, material);
  }

  std::optional<Reason> of_ground() const {
    for (const model::Shape& shape : model_.shapes)
      if (shape.part == model::Part::ground) return of(shape.material);
    return std::nullopt;
  }
  std::optional<Reason> of_object(std::size_t object) const {
    if (object >= model_.objects.size()) return std::nullopt;
    return of(model_.shapes[as_index(model_.objects[object].shapes.front())].material);
  }
  std::optional<Reason> of_hand(std::size_t hand) const {
    if (hand >= model_.hands.size()) return std::nullopt;
    for (const model::Shape& shape : model_.shapes)
      if (shape.body == model_.hands[hand].palm) return of(shape.material);
    return std::nullopt;
  }
  std::optional<Reason> of_material(const std::string& name) const {
    for (const int acting : acting_)
      if (model_.materials[as_index(acting)].name == name) return std::nullopt;
    return Reason{fmt::format("no contact has the material {}", name)};
  }

 private:
  /// The object of a task on the support that the task adds: over as soon as the hand lifts it.
  bool on_own_support(const std::string& a, const std::string& b) const {
    return std::ranges::any_of(scene_.spec.tasks, [&](const auto& task) {
      return task->support && ((*task->support == a && b.starts_with(task->object)) ||
                               (*task->support == b && a.starts_with(task->object)));
    });
  }
  void add(const model::Shape& a, const model::Shape& b, std::optional<int> material) {
    if (material) {
      acting_.insert(*material);
      for (const model::Shape* shape : {&a, &b}) winner_.emplace(shape->material, *material);
    } else if (!on_own_support(a.name, b.name)) {
      acting_.insert({a.material, b.material});
    }
  }
  std::optional<Reason> of(int material) const {
    const auto winner = winner_.find(material);
    const bool acts = acting_.contains(material);
    if (winner == winner_.end())
      return acts ? std::nullopt : std::optional(Reason{"no effect of contact acts on this surface"});
    const std::string& name = model_.materials[as_index(winner->second)].name;
    const auto& rules = *scene_.spec.contacts.rules;
    for (std::size_t i = rules.size(); i-- > 0;)
      if (rules[i].material == name)
        return Reason{fmt::format("contacts.rules.{} gives {} and {} the material {}", i, rules[i].between[0],
                                  rules[i].between[1], name),
                      !acts};
    return std::nullopt;
  }

  const Scene& scene_;
  const model::Model& model_;
  std::set<int> acting_;       ///< in Model::materials
  std::map<int, int> winner_;  ///< of a surface's material: the one of a rule
};

/// Judges single values of the resolved scene.
class Judge {
 public:
  explicit Judge(const Scene& scene) : scene_(scene) {}

  std::optional<Reason> of(const Path& path) {
    const std::string& top = path.front();
    if (top == "gravity") return off(Effect::gravity);
    if (top == "ground")
      return path.back() == "height" ? off(Effect::ground_contact)
                                     : surface(path.back(), [&] { return surfaces().of_ground(); });
    if (top == "objects" && path.size() == 3)
      return surface(path.back(), [&] { return surfaces().of_object(std::stoul(path[1])); });
    if (top == "contacts") return contacts(path);
    if (top == "hands" && path.size() > 2) return hand(path);
    if (top == "joints" && (path.back() == "range" || path.back() == "bounce"))
      return off(Effect::joint_stops);
    if (top == "solver" && path.size() == 2) return solver(path.back());
    if (top == "control" && path.size() > 2) return controller(path);
    return std::nullopt;
  }

 private:
  std::optional<Reason> off(Effect effect) const {
    if (scene_.spec.solver.effects.has(effect)) return std::nullopt;
    return Reason{fmt::format("the effect {} is not among effects", model::name(effect))};
  }
  static std::optional<Reason> unless(bool acts, std::string by) {
    return acts ? std::nullopt : std::optional(Reason{std::move(by)});
  }
  const Surfaces& surfaces() {
    if (!surfaces_) surfaces_.emplace(scene_);
    return *surfaces_;
  }
  /// Judges a key of a surface. @param of the surface's own reason
  template <class Of>
  std::optional<Reason> surface(const std::string& key, const Of& of) const {
    std::optional<Reason> out;
    if (key == "material") out = of();
    model::Material::fields([&](std::string_view each, auto, auto, auto, auto... effect) {
      if (each != key) return;
      ((out = off(effect)), ...);
      if (!out) out = of();
    });
    return out;
  }
  std::optional<Reason> contacts(const Path& path) {
    if (path.size() < 4) return std::nullopt;
    if (path[1] == "rules") return later_rule(std::stoul(path[2]));
    return surface(path[3], [&] {
      return surfaces().of_material(scene_.spec.contacts.materials[std::stoul(path[2])].name);
    });
  }
  std::optional<Reason> later_rule(std::size_t i) const {
    const auto& rules = *scene_.spec.contacts.rules;
    for (std::size_t j = rules.size(); j-- > i + 1;)
      if (std::is_permutation(rules[i].between.begin(), rules[i].between.end(), rules[j].between.begin()))
        return Reason{fmt::format("contacts.rules.{} is for the same two groups", j)};
    return std::nullopt;
  }
  std::optional<Reason> hand(const Path& path) {
    const bool of_model = path[2] == "model" && path.size() > 4;
    if (path[2] == "tissue" || (of_model && path.size() > 7 && has_field<model::Tissue>(path.back())))
      return off(Effect::passive_tissue);
    if (path[2] == "tendon_strain" || path[2] == "short_range_stiffness") return off(Effect::muscles);
    if (path[2] == "person" && path.size() == 4 && among(path[3], kStrengthKeys))
      return unless(uses_strength(), "no grip and no climb of the scene uses the person's strength");
    if (!of_model) return std::nullopt;
    if (path[3] == "muscles") return off(path[4] == "bands" ? Effect::tendon_coupling : Effect::muscles);
    if (path[3] == "skin")
      return surface(path.back(), [&] { return surfaces().of_hand(std::stoul(path[1])); });
    if (path.size() > 7 && (path.back() == "range" || has_field<model::Stop>(path.back())))
      return off(Effect::joint_stops);
    return std::nullopt;
  }
  bool uses_strength() const {
    return !scene_.plans.climbs.empty() ||
           std::ranges::any_of(scene_.plans.grasps,
                               [](const GraspPlan& grasp) { return grasp.strength.has_value(); });
  }
  std::optional<Reason> solver(const std::string& key) const {
    const engine::Settings& solver = scene_.spec.solver;
    if (key == "speculative" && !solver.effects.any_contact())
      return Reason{"no effect of contact is among effects"};
    return unless(uses(solver, key), fmt::format("method {} does not use it", engine::name(solver.method())));
  }
  /// A row of gains that a later row for the same joints, or for all, replaces.
  std::optional<Reason> controller(const Path& path) const {
    if (path[2] == "grip_strength")
      return unless(uses_strength(), "no grip and no climb of the scene uses the person's strength");
    if (path.size() < 5 || path[2] != "gains" || !has_field<control::AxisGains>(path[4])) return std::nullopt;
    const auto& rows = scene_.resolved.find("control")->find("controller")->find("gains")->items;
    const std::size_t i = std::stoul(path[3]);
    const std::string joints = emit_yaml(*rows[i].find("joints"));
    for (std::size_t j = i + 1; j < rows.size(); ++j) {
      const std::string others = emit_yaml(*rows[j].find("joints"));
      if (rows[j].find(path[4]) && (others == joints || others == "all\n"))
        return Reason{fmt::format("control.controller.gains.{} is for the same joints", j)};
    }
    return std::nullopt;
  }

  static constexpr std::array kStrengthKeys = {"grip_strength", "age"};

  const Scene& scene_;
  std::optional<Surfaces> surfaces_;  ///< made when a surface is judged
};

std::string joined(const Path& path) { return fmt::format("{}", fmt::join(path, ".")); }

/// Collects the verdicts of the values of each override; in one whose values all have a reason it has none.
class Walk {
 public:
  explicit Walk(const Scene& scene) : judge_(scene) { visit(scene.resolved); }

  std::vector<Overruled> result() const {
    std::vector<Overruled> out;
    for (const std::string& path : order_)
      if (const std::optional<Reason>& reason = reasons_.at(path))
        out.push_back({path, reason->by, reason->wholly});
    return out;
  }

 private:
  void visit(const YamlNode& node) {
    if (node.kind == YamlNode::Kind::map)
      for (const YamlEntry& entry : node.entries) within(entry.key, entry.value);
    else if (node.kind == YamlNode::Kind::sequence && has_maps(node))
      for (std::size_t i = 0; i < node.items.size(); ++i) within(std::to_string(i), node.items[i]);
    else
      judge(node);
    if (node.kind == YamlNode::Kind::sequence && !has_maps(node))
      for (const YamlNode& item : node.items) judge(item);
  }
  void within(const std::string& key, const YamlNode& node) {
    path_.push_back(key);
    visit(node);
    path_.pop_back();
  }
  static bool has_maps(const YamlNode& list) {
    return std::ranges::any_of(list.items,
                               [](const YamlNode& item) { return item.kind == YamlNode::Kind::map; });
  }
  void judge(const YamlNode& node) {
    if (!node.file || !node.file->starts_with(kOrigin)) return;
    std::string of = node.file->substr(kOrigin.size());
    const std::string here = joined(path_);
    // Defaults in a map that the override has made are beside its own value.
    if (!(here + ".").starts_with(of + ".") && !(of + ".").starts_with(here + ".")) return;
    const auto reason = judge_.of(path_);
    const auto [found, fresh] = reasons_.emplace(of, reason);
    if (fresh)
      order_.push_back(std::move(of));
    else if (!reason)
      found->second.reset();
  }

  Judge judge_;
  Path path_;
  std::map<std::string, std::optional<Reason>> reasons_;
  std::vector<std::string> order_;
};

}  // namespace

std::string Overruled::text() const {
  return wholly ? "has no effect: " + by : "acts on other contacts only: " + by;
}

std::optional<std::string> idle_because(const Scene& scene, const std::string& path) {
  Path parts(1);
  for (const char c : path)
    if (c == '.')
      parts.emplace_back();
    else
      parts.back() += c;
  const auto reason = Judge(scene).of(parts);
  return reason && reason->wholly ? std::optional(reason->by) : std::nullopt;
}

std::vector<Overruled> overruled(const Scene& scene) { return Walk(scene).result(); }

}  // namespace handsim::scene
