#include "handsim/hand/build.h"

#include <algorithm>

#include "handsim/core/data_folder.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/model/newton_euler.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"

namespace handsim::python {

namespace {

using Column = std::vector<double>;

/// @throws Error (input) without hands.
const model::HandIndex& first_hand(const SceneHandle& of) {
  if (of.scene->model.hands.empty()) throw input_error("scene", "a scene without hands", "one with a hand");
  return of.scene->model.hands.front();
}

std::string part_name(const std::string& body) { return body.substr(body.find('.') + 1); }

/// Bodies of the scene's first hand in its hand frame: palm, then segments with a joint; with the row of the
/// body that carries each. The palm's length is that of the box about its shapes.
py::dict segments(const SceneHandle& of) {
  const model::Model& model = of.scene->model;
  const model::HandIndex& hand = first_hand(of);
  const hand::BuiltHand& built = of.scene->hands.front();
  const Pose x_HW = (model.bodies[as_index(hand.palm)].zero_pose * hand.wrist_frame).inverse();
  const Vec3 box = hand::palm_box(built);
  std::vector<std::string> names, joints;
  std::vector<int> parents;
  Column length, radius, mass, centre, inertia;
  for (std::size_t i = 0; i < hand.bodies.size(); ++i) {
    const model::Body& body = model.bodies[as_index(hand.bodies[i])];
    const auto segment = std::ranges::find_if(
        built.segments, [&](const auto& each) { return each.joint && each.body == static_cast<int>(i); });
    const bool palm = segment == built.segments.end();
    names.push_back(part_name(body.name));
    joints.push_back(palm ? "" : built.joints[as_index(*segment->joint)].name);
    parents.push_back(palm ? -1 : built.joints[as_index(*segment->joint)].parent);
    length.push_back(palm ? box.y() : segment->length);
    radius.push_back(palm ? box.z() / 2 : segment->radius);
    mass.push_back(body.mass);
    append(centre, x_HW * body.zero_pose.p);
    append(inertia, body.inertia.diagonal());
  }
  py::dict out;
  out["name"] = names;
  out["joint"] = joints;
  out["parent"] = py::array(py::cast(parents));
  out["length[m]"] = array_of(length);
  out["radius[m]"] = array_of(radius);
  out["mass[kg]"] = array_of(mass);
  out["centre_of_mass[m]"] = array_of(centre, 3);
  out["inertia[kg m^2]"] = array_of(inertia, 3);
  return out;
}

/// The first hand at coordinates, with its hand frame at the origin of the world.
struct Posture {
  const model::Model& model;
  const model::HandIndex& hand;
  model::State state;

