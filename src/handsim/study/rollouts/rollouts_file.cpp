#include "handsim/study/rollouts/rollouts_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/study/rollouts/rollout_study.h"
#include "handsim/study/spec_reader.h"

namespace handsim::study {

namespace {

using Kind = YamlNode::Kind;

constexpr int kMostDraws = 100'000'000;
constexpr int kMostTrajectories = 10'000;
constexpr std::size_t kMostLevels = 10'000;
constexpr std::size_t kMostComponents = 10;

constexpr const char* kWays =
    "one of uniform, log_uniform, normal, choice, population, each, linspace, logspace";

/// A number in any unit that handsim knows; which one a key has, its scene says.
std::optional<Given> read_given(const YamlNode& node) {
  if (node.kind != Kind::scalar) return std::nullopt;
  const auto value = any_quantity(node.text);
  if (!value) return std::nullopt;
  double number = 0;
  const char* end = node.text.data() + node.text.size();
  const char* unit = std::from_chars(node.text.data(), end, number).ptr;
  return Given{*value, std::string(std::find_if(unit, end, [](char c) { return c != ' '; }), end)};
}

/// A number or a list of some.
std::optional<std::vector<Given>> read_givens(const YamlNode& node, bool& list) {
  std::vector<Given> out;
  list = node.kind == Kind::sequence;
  const SharedList<std::vector<YamlNode>> one = {node};
  for (const YamlNode& item : list ? node.items : one) {
    const auto given = read_given(item);
    if (!given || out.size() == kMostComponents) return std::nullopt;
    out.push_back(*given);
  }
  if (out.empty()) return std::nullopt;
  return out;
}

constexpr const char* kRange =
    "two values, the lower first: numbers of one unit, or lists of numbers of one length";

void read_range(const YamlNode& node, bool logarithmic, MapReader& reader, VariedKey& out) {
  const char* key = logarithmic ? "log_uniform" : "uniform";
  bool list = false;
  std::optional<std::vector<Given>> low, high;
  if (node.items.size() == 2) {
    low = read_givens(node.items[0], out.list);
    high = read_givens(node.items[1], list);
  }
  if (!low || !high || list != out.list || low->size() != high->size())
    return reader.problem(key, node.described(), kRange);
  out.from = logarithmic ? VariedKey::From::log_uniform : VariedKey::From::uniform;
  for (std::size_t i = 0; i < low->size(); ++i) {
    const double a = (*low)[i].value, b = (*high)[i].value;
    if (!(a <= b)) return reader.problem(key, fmt::format("{:g} to {:g}", a, b), kRange);
    if (logarithmic && !(a > 0)) return reader.problem(key, fmt::format("{:g}", a), "values above 0");
  }
  out.low = *low;
  out.high = *high;
}

void read_normal(MapReader reader, VariedKey& out) {
  out.from = VariedKey::From::normal;
  const ValueForm form = {{Kind::scalar, Kind::sequence}, "a number, or a list of numbers"};
  ValueForm optional = form;
  optional.required = false;
  bool list = false;
  const YamlNode* deviation = reader.value("sd", form);
  const YamlNode* mean = reader.value("mean", optional);
  if (deviation) {
    const auto given = read_givens(*deviation, out.list);
    if (!given || std::ranges::any_of(*given, [](const Given& g) { return g.value < 0; }))
      reader.problem("sd", deviation->described(), "a deviation from 0, or a list of some");
    else
      out.high = *given;
  }
  if (mean) {
    out.mean = read_givens(*mean, list);
    if (!out.mean)
      reader.problem("mean", mean->described(), form.need);
    else if (out.list && (!list || out.mean->size() != out.high.size()))
      reader.problem("mean", mean->described(), fmt::format("a list of {} numbers, as sd", out.high.size()));
    out.list = list;
  }
  reader.finish();
}

/// A file's path is relative to the study.
Level level_of(const YamlNode& node) {
  const std::string text = flow_text(node);
  if (node.kind != Kind::scalar) return {text, text};
  const std::filesystem::path beside = std::filesystem::path(node.place().file).parent_path() / node.text;
  if (!is_file(beside)) return {text, node.text};
  YamlNode path = yaml_scalar(absolute_path(beside).string(), true);
  return {flow_text(path), node.text};
}

void read_levels(const YamlNode& node, const char* key, MapReader& reader, VariedKey& out) {
  out.from = key == std::string_view("each") ? VariedKey::From::levels : VariedKey::From::choice;
  for (const YamlNode& item : node.items) out.levels.push_back(level_of(item));
  if (out.levels.empty()) reader.problem(key, "an empty list", "a list of values");
}

void read_space(const YamlNode& node, bool logarithmic, MapReader& reader, VariedKey& out) {
  const char* key = logarithmic ? "logspace" : "linspace";
  const char* need = "[first, last, how many], such as [0.3, 1, 8]";
  out.from = VariedKey::From::levels;
  std::optional<Given> first, last, many;
  if (node.items.size() == 3) {
    first = read_given(node.items[0]);
    last = read_given(node.items[1]);
    many = read_given(node.items[2]);
  }
  if (!first || !last || !many) return reader.problem(key, node.described(), need);
  const double n = many->value, a = first->value, b = last->value;
  if (!(n >= 2 && n <= static_cast<double>(kMostLevels) && n == std::floor(n)))
    return reader.problem(key, fmt::format("{:g} values", n), fmt::format("2 to {}", kMostLevels));
  if (logarithmic && !(a > 0 && b > 0)) return reader.problem(key, node.described(), "values above 0");
  // The ends as they were written, with their units.
  out.levels.push_back(level_of(node.items[0]));
  for (double i = 1; i < n - 1; ++i) {
    const double share = i / (n - 1);
    const std::string text = number_text(logarithmic ? a * std::pow(b / a, share) : a + (b - a) * share);
    out.levels.push_back({text, text});
  }
  out.levels.push_back(level_of(node.items[1]));
}

void read_population(MapReader& reader, VariedKey& out) {
  out.from = VariedKey::From::population;
  std::vector<std::pair<std::string_view, const Population*>> names;
  for (const Population& each : populations()) names.emplace_back(each.name, &each);
  out.population = reader.choice<const Population*>("population", names);
  out.sex = reader.choice<std::optional<hand::Sex>>(
      "sex", {{"any", std::nullopt}, {"male", hand::Sex::male}, {"female", hand::Sex::female}},
      std::optional<std::optional<hand::Sex>>(std::in_place, std::nullopt));
}

VariedKey read_varied(MapReader reader, const std::string& key) {
  VariedKey out;
  out.key = key;
  out.place = reader.node().place();
  const bool map = reader.node().kind == Kind::map;
  int ways = 0;
  const auto sequence = [&](const char* way, const char* need) -> const YamlNode* {
    if (reader.node().find(way)) ++ways;
    return reader.value(way, {{Kind::sequence}, need, false});
  };
  if (const YamlNode* node = sequence("uniform", kRange)) read_range(*node, false, reader, out);
  if (const YamlNode* node = sequence("log_uniform", kRange)) read_range(*node, true, reader, out);
  if (const YamlNode* node = sequence("choice", "a list of values"))
    read_levels(*node, "choice", reader, out);
  if (const YamlNode* node = sequence("each", "a list of values")) read_levels(*node, "each", reader, out);
  if (const YamlNode* node = sequence("linspace", "[first, last, how many]"))
    read_space(*node, false, reader, out);
  if (const YamlNode* node = sequence("logspace", "[first, last, how many]"))
    read_space(*node, true, reader, out);
  if (reader.has("normal")) {
    ++ways;
    read_normal(reader.map("normal"), out);
  }
  if (reader.has("population")) {
    ++ways;
    read_population(reader, out);
  }
  // A way that is misspelt is an unknown key.
  reader.finish();
  if (map && ways != 1 && reader.sound())
    reader.problem("", ways == 0 ? "nothing to draw from" : fmt::format("{} ways to draw", ways), kWays);
  return out;
}

void read_outcomes(MapReader& reader, RolloutsSpec& out) {
  const YamlNode* node =
      reader.value("outcome", {{Kind::scalar, Kind::sequence}, "a figure, or a list of figures", false});
  if (!node) return;
  out.outcome_place = node->place();
  if (node->kind == Kind::scalar) out.outcomes = {node->text};
  for (const YamlNode& item : node->items) out.outcomes.push_back(item.text);
}

void read_record(MapReader reader, RolloutsSpec& out) {
  const ValueForm form = {{Kind::scalar, Kind::sequence}, "all, or a list of columns", false};
  if (const YamlNode* figures = reader.value("figures", form)) {
    for (const YamlNode& item : figures->items) out.figures.push_back(item.text);
    if (figures->kind == Kind::scalar && figures->text != "all")
      reader.problem("figures", figures->described(), form.need);
  }
  out.trajectories = reader.integer("trajectories", 0, kMostTrajectories, 0);
  reader.finish();
}

constexpr const char* kActs = "a key that acts in this scene";

/// The path is the other one or below it.
bool within(const std::string& path, const std::string& other) {
  return (path + ".").starts_with(other + ".");
}

/// Whether each thing that may be drawn for a key has a value at a path below it.
bool has_value(const BoundKey& bound, const std::string& part) {
  const VariedKey& key = bound.key;
  if (key.from == VariedKey::From::population)
    return part == "stature" || part == "mass" || part == "sex" || part == "title";
  if (key.levels.empty()) return true;
  return std::ranges::any_of(key.levels, [&](const Level& level) {
    const YamlNode node = parse_yaml(level.yaml, "level");
    return node.kind == YamlNode::Kind::sequence || node.find(part);
  });
}

/// A later value at this path takes the place of what is drawn for a key.
bool replaces(const std::string& path, const BoundKey& drawn) {
  return std::ranges::any_of(drawn.paths, [&](const std::string& earlier) {
    if (within(earlier, path)) return true;
    if (!within(path, earlier)) return false;
    const std::string rest = path.substr(earlier.size() + 1);
    return has_value(drawn, rest.substr(0, rest.find('.')));
  });
}

}  // namespace

RolloutsSpec read_rollouts(const YamlNode& root, Diagnostics& diagnostics) {
  RolloutsSpec out;
  if (!scene::is_of_kind(root, "", scene::FileKind::rollouts, diagnostics)) return out;
  MapReader reader(root, "", diagnostics);
  out.title = reader.text("title", "rollouts");
  if (const YamlNode* scene =
          reader.value("scene", {{Kind::scalar}, "the path of a scene file, relative to this file"}))
    if (auto path = scene_path(*scene, "scene", diagnostics)) out.scene = *path;
  if (reader.has("set")) out.set = read_set(reader, "set");
  out.count = reader.integer("count", 1, kMostDraws, 1);
  out.seed = reader.integer("seed", 0, 2'147'483'647, 1);
  out.uncertain = reader.flag("uncertain", false);
  MapReader vary =
      out.uncertain ? reader.map("vary")
                    : reader.required_map("vary", "a mapping of dotted keys of the scene to what is drawn");
  for (const std::string& key : vary.keys()) {
    if (key.empty()) vary.problem(key, "an empty key", "a dotted key of the scene");
    out.vary.push_back(read_varied(vary.map(key), key));
  }
  if (reader.sound() && out.vary.empty() && !out.uncertain)
    vary.problem("", "no key", "at least one key of the scene");
  MapReader stop = reader.map("stop");
  out.stop_lost = stop.flag("lost", false);
  stop.finish();
  read_outcomes(reader, out);
  read_record(reader.map("record"), out);
  reader.finish();
  return out;
}

RolloutsSpec uncertain_rollouts(const std::filesystem::path& scene) {
  RolloutsSpec out;
  out.scene = scene;
  out.title = scene.stem().string() + ", hands within what is uncertain";
  out.uncertain = out.bands = out.stop_lost = true;
  return out;
}

RolloutsSpec load_rollouts(const std::filesystem::path& path) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  RolloutsSpec out = read_rollouts(root, diagnostics);
  diagnostics.throw_if_any();
  out.resolved = diagnostics.resolution.applied(std::move(root));
  return out;
}

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
      return std::ranges::none_of(*overruled_,
                                  [&](const scene::Overruled& known) { return known.path == each.path; });
    });
  overruled_ = std::move(found);
}

