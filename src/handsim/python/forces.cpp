#include "handsim/python/forces.h"

#include <algorithm>

#include "handsim/core/text.h"

namespace handsim::python {

namespace {

int body_of(const model::Model& model, const std::string& name) {
  std::vector<std::string> known;
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    if (model.bodies[i].name == name) return static_cast<int>(i);
    known.push_back(model.bodies[i].name);
  }
  throw input_error("forces", name, need_word(name, known));
}

}  // namespace

std::vector<Pose> poses_of(const Numbers& numbers, const char* name) {
  std::vector<Pose> out;
  const std::span<const double> all = numbers.span();
  for (std::size_t i = 0; i + 7 <= all.size(); i += 7) {
    const Quat turn(all[i + 3], all[i + 4], all[i + 5], all[i + 6]);
    if (!(turn.norm() > 0)) throw input_error(name, "a quaternion of length 0", "w x y z of a rotation");
    out.push_back({Vec3(all[i], all[i + 1], all[i + 2]), turn.normalized()});
  }
  return out;
}

void read_forces(const py::object& forces, const model::Model& model, std::size_t size,
                 std::vector<std::vector<engine::BodyForce>>& out) {
  out.clear();
  if (forces.is_none()) return;
  out.resize(std::max<std::size_t>(1, size));
  if (!py::hasattr(forces, "items"))
    throw input_error("forces", py::str(py::type::of(forces).attr("__name__")).cast<std::string>(),
                      "a mapping: name of a body to its force");
  // A list of its own: reading an array may run code that changes the mapping.
  for (const py::handle item : py::list(forces.attr("items")())) {
    const auto [key, value] = item.cast<std::pair<py::object, py::object>>();
    const std::string name = py::str(key).cast<std::string>();
    const int body = body_of(model, name);
    const py::array array = py::array::ensure(value);
    if (!array) PyErr_Clear();
    const bool moment = array && array.ndim() > 0 && array.shape(array.ndim() - 1) == 6;
    std::vector<py::ssize_t> shape = {moment ? 6 : 3};
    if (size > 0) shape.insert(shape.begin(), static_cast<py::ssize_t>(size));
    const Numbers numbers(value, shape, "forces." + name);
    const std::size_t width = moment ? 6 : 3;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const double* row = numbers.span().data() + i * width;
      engine::BodyForce& force = out[i].emplace_back();
      force.body = body;
      force.force = {row[0], row[1], row[2]};
      if (moment) force.moment = {row[3], row[4], row[5]};
    }
  }
}

ActionArrays::ActionArrays(const scene::Scene& scene, std::size_t size, const py::object& torque,
                           const py::object& target, const py::object& excitation, const py::object& wrist,
                           const py::object& force) {
  const auto optional = [&](const py::object& given, std::vector<std::size_t> shape, const char* name) {
    if (size > 0) shape.insert(shape.begin(), size);
    return Numbers::optional(given, {shape.begin(), shape.end()}, name);
  };
  torques = optional(torque, {as_index(scene.model.dof_count())}, "torques");
  targets = optional(target, {scene.control ? scene.control->axes.size() : 0}, "targets");
  excitations = optional(excitation, {scene.model.muscles.size()}, "excitations");
  wrists = poses_of(optional(wrist, {scene.model.drives.size(), 7}, "wrists"));
  read_forces(force, scene.model, size, forces);
}

}  // namespace handsim::python
