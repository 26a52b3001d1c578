#include "handsim/hand/anthropometry.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

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

/// Rows of numbers, all of `columns`.
Eigen::MatrixXd read_matrix(MapReader& reader, const char* key, std::size_t least, std::size_t most,
                            std::size_t columns) {
  const YamlNode* rows = reader.list(key, true);
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Identity(static_cast<Eigen::Index>(least), static_cast<Eigen::Index>(columns));
  if (!rows) return out;
  bool fits = rows->items.size() >= least && rows->items.size() <= most;
  for (const YamlNode& row : rows->items) fits = fits && row.items.size() == columns;
  if (!fits) {
    reader.problem(key, rows->described(), fmt::format("{} to {} rows of {} numbers", least, most, columns));
    return out;
  }
  out.resize(static_cast<Eigen::Index>(rows->items.size()), out.cols());
  for (Eigen::Index i = 0; i < out.rows(); ++i)
    for (Eigen::Index j = 0; j < out.cols(); ++j)
      out(i, j) =
          read_number(rows->items[static_cast<std::size_t>(i)].items[static_cast<std::size_t>(j)],
                      fmt::format("{}.{}.{}", reader.path_of(key), i, j), kCoefficient, reader.diagnostics())
              .value_or(i == j ? 1.0 : 0.0);
  return out;
}

Fit read_fit(MapReader reader) {
  Fit fit;
  for (std::size_t i = 0; i < kNames.size(); ++i)
    fit.dimensions[i] = read_allometry(reader.required_map(kNames[i], "a mapping of coefficients"));
  const Eigen::MatrixXd covariance =
      read_matrix(reader, "residual_covariance", kHandDimensions, kHandDimensions, kHandDimensions);
  if (reader.sound() &&
      !(covariance.isApprox(covariance.transpose()) && covariance.llt().info() == Eigen::Success))
    reader.problem("residual_covariance", "a matrix that is not a covariance",
                   "a symmetric positive definite matrix");
  fit.residual_covariance = covariance;
  reader.finish();
  return fit;
}

Children::Tables read_tables(MapReader reader) {
  Children::Tables out;
  for (std::size_t sex = 0; sex < 2; ++sex) {
    const char* key = sex == 0 ? "male" : "female";
    out[sex] = read_matrix(reader, key, 2, 100, 11);
    for (Eigen::Index i = 1; i < out[sex].rows() && reader.sound(); ++i)
      if (out[sex](i, 0) <= out[sex](i - 1, 0))
        reader.problem(key, "rows that do not rise in their first number", "rows of rising age or stature");
  }
  reader.finish();
  return out;
}

const Quantity kSurveyStature = {Dimension::length, 0.1, 3}, kSurveyAge = {Dimension::none, 0, 150};

Survey read_survey(MapReader& reader) {
  Survey out;
  out.source = reader.text("source");
  MapReader range = reader.map("survey_range");
  out.stature = range.maybe_range("stature", kSurveyStature).value_or(out.stature);
  out.mass = range.maybe_range("mass", {Dimension::mass, 1, 1000}).value_or(out.mass);
  out.age = range.maybe_range("age", kSurveyAge).value_or(out.age);
  range.finish();
  return out;
}