  Posture(const SceneHandle& of, const py::object& q) : model(of.scene->model), hand(first_hand(of)) {
    state = model::state_at(model, coordinates(q, "q").span());
    const Pose x_HW = (state.bodies[as_index(hand.palm)].pose() * hand.wrist_frame).inverse();
    for (model::BodyState& body : state.bodies) {
      const Pose x_HB = x_HW * body.pose();
      body.p = x_HB.p;
      body.q = x_HB.q;
    }
  }
  /// One number for each coordinate.
  Numbers coordinates(const py::object& numbers, const char* name) const {
    Numbers out(numbers, {static_cast<py::ssize_t>(model.dof_count())}, name);
    for (const double each : out.span())
      if (!std::isfinite(each)) throw input_error(name, std::to_string(each), "finite numbers");
    return out;
  }
};

py::array_t<double> matrix(const Eigen::MatrixXd& of) {
  py::array_t<double> out({of.rows(), of.cols()});
  for (Eigen::Index i = 0; i < of.rows(); ++i)
    for (Eigen::Index k = 0; k < of.cols(); ++k) out.mutable_at(i, k) = of(i, k);
  return out;
}

py::tuple poses(const SceneHandle& of, const py::object& q) {
  const Posture posture(of, q);
  Column position, quaternion;
  for (const int body : posture.hand.bodies) {
    append(position, posture.state.bodies[as_index(body)].p);
    append(quaternion, posture.state.bodies[as_index(body)].q);
  }
  return py::make_tuple(array_of(position, 3), array_of(quaternion, 4));
}

/// @param body row among the hand's bodies
py::array_t<double> jacobian(const SceneHandle& of, const py::object& q, std::size_t body,
                             const py::object& offset) {
  const Posture posture(of, q);
  const Numbers point(offset, {3}, "offset");
  const int index = posture.hand.bodies.at(body);
  return matrix(model::jacobian(posture.model, posture.state, index,
                                posture.state.bodies[as_index(index)].pose() * Vec3(point.span().data())));
}

py::array_t<double> mass_matrix(const SceneHandle& of, const py::object& q) {
  const Posture posture(of, q);
  return matrix(model::mass_matrix(posture.model, posture.state, posture.hand.bodies));
}

py::array_t<double> inverse_dynamics(const SceneHandle& of, const py::object& q, const py::object& u,
                                     const py::object& a, const py::object& gravity) {
  Posture posture(of, q);
  const Numbers rates = posture.coordinates(u, "u"), change = posture.coordinates(a, "a");
  const Vec3 pull(Numbers(gravity, {3}, "gravity").span().data());
  posture.state.u.assign(rates.span().begin(), rates.span().end());
  return array_of(model::inverse_dynamics(posture.model, posture.state, change.span(), pull));
}

py::array_t<double> moment_arms(const SceneHandle& of, const py::object& q) {
  const Posture posture(of, q);
  const std::vector<model::Muscle>& muscles = posture.model.muscles;
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(muscles.size()), posture.model.dof_count());
  for (std::size_t m = 0; m < muscles.size(); ++m) {
    const model::PathState path = model::path_state(muscles[m].path, posture.state.q);
    for (std::size_t i = 0; i < muscles[m].path.arms.size(); ++i)
      out(static_cast<Eigen::Index>(m), muscles[m].path.arms[i].dof) = path.arm[i];
  }
  return matrix(out);
}

/// By muscle: the force that full activation adds, and the force at rest [N]. By coordinate: the torque of
/// bands [N m].
py::tuple muscle_forces(const SceneHandle& of, const py::object& q) {
  const Posture posture(of, q);
  const model::Model& model = posture.model;
  Column active, passive, torque(posture.state.q.size());
  for (const model::Muscle& muscle : model.muscles) {
    const double excursion = model::path_state(muscle.path, posture.state.q).excursion;
    active.push_back(model::isometric_force(muscle, excursion));
    passive.push_back(model::passive_force(muscle, excursion));
  }
  for (const model::Band& band : model.bands) {
    const model::PathState path = model::path_state(band.path, posture.state.q);
    const double pull = -band.stiffness * (path.excursion + band.rest);
    for (std::size_t i = 0; i < band.path.arms.size(); ++i)
      torque[as_index(band.path.arms[i].dof)] += path.arm[i] * (band.both_ways ? pull : std::max(0.0, pull));
  }
  return py::make_tuple(array_of(active), array_of(passive), array_of(torque));
}

/// Size, mass and strength of the first hand.
py::dict dimensions(const SceneHandle& of) {
  first_hand(of);
  const hand::BuiltHand& built = of.scene->hands.front();
  const hand::WholeHand whole = hand::whole_hand(built);
  YamlNode norms = load_yaml(data_folder() / "handmodels/grip_strength.yaml");
  Diagnostics diagnostics;
  const hand::GripTable table = hand::read_grip_table(norms, "", diagnostics);
  diagnostics.throw_if_any();
  py::dict out;
  out["length[m]"] = built.size.length;
  out["breadth[m]"] = built.size.breadth;
  out["palm_length[m]"] = built.size.palm_length;
  out["circumference[m]"] = built.size.circumference;
  out["thickness[m]"] = built.size.thickness;
  for (const auto& [name, finger] : built.size.fingers) out[(name + "_length[m]").c_str()] = finger.length;
  out["mass[kg]"] = built.mass;
  out["centre_of_mass[m]"] = whole.shares.centre_of_mass * built.size.length;
  out["grip_strength[N]"] = hand::grip_strength(table, of.scene->spec.hands.front().person).own;
  return out;
}

}  // namespace

void bind_hand(py::module_& module) {
  module.def("hand_dimensions", &dimensions);
  module.def("hand_segments", &segments);
  module.def("hand_poses", &poses);
  module.def("hand_jacobian", &jacobian);
  module.def("hand_mass_matrix", &mass_matrix);
  module.def("hand_inverse_dynamics", &inverse_dynamics);
  module.def("hand_moment_arms", &moment_arms);
  module.def("hand_muscle_forces", &muscle_forces);
}

}  // namespace handsim::python
