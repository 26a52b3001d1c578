// Bodies of a surveyed population, to draw persons from.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "handsim/environment/draws.h"
#include "handsim/hand/person.h"

namespace handsim::study {

/// Stature and the logarithm of mass of one sex, jointly normal.
struct BodySpread {
  double stature = 0, stature_deviation = 0;    ///< [m]
  double log_mass = 0, log_mass_deviation = 0;  ///< of the mass in kg
  double correlation = 0;
};

struct Population {
  std::string_view name;
  BodySpread male, female;
};

std::span<const Population> populations();
/// Null where there is none of this name.
const Population* population(std::string_view name);

/// @param sex absent: either, with equal chances, whatever the shares of the survey.
hand::Person draw_person(const Population& population, std::optional<hand::Sex> sex,
                         environment::Draws& draws);

}  // namespace handsim::study
