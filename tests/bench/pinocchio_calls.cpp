#include "bench/pinocchio_calls.h"

#include <memory>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <string>

namespace handsim::bench {

namespace {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

Vec3 vector(const Numbers3& numbers) { return Eigen::Map<const Vec3>(numbers.data()); }
Mat3 matrix(const Numbers9& numbers) { return Eigen::Map<const Mat3>(numbers.data()); }
pinocchio::SE3 placement(const Placement& at) { return {matrix(at.rotation), vector(at.translation)}; }

pinocchio::Model make_model(const std::vector<TreeJoint>& tree, const Numbers3& gravity) {
  pinocchio::Model out;
  out.gravity.linear() = vector(gravity);
  std::vector<pinocchio::JointIndex> there;
  for (const TreeJoint& joint : tree) {
    const pinocchio::JointIndex parent = joint.parent < 0 ? 0 : there[static_cast<std::size_t>(joint.parent)];
    const pinocchio::SE3 at = placement(joint.in_parent);
    const std::string name = std::to_string(there.size());
    const Vec3 first = vector(joint.axis[0]);
    if (joint.axes == 2)
      there.push_back(
          out.addJoint(parent, pinocchio::JointModelUniversal(first, vector(joint.axis[1])), at, name));
    else
      there.push_back(out.addJoint(parent, pinocchio::JointModelRevoluteUnaligned(first), at, name));
    out.appendBodyToJoint(there.back(), pinocchio::Inertia(joint.mass, Vec3::Zero(), matrix(joint.inertia)),
                          placement(joint.body));
  }
  return out;
}

}  // namespace

PinocchioCalls pinocchio_calls(const std::vector<TreeJoint>& tree, const Numbers3& gravity, int calls) {
  const auto model = std::make_shared<pinocchio::Model>(make_model(tree, gravity));
  const auto data = std::make_shared<pinocchio::Data>(*model);
  const Eigen::VectorXd q = pinocchio::neutral(*model);
  const Eigen::VectorXd v = Eigen::VectorXd::Constant(model->nv, 0.1);
  return {[=] {
            for (int i = 0; i < calls; ++i)
              pinocchio::aba(*model, *data, q, v, v, pinocchio::Convention::LOCAL);
          },
          [=] {
            for (int i = 0; i < calls; ++i) pinocchio::rnea(*model, *data, q, v, v);
          }};
}

}  // namespace handsim::bench
