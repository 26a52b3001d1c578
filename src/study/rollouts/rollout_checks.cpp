// Before the first rollout: keys of the study that lead nowhere, replace one another or act on nothing.
#include <algorithm>

#include <fmt/format.h>

#include "handsim/study/rollouts/rollout_study.h"

namespace handsim::study {

namespace {

constexpr const char* kActs = "a key that acts in this scene";

/// The path is the other one or below it.
bool within(const std::string& path, const std::string& other) {
  return (path + ".").starts_with(other + ".");
}

/// What is drawn for a key has a value at a path below it.
bool has_value(const BoundKey& bound, const std::string& part) {
  const VariedKey& key = bound.key;
  if (key.from == VariedKey::From::population)
    return part == "stature" || part == "mass" || part == "sex" || part == "title";
  if (key.levels.empty()) return true;
  return std::any_of(key.levels.begin(), key.levels.end(), [&](const Level& level) {
    const YamlNode node = parse_yaml(level.yaml, "level");
    return node.kind == YamlNode::Kind::sequence || node.find(part);
  });
}

/// A later value at this path takes the place of what is drawn for a key.
bool replaces(const std::string& path, const BoundKey& drawn) {
  return std::any_of(drawn.paths.begin(), drawn.paths.end(), [&](const std::string& earlier) {
    if (within(earlier, path)) return true;
    if (!within(path, earlier)) return false;
    const std::string rest = path.substr(earlier.size() + 1);
    return has_value(drawn, rest.substr(0, rest.find('.')));
  });
}

}  // namespace

/// A problem of `set` belongs to its place in the study; one of the command line keeps its own.
/// @param path of the override that has the problem; empty: the problem's place names it.
void RolloutStudy::add_at_set(const Error& error, const std::string& path, Diagnostics& diagnostics) const {
  const YamlNode* set = spec_.resolved.find("set");
  for (Problem problem : error.problems()) {
    for (const YamlEntry& entry : set ? set->entries : decltype(set->entries)()) {
      if (entry.key != path && !(problem.place && problem.place->file == "--set " + entry.key)) continue;
      if (problem.place && problem.key != entry.key) problem.got = problem.key + ": " + problem.got;
      problem.place = Place{set->place().file, entry.line, entry.column};
      problem.key = "set." + entry.key;
    }
    diagnostics.problems.push_back(std::move(problem));
  }
}

/// Problems: keys that lead nowhere, and keys that replace what another one gives.
void RolloutStudy::check_paths(Diagnostics& diagnostics) const {
  YamlNode root = root_;
  YamlBudget budget;
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    const VariedKey& key = keys_[k].key;
    const auto problem = [&](std::string got, std::string need) {
      diagnostics.problems.push_back({key.place, "vary." + key.key, std::move(got), std::move(need)});
    };
    for (const std::string& path : keys_[k].paths) {
      try {
        apply_override(root, path + "=" + probes(keys_[k]).front(), budget);
      } catch (const Error& error) {
        for (const Problem& each : error.problems()) problem(each.got, each.need);
      }
      for (std::size_t j = 0; j < k; ++j)
        if (replaces(path, keys_[j])) {
          problem("a part or the whole of what vary." + keys_[j].key.key + " draws", "one of the two");
          break;
        }
      for (const std::string& assignment : spec_.set)
        if (within(key_of(assignment), path) && (key.from != VariedKey::From::normal || key.mean))
          add_at_set(input_error("--set " + key_of(assignment), "a value that vary." + key.key + " replaces",
                                 "one of the two"),
                     key_of(assignment), diagnostics);
    }
  }
}

/// Keeps what is overruled in all samples.
void RolloutStudy::note_overruled(const scene::Scene& scene) {
  std::vector<scene::Overruled> found = scene::overruled(scene);
  if (overruled_)
    std::erase_if(found, [&](const scene::Overruled& each) {
      return std::none_of(overruled_->begin(), overruled_->end(),
                          [&](const scene::Overruled& known) { return known.path == each.path; });
    });
  overruled_ = std::move(found);
}

/// Problems: keys whose values change nothing. Those that change less than they say are warnings.
std::vector<Problem> RolloutStudy::idle_keys() {
  Diagnostics diagnostics;
  const auto idle = [&](const std::string& path) {
    return std::any_of(overruled_->begin(), overruled_->end(),
                       [&](const scene::Overruled& each) { return each.path == path && each.wholly; });
  };
  for (const scene::Overruled& each : overruled_.value_or(std::vector<scene::Overruled>())) {
    const auto bound = std::find_if(keys_.begin(), keys_.end(), [&](const BoundKey& key) {
      return std::find(key.paths.begin(), key.paths.end(), each.path) != key.paths.end();
    });
    const bool varied = bound != keys_.end();
    if (!each.wholly)
      warnings_.push_back(fmt::format("{}: {}", each.path, each.text()));
    else if (varied && std::all_of(bound->paths.begin(), bound->paths.end(), idle))
      diagnostics.problems.push_back(
          {bound->key.place, "vary." + bound->key.key, "values without effect (" + each.by + ")", kActs});
    else if (!varied)
      add_at_set(input_error("--set " + each.path, "a value without effect (" + each.by + ")", kActs),
                 each.path, diagnostics);
  }
  return diagnostics.problems;
}

/// Problems: columns that no run has, and an end that no run can reach.
void RolloutStudy::check_record_and_stop() const {
  Diagnostics diagnostics;
  const auto at = [&](const char* block, const char* key) -> const YamlNode* {
    const YamlNode* node = spec_.resolved.find(block);
    return node ? node->find(key) : nullptr;
  };
  const auto problem = [&](const YamlNode* node, const char* key, const std::string& got, std::string need) {
    diagnostics.problems.push_back(
        {node ? std::optional(node->place()) : std::nullopt, key, got, std::move(need)});
  };
  std::vector<std::string> names;
  for (const Column& column : figures_) names.push_back(column.name);
  const YamlNode* figures = at("record", "figures");
  for (std::size_t i = 0; i < spec_.figures.size(); ++i)
    if (std::find(names.begin(), names.end(), spec_.figures[i]) == names.end())
      problem(figures && i < figures->items.size() ? &figures->items[i] : nullptr, "record.figures",
              spec_.figures[i], need_word(spec_.figures[i], names));
  const bool grasps = std::any_of(names.begin(), names.end(),
                                  [](const std::string& name) { return name.ends_with("outcome"); });
  if (spec_.stop_lost && !grasps)
    problem(at("stop", "lost"), "stop.lost", "true in a scene without a grasp", "a grasps block, or no stop");
  diagnostics.throw_if_any();
}

}  // namespace handsim::study