Children read_children(MapReader reader) {
  Children out;
  out.survey = read_survey(reader);
  MapReader adult = reader.required_map("adult", "a mapping of age, stature and mass_per_stature");
  const auto range = [&](const char* key, const Quantity& quantity) {
    return adult.maybe_range(key, quantity, true).value_or(std::pair(0.0, 1.0));
  };
  out.adult_age = range("age", kSurveyAge);
  out.adult_stature = range("stature", kSurveyStature);
  out.adult_mass_per_stature = range("mass_per_stature", {Dimension::none, 1, 1000});
  adult.finish();
  out.stature_deviation = reader.number("stature_deviation", {Dimension::none, 0.001, 1});
  if (const YamlNode* scatter = reader.list("scatter", false)) {
    if (scatter->items.size() != out.scatter.size())
      reader.problem("scatter", scatter->described(), "two numbers: of length and of breadth");
    for (std::size_t i = 0; i < std::min(scatter->items.size(), out.scatter.size()); ++i)
      out.scatter[i] = read_number(scatter->items[i], reader.path_of("scatter"), {Dimension::none, 0.1, 10},
                                   reader.diagnostics())
                           .value_or(1.0);
  }
  out.finger_of_length = reader.number("finger_of_length", {Dimension::none, 0, 2});
  out.by_age = read_tables(reader.required_map("by_age", "a mapping with male and female"));
  out.by_stature = read_tables(reader.required_map("by_stature", "a mapping with male and female"));
  reader.finish();
  return out;
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

/// ln of each dimension by the adults' survey, without smearing.
Eigen::Vector4d adult_means(const Fit& fit, const Person& person, Sex sex) {
  Eigen::Vector4d out;
  for (int i = 0; i < kHandDimensions; ++i) {
    const Allometry& a = fit.dimensions[static_cast<std::size_t>(i)];
    out[i] = a.intercept + a.stature * std::log(person.stature) + a.mass * std::log(person.mass) +
             (sex == Sex::female ? a.female : 0.0);
  }
  return out;
}

double smoothstep(double x, std::pair<double, double> range) {
  const double t = std::clamp((x - range.first) / (range.second - range.first), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Share of the adults' fit, 0 to 1.
double adult_share(const Children& children, const Person& person) {
  return person.age ? smoothstep(*person.age, children.adult_age)
                    : smoothstep(person.stature, children.adult_stature) *
                          smoothstep(person.mass / person.stature, children.adult_mass_per_stature);
}

/// The rows of both sexes at this person's age or stature.
std::array<Eigen::RowVectorXd, 2> rows_at(const Children& children, const Person& person) {
  std::array<Eigen::RowVectorXd, 2> out;
  for (std::size_t sex = 0; sex < out.size(); ++sex) {
    const Eigen::MatrixXd& table = (person.age ? children.by_age : children.by_stature)[sex];
    const double x = std::clamp(person.age.value_or(person.stature), table(0, 0), table(table.rows() - 1, 0));
    Eigen::Index i = 1;
    while (i + 1 < table.rows() && table(i, 0) < x) ++i;
    const double t = (x - table(i - 1, 0)) / (table(i, 0) - table(i - 1, 0));
    out[sex] = (1 - t) * table.row(i - 1) + t * table.row(i);
  }
  return out;
}

/// What the children's survey says: ln of each dimension without smearing, and ln (finger / hand length).
/// Unknown sex: the mean of both, weighted with the chances of each at this stature. Palm length keeps the
/// adults' ratio to length, circumference that to breadth, and an adult has the fingers of the last age.
Eigen::Vector<double, 7> child_means(const Anthropometry& anthropometry, const Person& person) {
  const Children& children = *anthropometry.children;
  const std::array<Eigen::RowVectorXd, 2> rows = rows_at(children, person);
  const auto square = [&](std::size_t sex) {
    const double off = std::log(person.stature / rows[sex][10]) / children.stature_deviation;
    return off * off;
  };
  const double girl = person.sex == Sex::unknown ? 1 / (1 + std::exp(0.5 * (square(1) - square(0))))
                                                 : (person.sex == Sex::female ? 1 : 0);
  const double adult = adult_share(children, person);
  Eigen::Vector<double, 7> out = Eigen::Vector<double, 7>::Zero();
  for (std::size_t sex = 0; sex < 2; ++sex) {
    const Eigen::RowVectorXd& row = rows[sex];
    Eigen::Vector<double, 7> of;
    of << adult_means(anthropometry.by_sex, person, sex == 0 ? Sex::male : Sex::female),
        ((1 - adult) * row + adult * children.by_age[sex].bottomRows<1>()).segment<3>(7).transpose();
    for (int i = 0; i < 2; ++i) {
      const double mean = row.segment<3>(1 + 3 * i).dot(
          Eigen::RowVector3d(1, std::log(person.stature), std::log(person.mass)));
      of[i + 2] += mean - of[i];
      of[i] = mean;
    }
    out += (sex == 0 ? 1 - girl : girl) * of;
  }
  return out;
}

/// Residuals given the known ones (multivariate normal): their conditional mean, and from it the person's
/// deviations, each given the dimensions before it.
Eigen::Vector4d residuals_given(const Eigen::Matrix4d& covariance,
                                const std::array<std::optional<double>, kHandDimensions>& known,
                                const Person& person) {
  std::vector<int> at, rest;
  for (int i = 0; i < kHandDimensions; ++i) (known[static_cast<std::size_t>(i)] ? at : rest).push_back(i);
  Eigen::VectorXd residual(at.size());
  for (std::size_t k = 0; k < at.size(); ++k)
    residual[static_cast<Eigen::Index>(k)] = *known[static_cast<std::size_t>(at[k])];
  const Eigen::MatrixXd among = covariance(at, at);
  const Eigen::MatrixXd gain =
      at.empty() ? Eigen::MatrixXd(4, 0)
                 : Eigen::MatrixXd(among.ldlt().solve(covariance(at, Eigen::all)).transpose());
  Eigen::Vector4d out = gain * residual;
  if (person.deviations.empty()) return out;
  const Eigen::MatrixXd left = (covariance - gain * covariance(at, Eigen::all))(rest, rest);
  Eigen::VectorXd z(rest.size());
  for (std::size_t k = 0; k < rest.size(); ++k)
    z[static_cast<Eigen::Index>(k)] = person.deviation(kDeviations[static_cast<std::size_t>(rest[k])]);
  out(rest) += left.llt().matrixL() * z;
  return out;
}

}  // namespace

Anthropometry read_anthropometry(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  Anthropometry out;
  reader.maybe_text("title");
  out.survey = read_survey(reader);
  MapReader fits = reader.required_map("fits", "a mapping with by_sex and pooled");
  out.by_sex = read_fit(fits.required_map("by_sex", "a mapping of hand dimensions"));
  out.pooled = read_fit(fits.required_map("pooled", "a mapping of hand dimensions"));
  fits.finish();
  if (reader.has("children")) out.children = read_children(reader.map("children"));
  MapReader reference = reader.required_map("reference", "a mapping with source, male and female");
  out.reference_source = reference.text("source");
  out.reference_male = read_shares(reference.required_map("male", "a mapping of shares"));
  out.reference_female = read_shares(reference.required_map("female", "a mapping of shares"));
  reference.finish();
  reader.finish();
  return out;
}

Eigen::Matrix4d scatter_of(const Anthropometry& anthropometry, const Person& person) {
  const Fit& fit = person.sex == Sex::unknown ? anthropometry.pooled : anthropometry.by_sex;
  if (!anthropometry.children) return fit.residual_covariance;
  const double child = 1 - adult_share(*anthropometry.children, person);
  const auto& [length, breadth] = anthropometry.children->scatter;
  const Eigen::Vector4d factor =
      Eigen::Vector4d::Ones() +
      child * (Eigen::Vector4d(length, breadth, length, breadth).array() - 1).matrix();
  return factor.asDiagonal() * fit.residual_covariance * factor.asDiagonal();
}

HandSize hand_size(const Anthropometry& anthropometry, const Person& person) {
  const Fit& fit = person.sex == Sex::unknown ? anthropometry.pooled : anthropometry.by_sex;
  Eigen::Vector4d means = adult_means(fit, person, person.sex);
  Eigen::Vector3d fingers = Eigen::Vector3d::Zero();
  if (anthropometry.children) {
    const Eigen::Vector<double, 7> child = child_means(anthropometry, person);
    fingers = child.tail<3>();
    if (const double adult = adult_share(*anthropometry.children, person); adult < 1)
      means = adult * means + (1 - adult) * child.head<4>();
  }
  const std::array<std::optional<double>, kHandDimensions> given = {person.hand_length, person.hand_breadth,
                                                                    std::nullopt, person.hand_circumference};
  const Eigen::Matrix4d scatter = scatter_of(anthropometry, person);
  std::array<std::optional<double>, kHandDimensions> residuals;
  for (std::size_t i = 0; i < given.size(); ++i)
    if (given[i]) residuals[i] = std::log(*given[i]) - means[static_cast<Eigen::Index>(i)];
  if (person.hand_length_percentile)
    residuals[0] = normal_quantile(0.01 * *person.hand_length_percentile) * std::sqrt(scatter(0, 0));
  const Eigen::Vector4d shift = residuals_given(scatter, residuals, person);
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
  const double predicted = fit.dimensions[0].smearing * std::exp(means[0]);
  for (int i = 0; anthropometry.children && i < 3; ++i)
    out.fingers[kMeasuredFingers[i]].length =
        predicted * std::exp(fingers[i]) *
        std::pow(out.length / predicted, anthropometry.children->finger_of_length);
  const auto refuse = [&](const char* key, std::string got, std::string need) {
    throw Error(std::vector<Problem>{{person.place, key, std::move(got), std::move(need)}});
  };
  for (const auto& [name, length] : person.fingers) {
    const auto of = out.fingers.find(name);
    if (of == out.fingers.end())
      refuse("person.fingers", name, "thumb, index or middle, with a survey of fingers");
    of->second = {length, length / of->second.length};
  }
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

const Survey& survey_of(const Anthropometry& anthropometry, const Person& person) {
  const auto& children = anthropometry.children;
  return children && adult_share(*children, person) < 0.5 ? children->survey : anthropometry.survey;
}

std::vector<std::string> extrapolations(const Anthropometry& anthropometry, const Person& person) {
  std::vector<std::string> out;
  const Survey& survey = survey_of(anthropometry, person);
  const auto check = [&](const char* key, double value, std::pair<double, double> range, const char* unit) {
    if (const double off = std::max(range.first - value, value - range.second); off > 0)
      out.push_back(
          fmt::format("{} of {:g} {} is outside the survey ({:g} to {:g} {}) by {:.3g} {}: extrapolated", key,
                      value, unit, range.first, range.second, unit, off, unit));
  };
  check("stature", person.stature, survey.stature, "m");
  check("mass", person.mass, survey.mass, "kg");
  if (person.age) check("age", *person.age, survey.age, "years");
  if (&survey == &anthropometry.survey || !person.age || *person.age < survey.age.first) return out;
  const auto rows = rows_at(*anthropometry.children, person);
  const double medians[] = {rows[0][10], rows[1][10], std::sqrt(rows[0][10] * rows[1][10])};
  const double median = medians[static_cast<std::size_t>(person.sex)];
  if (const double z = std::log(person.stature / median) / anthropometry.children->stature_deviation;
      std::abs(z) > 3.09)
    out.push_back(fmt::format(
        "stature of {:g} m is {:.1f} standard deviations from that of children of {:g} years, {:.4g} m",
        person.stature, std::abs(z), *person.age, median));
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
