#include "handsim/python/derivatives.h"

#include "handsim/core/index.h"

namespace handsim::python {

namespace {

/// In the order of columns, as they are.
py::array_t<double> in_columns(const Eigen::MatrixXd& of) {
  return py::array_t<double, py::array::f_style>({of.rows(), of.cols()}, of.data());
}

py::array_t<double> numbers(const Eigen::VectorXd& of) { return py::array_t<double>(of.size(), of.data()); }

}  // namespace

py::dict arrays_of(const environment::Derivatives& found, const model::Model& model) {
  std::vector<std::string> free;
  for (const int body : found.free_bodies) free.push_back(model.bodies[at(body)].name);
  py::dict out;
  out["state"] = in_columns(found.by_state);
  out["torques"] = in_columns(found.by_torque.leftCols(model.dof_count()));
  out["targets"] = in_columns(found.by_target);
  out["forces"] = in_columns(found.by_force);
  out["gravity"] = in_columns(found.by_gravity);
  out["excitations"] = in_columns(found.by_excitation);
  out["activations"] = in_columns(found.by_activation);
  out["activation_by_excitation"] = numbers(found.activation_by_excitation);
  out["activation_by_activation"] = numbers(found.activation_by_activation);
  out["free_bodies"] = free;
  out["notes"] = found.notes;
  return out;
}

}  // namespace handsim::python
