#include "handsim/study/uncertain.h"

#include <algorithm>
#include <cmath>

#include "handsim/environment/draws.h"

namespace handsim::study {

void draw_deviations(hand::Person& person, const std::vector<std::string>& names, std::uint64_t draw) {
  for (const std::string& name : names) person.deviations[name] = environment::Draws(1, draw, name).normal();
}

UncertainPersons uncertain_persons(const hand::HandSpec& spec, const hand::Person& person, bool muscles,
                                   int count) {
  UncertainPersons out;
  out.persons.assign(static_cast<std::size_t>(count), person);
  const std::vector<std::string> names = hand::uncertain_of(spec, person, muscles);
  for (std::size_t i = 0; i < out.persons.size(); ++i) draw_deviations(out.persons[i], names, i);
  for (const std::string& name : names) {
    Input& input = out.inputs.emplace_back(Input{name, {}});
    for (const hand::Person& each : out.persons) input.values.push_back(each.deviation(name));
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
