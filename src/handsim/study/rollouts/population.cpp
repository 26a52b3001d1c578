#include "handsim/study/rollouts/population.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace handsim::study {

namespace {

/// ansur2: the US Army's survey of 2012 (Gordon et al. 2014, NATICK/TR-15/007, public release), 2861 men and
/// 1386 women. Skewness and excess kurtosis of stature and of the logarithm of mass are below 0.14.
constexpr std::array kPopulations = {Population{
    "ansur2", {1.75606, 0.06899, 4.43364, 0.16444, 0.481}, {1.62870, 0.06405, 4.20428, 0.15922, 0.548}}};

}  // namespace

std::span<const Population> populations() { return kPopulations; }

const Population* population(std::string_view name) {
  const auto found =
      std::ranges::find_if(kPopulations, [&](const Population& each) { return each.name == name; });
  return found == kPopulations.end() ? nullptr : &*found;
}

hand::Person draw_person(const Population& population, std::optional<hand::Sex> sex,
                         environment::Draws& draws) {
  // All are drawn whatever the sex: the same person, but for the sex, for each choice of it.
  const bool man = draws.uniform() < 0.5;
  const double a = draws.normal(), b = draws.normal();
  hand::Person out;
  out.sex = sex.value_or(man ? hand::Sex::male : hand::Sex::female);
  const BodySpread& of = out.sex == hand::Sex::male ? population.male : population.female;
  out.stature = of.stature + of.stature_deviation * a;
  const double r = of.correlation;
  out.mass = std::exp(of.log_mass + of.log_mass_deviation * (r * a + std::sqrt(1 - r * r) * b));
  return out;
}

}  // namespace handsim::study
