// Variants of hard cases: all combinations of alternatives, and random variants.
#include <cmath>
#include <random>

#include <fmt/format.h>

#include "handsim/core/pose.h"
#include "handsim/core/text.h"
#include "handsim/study/stability/stability.h"

namespace handsim::study {

namespace {

/// Description and YAML of a random person.
std::pair<std::string, std::string> drawn_person(std::mt19937& random) {
  std::uniform_real_distribution<double> stature(1.4, 2.1), mass(40, 150);
  double metres = 0, kilograms = 0, index = 0;
  do {
    metres = stature(random), kilograms = mass(random);
    index = kilograms / (metres * metres);
  } while (index < 14 || index > 50);
  const char* sex = random() % 2 == 0 ? "male" : "female";
  return {fmt::format("{:.2f} m, {:.0f} kg, {}", metres, kilograms, sex),
          fmt::format("{{stature: {:.4f}, mass: {:.3f}, sex: {}}}", metres, kilograms, sex)};
}

/// Uniform over all rotations: the direction of four normally distributed numbers (Marsaglia 1972).
std::string drawn_rotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double w = normal(random), x = normal(random), y = normal(random), z = normal(random);
  const Vec3 turn = rotation_vector(Quat(w, x, y, z).normalized());
  const double angle = turn.norm();
  const Vec3 axis = angle > 0 ? Vec3(turn / angle) : Vec3(Vec3::UnitX());
  return fmt::format("{{axis: [{:.6f}, {:.6f}, {:.6f}], angle: {:.6f}}}", axis.x(), axis.y(), axis.z(),
                     angle);
}

}  // namespace

std::vector<Alternative> drawn_variants(const Draws& draws, int most) {
  std::mt19937 random(static_cast<unsigned>(draws.seed));
  std::vector<Alternative> out;
  for (int i = 0; i < std::min(draws.count, most); ++i) {
    Alternative& variant = out.emplace_back();
    variant.name = fmt::format("draw {}", i + 1);
    std::string person;
    for (const DrawnKey& key : draws.keys) {
      std::string value;
      switch (key.from) {
        case DrawnKey::From::person:
          if (person.empty()) {
            std::string described;
            std::tie(described, person) = drawn_person(random);
            variant.name += ": " + described;
          }
          value = person;
          break;
        case DrawnKey::From::rotation:
          value = drawn_rotation(random);
          break;
        case DrawnKey::From::range:
          value = number_text(std::uniform_real_distribution<double>(key.low, key.high)(random));
          break;
        case DrawnKey::From::choices:
          value = key.choices[random() % key.choices.size()];
          break;
      }
      variant.set.push_back(key.key + "=" + value);
    }
  }
  return out;
}

std::vector<Variant> variants(const StabilityCase& of, bool quick) {
  std::vector<Variant> out;
  for (const std::filesystem::path& scene : of.scenes)
    out.push_back({scene, of.scenes.size() > 1 ? scene.stem().string() : "", {}});
  std::vector<std::vector<Alternative>> dimensions = of.varied;
  if (of.draws)
    dimensions.push_back(
        drawn_variants(*of.draws, quick ? of.quick_draws.value_or(of.draws->count) : of.draws->count));
  for (const std::vector<Alternative>& dimension : dimensions) {
    std::vector<Variant> more;
    for (const Variant& chosen : out)
      for (const Alternative& alternative : dimension) {
        Variant& both = more.emplace_back(chosen);
        both.name += (both.name.empty() ? "" : ", ") + alternative.name;
        both.set.insert(both.set.end(), alternative.set.begin(), alternative.set.end());
      }
    out = std::move(more);
  }
  return out;
}

}  // namespace handsim::study
