#include "handsim/study/rollouts/rollout_draw.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/units.h"
#include "handsim/environment/draws.h"

namespace handsim::study {

namespace {

using From = VariedKey::From;

constexpr std::size_t kProbedLevels = 50;

[[noreturn]] void refuse(const VariedKey& key, std::string got, std::string need) {
  throw Error(std::vector<Problem>{{key.place, "vary." + key.key, std::move(got), std::move(need)}});
}

/// The key with every item of the lists in the place of `*`.
std::vector<std::string> paths_of(const VariedKey& key, const YamlNode& scene) {
  std::vector<std::string> out = {key.key};
  while (true) {
    const std::size_t star = out.front().find(".*");
    if (star == std::string::npos) return out;
    std::vector<std::string> more;
    for (const std::string& path : out) {
      const YamlNode* list = value_at(scene, path.substr(0, star));
      if (!list || list->kind != YamlNode::Kind::sequence || list->items.empty())
        refuse(key, fmt::format("* within {}", list ? list->described() : "nothing"),
               "a list of the scene before it");
      for (std::size_t i = 0; i < list->items.size(); ++i)
        more.push_back(fmt::format("{}.{}{}", path.substr(0, star), i, path.substr(star + 2)));
    }
    out = std::move(more);
  }
}

/// The scene's own value, in SI: what the reader has written into the tree may still have units.
std::vector<double> own_value(const BoundKey& bound, const YamlNode& scene) {
  const YamlNode* node = value_at(scene, bound.paths.front());
  std::vector<double> out;
  if (!node) return out;
  const SharedList<std::vector<YamlNode>> one = {*node};
  for (const YamlNode& item : node->kind == YamlNode::Kind::sequence ? node->items : one)
    if (const auto value = any_quantity(item.text)) out.push_back(*value);
  return out;
}

void bind_mean(BoundKey& bound, const YamlNode& scene) {
  VariedKey& key = bound.key;
  if (key.mean) {
    for (const Given& each : *key.mean) bound.mean.push_back(each.value);
  } else {
    const YamlNode* own = value_at(scene, bound.paths.front());
    bound.mean = own_value(bound, scene);
    if (bound.mean.empty())
      refuse(key,
             fmt::format("normal without a mean, where the scene has {}", own ? own->described() : "nothing"),
             "a mean, or a number of the scene around which to draw");
    key.list = own->kind == YamlNode::Kind::sequence;
  }
  if (key.high.size() == 1) key.high.resize(bound.mean.size(), key.high.front());
  if (key.high.size() != bound.mean.size())
    refuse(key, fmt::format("sd of {} numbers for a value of {}", key.high.size(), bound.mean.size()),
           "one, or as many as the value has");
}

std::string yaml_of(const std::vector<std::string>& numbers, bool list) {
  return list ? fmt::format("[{}]", fmt::join(numbers, ", ")) : numbers.front();
}

Drawn of_numbers(const std::vector<double>& values, bool list) {
  Drawn out;
  std::vector<std::string> texts;
  for (const double value : values) {
    texts.push_back(number_text(value));
    out.cells.emplace_back(value);
  }
  out.yaml = yaml_of(texts, list);
  return out;
}

Drawn of_level(const BoundKey& bound, std::size_t level) {
  const Level& chosen = bound.key.levels[level];
  return {chosen.yaml, {bound.numbers ? Cell(*any_quantity(chosen.text)) : Cell(chosen.text)}};
}

Drawn draw_numbers(const BoundKey& bound, environment::Draws& draws) {
  const VariedKey& key = bound.key;
  std::vector<double> values;
  for (std::size_t i = 0; i < key.high.size(); ++i) {
    const double high = key.high[i].value;
    if (key.from == From::normal) {
      values.push_back(bound.mean[i] + high * draws.normal());
      continue;
    }
    const double low = key.low[i].value;
    values.push_back(key.from == From::uniform ? draws.uniform(low, high) : draws.log_uniform(low, high));
  }
  return of_numbers(values, key.list);
}

Drawn draw_body(const VariedKey& key, environment::Draws& draws) {
  const hand::Person person = draw_person(*key.population, key.sex, draws);
  const std::string sex(hand::name(person.sex));
  return {fmt::format("{{title: drawn from {}, stature: {}, mass: {}, sex: {}}}", key.population->name,
                      number_text(person.stature), number_text(person.mass), sex),
          {person.stature, person.mass, sex}};
}

void add_columns(BoundKey& bound) {
  const VariedKey& key = bound.key;
  const auto add = [&](const std::string& name, bool text) {
    bound.columns.push_back({name, ColumnRole::drawn, text});
  };
  switch (key.from) {
    case From::population:
      add(key.key + ".stature[m]", false);
      add(key.key + ".mass[kg]", false);
      add(key.key + ".sex", true);
      return;
    case From::choice:
    case From::levels:
      bound.numbers = std::ranges::all_of(
          key.levels, [](const Level& level) { return any_quantity(level.text).has_value(); });
      return add(key.key, !bound.numbers);
    default:
      if (!key.list) return add(key.key, false);
      for (std::size_t i = 0; i < key.high.size(); ++i) add(fmt::format("{}.{}", key.key, i), false);
  }
}

/// Values in the units that the study gives them.
std::string in_units(const std::vector<Given>& given, const std::vector<double>& values, bool list) {
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string& unit = given[i].unit;
    const double one = unit.empty() ? 1 : any_quantity("1 " + unit).value_or(1);
    texts.push_back(unit.empty() ? number_text(values[i])
                                 : fmt::format("\"{} {}\"", number_text(values[i] / one), unit));
  }
  return yaml_of(texts, list);
}

std::vector<double> values_of(const std::vector<Given>& given) {
  std::vector<double> out;
  for (const Given& each : given) out.push_back(each.value);
  return out;
}

}  // namespace

