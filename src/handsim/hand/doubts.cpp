#include "handsim/hand/doubts.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "handsim/hand/build.h"
#include "handsim/hand/deviations.h"

namespace handsim::hand {

namespace {

/// Percentiles 0.1 and 99.9 of a normal distribution.
constexpr double kDoubtful = 3.0902;
/// Standard deviation of a hand's mass share over the share: 0.083 % and 0.61 % (Zatsiorsky, Seluyanov 1979).
constexpr double kMassScatter = 0.14;
/// Added scatter of ln y of a body outside the survey, chosen.
constexpr double kBeyondSurvey = 0.08;

double percentile(double z) { return 50 * std::erfc(-z / std::sqrt(2.0)); }

std::string rank(double z) {
  const double p = percentile(z);
  return p < 0.01    ? "below percentile 0.01"
         : p > 99.99 ? "above percentile 99.99"
                     : fmt::format("percentile {:.3g}", p);
}

/// A measured dimension against its prediction from everything else.
struct Measured {
  const char* key;
  std::optional<double> Person::*value;
  std::size_t index;  ///< in the fit's dimensions
};
constexpr Measured kMeasured[] = {{"hand_length", &Person::hand_length, 0},
                                  {"hand_breadth", &Person::hand_breadth, 1},
                                  {"hand_circumference", &Person::hand_circumference, 3}};

double size_of(const HandSize& size, std::size_t index) {
  return index == 0 ? size.length : index == 1 ? size.breadth : size.circumference;
}

/// Variance of ln y of one dimension given the measured others.
double variance(const Anthropometry& anthropometry, const Person& person, std::size_t of) {
  std::vector<int> known;
  for (const Measured& each : kMeasured)
    if (each.index != of && person.*each.value) known.push_back(static_cast<int>(each.index));
  const Eigen::Matrix4d c = scatter_of(anthropometry, person);
  const auto i = static_cast<int>(of);
  if (known.empty()) return c(i, i);
  const Eigen::MatrixXd among = c(known, known);
  const Eigen::VectorXd with = c(known, i);
  return c(i, i) - with.dot(among.ldlt().solve(with));
}

void check_dimension(const HandSpec& spec, const Person& person, const Measured& each, bool beyond,
                     std::vector<std::string>& out) {
  const auto compare = [&](Person others, const char* among) {
    (others.*each.value).reset();
    const double expected = size_of(hand_size(spec.anthropometry, others), each.index);
    const double scatter = std::sqrt(variance(spec.anthropometry, others, each.index) +
                                     (beyond ? kBeyondSurvey * kBeyondSurvey : 0));
    const double z = std::log(*(person.*each.value) / expected) / scatter;
    if (std::abs(z) <= kDoubtful) return false;
    out.push_back(
        fmt::format("{} of {:.4g} mm is {} of the survey among people of {}, where {:.4g} mm is expected",
                    each.key, 1e3 * *(person.*each.value), rank(z), among, 1e3 * expected));
    return true;
  };
  Person body = person;
  for (const Measured& other : kMeasured) (body.*other.value).reset();
  if (compare(body, "this stature, mass and sex")) return;
  bool has_others = false;
  for (const Measured& other : kMeasured)
    has_others = has_others || (other.index != each.index && person.*other.value);
  if (has_others) compare(person, "this body and the other measured values of its hand");
}

void check_mass(const HandSpec& spec, const Person& person, std::vector<std::string>& out) {
  Person unweighed = person;
  unweighed.hand_mass.reset();
  const double expected = build_hand(spec, unweighed).mass;
  const double z = std::log(*person.hand_mass / expected) / kMassScatter;
  if (std::abs(z) > kDoubtful)
    out.push_back(
        fmt::format("hand_mass of {:.4g} g is {} among hands of this size, where {:.4g} g is expected",
                    1e3 * *person.hand_mass, rank(z), 1e3 * expected));
}

}  // namespace

std::vector<std::string> doubts(const HandSpec& spec, const Person& person) {
  std::vector<std::string> out = extrapolations(spec.anthropometry, person);
  const bool beyond = !out.empty();
  const std::vector<std::string> acts = uncertain_of(spec, person, true);
  for (const auto& [name, z] : person.deviations)
    if (std::ranges::find(acts, name) == acts.end())
      out.push_back("deviations." + name + " does nothing: the hand model gives it no spread");
  // Values with which no hand can be built are refused elsewhere, with their place.
  try {
    for (const Measured& each : kMeasured)
      if (person.*each.value) check_dimension(spec, person, each, beyond, out);
    if (person.hand_mass) check_mass(spec, person, out);
  } catch (const Error&) {
    return out;
  }
  return out;
}

}  // namespace handsim::hand
