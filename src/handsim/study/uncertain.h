// Hands within what is uncertain of one, for studies that build many.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "handsim/hand/deviations.h"
#include "handsim/study/statistics.h"

namespace handsim::study {

/// Deviations of these names, by the number of the draw alone.
void draw_deviations(hand::Person& person, const std::vector<std::string>& names, std::uint64_t draw);

/// Persons with drawn deviations of one person; an input has the deviations of one name.
struct UncertainPersons {
  std::vector<hand::Person> persons;
  std::vector<Input> inputs;
};

/// Person i is the same for any count. @param muscles whether they act
UncertainPersons uncertain_persons(const hand::HandSpec& spec, const hand::Person& person, bool muscles,
                                   int count);

/// A figure of such hands, of those that have it: others are NaN.
struct Uncertainty {
  std::size_t missing = 0;
  double mean = 0, low = 0, high = 0;  ///< 5th and 95th percentile
  std::vector<VarianceShare> variance;
};
Uncertainty uncertainty_of(std::vector<Input> inputs, std::vector<double> values);

}  // namespace handsim::study
