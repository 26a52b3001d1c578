#include "handsim/study/uncertain.h"

#include <algorithm>
#include <cmath>

#include "handsim/environment/draws.h"

namespace handsim::study {

UncertainPersons uncertain_persons(const hand::HandSpec& spec, const hand::Person& person, bool muscles,
                                   int count) {
  UncertainPersons out;
  out.persons.assign(static_cast<std::size_t>(count), person);
  for (const std::string& name : hand::uncertain_of(spec, person, muscles)) {
    Input& input = out.inputs.emplace_back(Input{name, {}});
    for (std::size_t i = 0; i < out.persons.size(); ++i) {
      input.values.push_back(environment::Draws(1, i, name).normal());
      out.persons[i].deviations[name] = input.values.back();
    }
  }
  return out;
}

Uncertainty uncertainty_of(std::vector<Input> inputs, std::vector<double> values) {
  Uncertainty out;
  for (std::size_t i = values.size(); i-- > 0;) {
    if (std::isfinite(values[i])) continue;
    ++out.missing;
    values.erase(values.begin() + static_cast<std::ptrdiff_t>(i));
    for (Input& input : inputs) input.values.erase(input.values.begin() + static_cast<std::ptrdiff_t>(i));
  }
  if (values.empty()) values = {NAN, NAN};
  out.mean = mean_of(values)->value;
  out.variance = variance_shares(inputs, values);
  std::ranges::sort(values);
  out.low = quantile(values, 0.05);
  out.high = quantile(values, 0.95);
  return out;
}

}  // namespace handsim::study
