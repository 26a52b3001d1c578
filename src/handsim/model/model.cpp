#include "handsim/model/model.h"

#include <algorithm>
#include <cmath>

namespace handsim::model {

namespace {

/// Two springs, or two dampers, in series; one of 0 is absent.
double in_series(double a, double b) { return a > 0 && b > 0 ? a * b / (a + b) : a + b; }

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

}  // namespace

Material combined(const Material& a, const Material& b) {
  Material out;
  Material::fields([&](std::string_view, auto member, const Quantity&, OfTwo rule, auto...) {
    set_field(out, member, of_two(field_value(a, member), field_value(b, member), rule));
  });
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
