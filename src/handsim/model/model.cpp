#include "handsim/model/model.h"

#include <algorithm>
#include <cmath>

namespace handsim::model {

namespace {

/// Two springs, or two dampers, in series; one of 0 is absent.
double in_series(double a, double b) { return a > 0 && b > 0 ? a * b / (a + b) : a + b; }

std::optional<Compliance> in_series(const std::optional<Compliance>& a, const std::optional<Compliance>& b) {
  if (!a || !b) return a ? a : b;
  return Compliance{in_series(a->stiffness, b->stiffness), in_series(a->damping, b->damping)};
}

}  // namespace

Material combined(const Material& a, const Material& b) {
  Material out;
  out.friction = std::sqrt(a.friction * b.friction);
  out.restitution = std::max(a.restitution, b.restitution);
  out.restitution_speed = std::max(a.restitution_speed, b.restitution_speed);
  out.compliance = in_series(a.compliance, b.compliance);
  out.rolling_friction = std::max(a.rolling_friction, b.rolling_friction);
  out.spinning_friction = std::max(a.spinning_friction, b.spinning_friction);
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
    for (const int shape : objects[i].shapes) out[at(shape)] = i;
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
