#include "handsim/hand/build.h"

#include <algorithm>
#include <cmath>

namespace handsim::hand {

BuiltHand::Forearm forearm_of(const ForearmSpec& spec, const HandSize& size, const Person& person) {
  BuiltHand::Forearm out;
  std::vector<Problem> problems;
  check_size(spec.place, "forearm.length", spec.length.value(size), problems);
  check_size(spec.place, "forearm.radius", spec.radius.value(size), problems);
  throw_if_any(std::move(problems));
  const double length = spec.length.value(size), distal = (1 - spec.centre) * length;
  out.body.name = "forearm";
  out.body.mass = share_of(spec, person.sex) * person.mass;
  out.body.zero_pose.p = {0, -distal, 0};
  const double across = std::pow(spec.across * length, 2), along = std::pow(spec.along * length, 2);
  out.body.inertia = (out.body.mass * Vec3(across, along, across)).asDiagonal();
  out.shape.name = "forearm";
  out.shape.kind = model::ShapeKind::capsule;
  out.shape.part = model::Part::palm;
  out.shape.radius = spec.radius.value(size);
  out.shape.length = std::max(length - 2 * out.shape.radius, 1e-3 * length);
  out.shape.pose = {{0, distal - 0.5 * length, 0}, Quat(Eigen::AngleAxisd(-M_PI / 2, Vec3::UnitX()))};
  out.joint.name = spec.joint.name;
  out.joint.axes = spec.joint.axes;
  out.joint.parent_frame.p = {0, -length, 0};
  out.joint.child_frame.p = {0, distal - length, 0};
  return out;
}

}  // namespace handsim::hand
