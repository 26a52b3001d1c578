#include "handsim/python/derivatives.h"

#include <pybind11/eigen.h>

#include "handsim/model/kinematics.h"

namespace handsim::python {

py::dict arrays_of(const environment::Derivatives& found, const model::Model& model) {
  std::vector<std::string> free;
  for (const int body : found.free_bodies) free.push_back(model.bodies[as_index(body)].name);
  py::dict out;
  out["state"] = found.by_state;
  out["torques"] = Eigen::MatrixXd(found.by_torque.leftCols(model.dof_count()));
  out["targets"] = found.by_target;
  out["forces"] = found.by_force;
  out["gravity"] = found.by_gravity;
  out["excitations"] = found.by_excitation;
  out["activations"] = found.by_activation;
  out["activation_by_excitation"] = found.activation_by_excitation;
  out["activation_by_activation"] = found.activation_by_activation;
  out["free_bodies"] = free;
  out["notes"] = found.notes;
  return out;
}

model::State moved(const model::Model& model, model::State state, std::span<const double> by) {
  if (by.empty()) return state;
  const Eigen::Map<const Eigen::VectorXd> change(by.data(), static_cast<Eigen::Index>(by.size()));
  const Eigen::Index n = change.size() / 2;
  Eigen::Index c = 0;
  const auto turned = [&](const Quat& q) { return Quat(rotation_quaternion(change.segment<3>(c)) * q); };
  for (const model::Joint& joint : model.joints) {
    c = joint.first_dof;
    Eigen::VectorXd::MapType q(&state.q[as_index(c)], dof_count(joint.kind)),
        u(&state.u[as_index(c)], q.size());
    const auto axes = static_cast<Eigen::Index>(joint.axes.size());
    q.head(axes) += change.segment(c, axes);
    c += axes;
    if (joint.spherical()) q.tail<3>() = rotation_vector(turned(rotation_quaternion(Vec3(q.tail<3>()))));
    u += change.segment(n + joint.first_dof, u.size());
  }
  c = model.dof_count();
  for (const int free : model::free_bodies(model)) {
    model::BodyState& body = state.bodies[as_index(free)];
    body.q = turned(body.q);
    body.p += change.segment<3>(c + 3);
    body.w += change.segment<3>(n + c);
    body.v += change.segment<3>(n + c + 3);
    c += 6;
  }
  return state;
}

}  // namespace handsim::python