std::optional<double> any_quantity(const std::string& text) {
  for (int i = 0; i <= static_cast<int>(Dimension::force); ++i)
    if (const auto value = parse_quantity(text, static_cast<Dimension>(i))) return value;
  return std::nullopt;
}

BoundKey bind(const VariedKey& key, const YamlNode& scene) {
  BoundKey out;
  out.key = key;
  out.paths = paths_of(key, scene);
  if (key.from == From::normal) bind_mean(out, scene);
  add_columns(out);
  return out;
}

Drawn draw(const BoundKey& bound, int seed, long draw, std::size_t level) {
  const VariedKey& key = bound.key;
  if (key.from == From::levels) return of_level(bound, level);
  environment::Draws draws(static_cast<std::uint64_t>(seed), static_cast<std::uint64_t>(draw), key.key);
  if (key.from == From::population) return draw_body(key, draws);
  if (key.from == From::choice) return of_level(bound, draws.index(key.levels.size()));
  return draw_numbers(bound, draws);
}

std::vector<std::string> probes(const BoundKey& bound) {
  const VariedKey& key = bound.key;
  std::vector<std::string> out;
  switch (key.from) {
    case From::population:
      return {draw(bound, 0, 0, 0).yaml};
    case From::choice:
    case From::levels:
      if (bound.numbers && key.levels.size() > kProbedLevels) {
        const auto size = [](const Level& level) { return *any_quantity(level.text); };
        const auto [least, most] = std::ranges::minmax(key.levels, {}, size);
        return {least.yaml, most.yaml};
      }
      for (const Level& level : key.levels) out.push_back(level.yaml);
      return out;
    case From::normal:
      // The mean in the deviation's unit: a deviation of another kind than the value shows.
      out.push_back(in_units(key.high, bound.mean, key.list));
      if (key.mean && key.mean->front().unit != key.high.front().unit)
        out.push_back(in_units(*key.mean, bound.mean, key.list));
      return out;
    default:
      return {in_units(key.low, values_of(key.low), key.list),
              in_units(key.high, values_of(key.high), key.list)};
  }
}

}  // namespace handsim::study
