#include "handsim/scene/compile/mass_properties.h"

#include <cmath>

#include "handsim/hand/build.h"

namespace handsim::scene {

namespace {

/// Per unit of mass, about the shape's centre in its own axes [m^2].
Mat3 unit_inertia(const model::Shape& shape) {
  const double r2 = shape.radius * shape.radius;
  switch (shape.kind) {
    case model::ShapeKind::box: {
      const Vec3 e2 = shape.edges.cwiseAbs2();
      return (Vec3(e2.y() + e2.z(), e2.z() + e2.x(), e2.x() + e2.y()) / 12).asDiagonal();
    }
    case model::ShapeKind::sphere:
      return 0.4 * r2 * Mat3::Identity();
    case model::ShapeKind::cylinder: {
      const double across = r2 / 4 + shape.length * shape.length / 12;
      return Vec3(across, across, r2 / 2).asDiagonal();
    }
    case model::ShapeKind::capsule: {
      const hand::CapsuleInertia solid = hand::capsule_inertia(shape.radius, shape.length);
      return Vec3(solid.transverse, solid.transverse, solid.axial).asDiagonal();
    }
    case model::ShapeKind::convex_mesh:
      return shape.mesh ? shape.mesh->unit_inertia : Mat3::Zero();
    case model::ShapeKind::plane:
      return Mat3::Zero();
  }
  return Mat3::Zero();
}

}  // namespace

double volume(const model::Shape& shape) {
  switch (shape.kind) {
    case model::ShapeKind::box:
      return shape.edges.prod();
    case model::ShapeKind::sphere:
      return 4.0 / 3.0 * M_PI * std::pow(shape.radius, 3);
    case model::ShapeKind::cylinder:
      return M_PI * shape.radius * shape.radius * shape.length;
    case model::ShapeKind::capsule:
      return hand::capsule_inertia(shape.radius, shape.length).volume;
    case model::ShapeKind::convex_mesh:
      return shape.mesh ? shape.mesh->volume : 0;
    case model::ShapeKind::plane:
      return 0;
  }
  return 0;
}

MassProperties solid_properties(const model::Shape& shape, double mass) {
  const Mat3 turn = shape.pose.q.toRotationMatrix();
  return {mass, shape.pose.p, mass * turn * unit_inertia(shape) * turn.transpose()};
}

MassProperties joined(const std::vector<MassProperties>& parts) {
  // One part stays what it is, to the bit.
  if (parts.size() == 1) return parts.front();
  MassProperties out;
  for (const MassProperties& part : parts) {
    out.mass += part.mass;
    out.centre += part.mass * part.centre;
  }
  if (out.mass > 0) out.centre /= out.mass;
  for (const MassProperties& part : parts) {
    const Vec3 d = part.centre - out.centre;
    out.inertia += part.inertia + part.mass * (d.squaredNorm() * Mat3::Identity() - d * d.transpose());
  }
  // Rounding leaves a trace of skewness.
  out.inertia = 0.5 * (out.inertia + out.inertia.transpose().eval());
  return out;
}

}  // namespace handsim::scene
