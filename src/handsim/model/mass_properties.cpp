#include "handsim/model/mass_properties.h"

#include <cmath>

namespace handsim::model {

namespace {

/// Per unit of mass, about the shape's centre in its own axes [m^2].
Mat3 unit_inertia(const Shape& shape) {
  const double r2 = shape.radius * shape.radius;
  switch (shape.kind) {
    case ShapeKind::box:
      return (box_moments(shape.edges) / 12).asDiagonal();
    case ShapeKind::sphere:
      return 0.4 * r2 * Mat3::Identity();
    case ShapeKind::cylinder: {
      const double across = r2 / 4 + shape.length * shape.length / 12;
      return Vec3(across, across, r2 / 2).asDiagonal();
    }
    case ShapeKind::capsule: {
      const CapsuleInertia solid = capsule_inertia(shape.radius, shape.length);
      return Vec3(solid.transverse, solid.transverse, solid.axial).asDiagonal();
    }
    case ShapeKind::convex_mesh:
      return shape.mesh ? shape.mesh->unit_inertia : Mat3::Zero();
    case ShapeKind::plane:
      return Mat3::Zero();
  }
  return Mat3::Zero();
}

}  // namespace

Vec3 box_moments(const Vec3& edges) {
  const Vec3 e2 = edges.cwiseAbs2();
  return {e2.y() + e2.z(), e2.z() + e2.x(), e2.x() + e2.y()};
}

CapsuleInertia capsule_inertia(double radius, double length) {
  const double r2 = radius * radius;
  const double cylinder = M_PI * r2 * length;
  const double caps = 4.0 / 3.0 * M_PI * r2 * radius;
  const double total = cylinder + caps;
  CapsuleInertia out;
  out.volume = total;
  out.axial = (cylinder * r2 / 2 + caps * 2 * r2 / 5) / total;
  // Two half spheres, each with its centre of mass 3/8 r beyond its flat side.
  out.transverse = (cylinder * (length * length / 12 + r2 / 4) +
                    caps * (2 * r2 / 5 + length * length / 4 + 3 * length * radius / 8)) /
                   total;
  return out;
}

double volume(const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::box:
      return shape.edges.prod();
    case ShapeKind::sphere:
      return 4.0 / 3.0 * M_PI * std::pow(shape.radius, 3);
    case ShapeKind::cylinder:
      return M_PI * shape.radius * shape.radius * shape.length;
    case ShapeKind::capsule:
      return capsule_inertia(shape.radius, shape.length).volume;
    case ShapeKind::convex_mesh:
      return shape.mesh ? shape.mesh->volume : 0;
    case ShapeKind::plane:
      return 0;
  }
  return 0;
}

MassProperties solid_properties(const Shape& shape, double mass) {
  const Mat3 r = shape.pose.q.toRotationMatrix();
  return {mass, shape.pose.p, mass * r * unit_inertia(shape) * r.transpose()};
}

MassProperties joined(const std::vector<MassProperties>& parts) {
  // A single part is returned unchanged, bit for bit.
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
  // Rounding makes the sum slightly asymmetric.
  out.inertia = 0.5 * (out.inertia + out.inertia.transpose().eval());
  return out;
}

}  // namespace handsim::model
