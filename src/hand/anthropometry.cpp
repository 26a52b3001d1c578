#include "handsim/hand/anthropometry.h"

#include <cmath>

#include <fmt/format.h>

namespace handsim::hand {

namespace {

constexpr std::array<std::string_view, kHandDimensions> kNames = {"hand_length", "hand_breadth",
                                                                  "palm_length", "hand_circumference"};
const Quantity kCoefficient = {Dimension::none, -1e3, 1e3};

Allometry read_allometry(MapReader reader) {
  Allometry out;
  out.intercept = reader.number("intercept", kCoefficient);
  out.stature = reader.number("stature", kCoefficient);
  out.mass = reader.number("mass", kCoefficient);
  out.female = reader.number("female", kCoefficient, 0.0);
  out.smearing = reader.number("smearing", {Dimension::none, 0.5, 2});
  reader.finish();
  return out;
}

void read_covariance(MapReader& reader, Eigen::Matrix4d& out) {
  const char* key = "residual_covariance";
  const YamlNode* rows = reader.list(key, true);
  if (!rows) return;
  bool square = rows->items.size() == kHandDimensions;
  for (const YamlNode& row : rows->items) square = square && row.items.size() == kHandDimensions;
  if (!square) return reader.problem(key, rows->described(), "a list of four rows of four numbers");
  for (int i = 0; i < kHandDimensions; ++i)
    for (int j = 0; j < kHandDimensions; ++j) {
      const YamlNode& item = rows->items[static_cast<std::size_t>(i)].items[static_cast<std::size_t>(j)];
      out(i, j) = read_number(item, fmt::format("{}.{}.{}", reader.path_of(key), i, j),
                              {Dimension::none, -1, 1}, reader.diagnostics())
                      .value_or(i == j ? 1.0 : 0.0);
    }
  if (!reader.sound()) return;
  const bool valid = out.isApprox(out.transpose()) && out.llt().info() == Eigen::Success;
  if (!valid)
    reader.problem(key, "a matrix that is not a covariance", "a symmetric positive definite matrix");
}

Fit read_fit(MapReader reader) {
  Fit fit;
  for (std::size_t i = 0; i < kNames.size(); ++i)
    fit.dimensions[i] = read_allometry(reader.required_map(kNames[i], "a mapping of coefficients"));
  read_covariance(reader, fit.residual_covariance);
  reader.finish();
  return fit;
}

HandInertiaShares read_shares(MapReader reader) {
  const Quantity share = {Dimension::none, 0, 1, true};
  HandInertiaShares out;
  out.centre_of_mass = reader.number("centre_of_mass", share);
  out.gyration_sagittal = reader.number("gyration_sagittal", share);
  out.gyration_transverse = reader.number("gyration_transverse", share);
  out.gyration_longitudinal = reader.number("gyration_longitudinal", share);
  reader.finish();
  return out;
}

/// ln of each dimension without smearing.
Eigen::Vector4d log_means(const Fit& fit, const Person& person) {
  Eigen::Vector4d out;
  for (int i = 0; i < kHandDimensions; ++i) {
    const Allometry& a = fit.dimensions[static_cast<std::size_t>(i)];
    out[i] = a.intercept + a.stature * std::log(person.stature) + a.mass * std::log(person.mass) +
             (person.sex == Sex::female ? a.female : 0.0);
  }
  return out;
}

/// Conditional mean of all residuals given the known ones (multivariate normal).
Eigen::Vector4d conditional_residuals(const Eigen::Matrix4d& covariance,
                                      const std::array<std::optional<double>, kHandDimensions>& known) {
  std::vector<int> at;
  for (int i = 0; i < kHandDimensions; ++i)
    if (known[static_cast<std::size_t>(i)]) at.push_back(i);
  Eigen::VectorXd residual(at.size());
  for (std::size_t k = 0; k < at.size(); ++k)
    residual[static_cast<Eigen::Index>(k)] = *known[static_cast<std::size_t>(at[k])];
  if (at.empty()) return Eigen::Vector4d::Zero();
  const Eigen::MatrixXd among = covariance(at, at);
  return covariance(Eigen::all, at) * among.ldlt().solve(residual);
}

}  // namespace

Anthropometry read_anthropometry(YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  Anthropometry out;
  reader.maybe_text("title");
  out.source = reader.text("source");
  MapReader range = reader.map("survey_range");
  out.stature_range = range.maybe_range("stature", {Dimension::length, 0.1, 3}).value_or(std::pair(0.5, 2.5));
  out.mass_range = range.maybe_range("mass", {Dimension::mass, 1, 1000}).value_or(std::pair(2.0, 400.0));
  range.finish();
  MapReader fits = reader.required_map("fits", "a mapping with by_sex and pooled");
  out.by_sex = read_fit(fits.required_map("by_sex", "a mapping of hand dimensions"));
  out.pooled = read_fit(fits.required_map("pooled", "a mapping of hand dimensions"));
  fits.finish();
  MapReader reference = reader.required_map("reference", "a mapping with source, male and female");
  out.reference_source = reference.text("source");
  out.reference_male = read_shares(reference.required_map("male", "a mapping of shares"));
  out.reference_female = read_shares(reference.required_map("female", "a mapping of shares"));
  reference.finish();
  reader.finish();
  return out;
}

HandSize hand_size(const Anthropometry& anthropometry, const Person& person) {
  const Fit& fit = person.sex == Sex::unknown ? anthropometry.pooled : anthropometry.by_sex;
  const Eigen::Vector4d means = log_means(fit, person);
  const std::array<std::optional<double>, kHandDimensions> given = {person.hand_length, person.hand_breadth,
                                                                    std::nullopt, person.hand_circumference};
  std::array<std::optional<double>, kHandDimensions> residuals;
  for (std::size_t i = 0; i < given.size(); ++i)
    if (given[i]) residuals[i] = std::log(*given[i]) - means[static_cast<Eigen::Index>(i)];
  if (person.hand_length_percentile)
    residuals[0] =
        normal_quantile(0.01 * *person.hand_length_percentile) * std::sqrt(fit.residual_covariance(0, 0));

  const Eigen::Vector4d shift = conditional_residuals(fit.residual_covariance, residuals);
  Eigen::Vector4d y;
  HandSize out;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    out.measured[i] = given[i].has_value();
    y[k] = given[i] ? *given[i] : fit.dimensions[i].smearing * std::exp(means[k] + shift[k]);
  }
  out.length = y[0];
  out.breadth = y[1];
  out.palm_length = y[2];
  out.circumference = y[3];
  const auto refuse = [&](const char* key, std::string got, std::string need) {
    throw Error(std::vector<Problem>{{person.place, key, std::move(got), std::move(need)}});
  };
  // Measured values were checked when read; this catches predictions far outside the survey.
  for (std::size_t k = 0; k < kNames.size(); ++k)
    if (const double size = y[static_cast<Eigen::Index>(k)]; !(size > 0.005 && size < 1))
      refuse("person", fmt::format("a body with a predicted {} of {:.4g} m", kNames[k], size),
             "a body for which the anthropometry file predicts 0.005 to 1 m");
  out.thickness = stadium_thickness(out.circumference, out.breadth);
  // The thickness must be below the breadth, and above a lower bound that no hand reaches.
  if (!(out.thickness > 0.15 * out.breadth && out.thickness < out.breadth))
    refuse("person.hand_circumference",
           fmt::format("{:.4g} m around a breadth of {:.4g} m, a hand {:.4g} m thick", out.circumference,
                       out.breadth, out.thickness),
           fmt::format("a circumference of {:.4g} to {:.4g} m for this breadth",
                       (2 + 0.15 * (M_PI - 2)) * out.breadth, M_PI * out.breadth));
  return out;
}

std::vector<std::string> extrapolations(const Anthropometry& anthropometry, const Person& person) {
  std::vector<std::string> out;
  const auto check = [&](const char* key, double value, std::pair<double, double> range, const char* unit) {
    if (value < range.first || value > range.second)
      out.push_back(fmt::format("{} of {:g} {} is outside the survey ({:g} to {:g} {}): extrapolated", key,
                                value, unit, range.first, range.second, unit));
  };
  check("stature", person.stature, anthropometry.stature_range, "m");
  check("mass", person.mass, anthropometry.mass_range, "kg");
  return out;
}

double stadium_thickness(double circumference, double breadth) {
  return (circumference - 2 * breadth) / (M_PI - 2);
}

double normal_quantile(double p) {
  // Bisection on erfc: 60 halvings of [-8, 8] leave an error of 16 / 2^60 = 1.4e-17.
  double low = -8, high = 8;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle / std::sqrt(2.0)) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace handsim::hand
