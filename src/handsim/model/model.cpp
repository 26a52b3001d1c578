#include "handsim/model/model.h"

#include <algorithm>
#include <cmath>

namespace handsim::model {

namespace {

double of_two(double a, double b, OfTwo rule) {
  switch (rule) {
    case OfTwo::geometric_mean:
      return std::sqrt(a * b);
    case OfTwo::larger:
      return std::max(a, b);
    case OfTwo::in_series:
      return in_series(a, b);
  }
  return 0;
}

std::optional<double> of_two(std::optional<double> a, std::optional<double> b, OfTwo rule) {
  if (!a || !b) return a ? a : b;
  return of_two(*a, *b, rule);
}

std::optional<Compliance> in_series(const std::optional<Compliance>& a, const std::optional<Compliance>& b) {
  if (!a || !b) return a ? a : b;
  return in_series(*a, *b);
}

/// The geometric mean.
std::optional<FrictionOverLoad> mean(const std::optional<FrictionOverLoad>& a,
                                     const std::optional<FrictionOverLoad>& b) {
  if (!a && !b) return std::nullopt;
  const FrictionOverLoad x = a.value_or(FrictionOverLoad{}), y = b.value_or(FrictionOverLoad{});
  return FrictionOverLoad{0.5 * (x.exponent + y.exponent), std::sqrt(x.at_one * y.at_one),
                          std::sqrt(x.least * y.least), std::sqrt(x.most * y.most)};
}

}  // namespace

double FrictionOverLoad::factor(double force) const {
  return std::clamp(at_one * std::pow(std::max(force, 0.0), exponent), least, most);
}

double Material::spinning(double friction_there, double depth) const {
  if (!spins_by_area || !compliance) return spinning_friction;
  return 8.0 / 15 * friction_there * compliance->contact_radius(depth);
}

Material combined(const Material& a, const Material& b) {
  Material out;
  Material::fields([&](std::string_view, auto member, const Quantity&, OfTwo rule, auto...) {
    set_field(out, member, of_two(field_value(a, member), field_value(b, member), rule));
  });
  out.compliance = in_series(a.compliance, b.compliance);
  out.spins_by_area = a.spins_by_area || b.spins_by_area;
  out.friction_over_load = mean(a.friction_over_load, b.friction_over_load);
  return out;
}

int dof_count(JointKind kind) {
  switch (kind) {
    case JointKind::hinge:
    case JointKind::slider:
      return 1;
    case JointKind::universal:
      return 2;
    case JointKind::ball:
      return 3;
  }
  return 0;
}

int Model::dof_count() const {
  return joints.empty() ? 0 : joints.back().first_dof + model::dof_count(joints.back().kind);
}

std::vector<std::optional<std::size_t>> Model::objects_of_shapes() const {
  std::vector<std::optional<std::size_t>> out(shapes.size());
  for (std::size_t i = 0; i < objects.size(); ++i)
    for (const int shape : objects[i].shapes) out[as_index(shape)] = i;
  return out;
}

int Model::add_group(std::string name) {
  groups.push_back({std::move(name)});
  return static_cast<int>(groups.size()) - 1;
}

Model make_model() {
  Model model;
  Body world;
  world.name = "world";
  world.kinematic = true;
  model.bodies.push_back(world);
  return model;
}

}  // namespace handsim::model