/// Problems: keys whose values change nothing. Those that change less than they say are warnings.
std::vector<Problem> RolloutStudy::idle_keys() {
  Diagnostics diagnostics;
  const auto idle = [&](const std::string& path) {
    return std::ranges::any_of(
        *overruled_, [&](const scene::Overruled& each) { return each.path == path && each.wholly; });
  };
  for (const scene::Overruled& each : overruled_.value_or(std::vector<scene::Overruled>())) {
    const auto bound = std::ranges::find_if(keys_, [&](const BoundKey& key) {
      return std::ranges::find(key.paths, each.path) != key.paths.end();
    });
    const bool varied = bound != keys_.end();
    if (!each.wholly)
      warnings_.push_back(fmt::format("{}: {}", each.path, each.text()));
    else if (varied && std::ranges::all_of(bound->paths, idle))
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
    if (std::ranges::find(names, spec_.figures[i]) == names.end())
      problem(figures && i < figures->items.size() ? &figures->items[i] : nullptr, "record.figures",
              spec_.figures[i], need_word(spec_.figures[i], names));
  const bool grasps =
      std::ranges::any_of(names, [](const std::string& name) { return name.ends_with("outcome"); });
  if (const YamlNode* lost = at("stop", "lost"); lost && spec_.stop_lost && !grasps)
    problem(lost, "stop.lost", "true in a scene without a grasp", "a grasps block, or no stop");
  diagnostics.throw_if_any();
}

}  // namespace handsim::study
