#include "handsim/hand/build.h"

#include <algorithm>

#include "handsim/core/data_folder.h"
#include "handsim/core/index.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"

namespace handsim::python {

namespace {

using Column = std::vector<double>;

void append(Column& out, const Vec3& v) { out.insert(out.end(), {v.x(), v.y(), v.z()}); }

/// @throws Error (input) without hands.
const model::HandIndex& first_hand(const SceneHandle& of) {
  if (of.scene->model.hands.empty()) throw input_error("scene", "a scene without hands", "one with a hand");
  return of.scene->model.hands.front();
}

std::string part_name(const std::string& body) { return body.substr(body.find('.') + 1); }

/// Bodies of the scene's first hand in its hand frame: palm, then segments with a joint. The palm's length is
/// that of the box about its shapes.
py::dict segments(const SceneHandle& of) {
  const model::Model& model = of.scene->model;
  const model::HandIndex& hand = first_hand(of);
  const hand::BuiltHand& built = of.scene->hands.front();
  const Pose x_HW = (model.bodies[at(hand.palm)].zero_pose * hand.wrist_frame).inverse();
  const Vec3 box = hand::palm_box(built);
  std::vector<std::string> names, joints;
  Column length, radius, mass, centre, inertia;
  for (std::size_t i = 0; i < hand.bodies.size(); ++i) {
    const model::Body& body = model.bodies[at(hand.bodies[i])];
    const auto segment = std::find_if(built.segments.begin(), built.segments.end(), [&](const auto& each) {
      return each.joint && each.body == static_cast<int>(i);
    });
    const bool palm = segment == built.segments.end();
    names.push_back(part_name(body.name));
    joints.push_back(palm ? "" : built.joints[at(*segment->joint)].name);
    length.push_back(palm ? box.y() : segment->length);
    radius.push_back(palm ? box.z() / 2 : segment->radius);
    mass.push_back(body.mass);
    append(centre, x_HW * body.zero_pose.p);
    append(inertia, body.inertia.diagonal());
  }
  py::dict out;
  out["name"] = names;
  out["joint"] = joints;
  out["length[m]"] = array_of(length);
  out["radius[m]"] = array_of(radius);
  out["mass[kg]"] = array_of(mass);
  out["centre_of_mass[m]"] = array_of(centre, 3);
  out["inertia[kg m^2]"] = array_of(inertia, 3);
  return out;
}

/// A row for each axis of the first hand's joints.
py::dict joints(const SceneHandle& of) {
  const model::Model& model = of.scene->model;
  const model::HandIndex& hand = first_hand(of);
  const Pose x_HW = (model.bodies[at(hand.palm)].zero_pose * hand.wrist_frame).inverse();
  std::vector<std::string> names, types;
  Column low, high, stiffness, damping, rest, centre;
  for (const int index : hand.joints) {
    const model::Joint& joint = model.joints[at(index)];
    for (const model::JointAxis& axis : joint.axes) {
      names.push_back(part_name(joint.name) + "." + axis.name);
      types.emplace_back(joint.axes.size() == 1 ? "hinge" : "universal");
      const model::Stop stop = axis.stop.value_or(model::Stop{-HUGE_VAL, HUGE_VAL});
      const model::Tissue tissue = axis.tissue.value_or(model::Tissue{});
      low.push_back(stop.low);
      high.push_back(stop.high);
      stiffness.push_back(tissue.stiffness);
      damping.push_back(tissue.damping);
      rest.push_back(tissue.rest);
      append(centre, x_HW * (model.bodies[at(joint.child)].zero_pose * joint.child_frame.p));
    }
  }
  py::dict out;
  out["name"] = names;
  out["type"] = types;
  out["low[rad]"] = array_of(low);
  out["high[rad]"] = array_of(high);
  out["stiffness[N m/rad]"] = array_of(stiffness);
  out["damping[N m s/rad]"] = array_of(damping);
  out["rest[rad]"] = array_of(rest);
  out["centre[m]"] = array_of(centre, 3);
  return out;
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
  out["mass[kg]"] = built.mass;
  out["centre_of_mass[m]"] = whole.shares.centre_of_mass * built.size.length;
  out["grip_strength[N]"] = hand::grip_strength(table, of.scene->spec.hands.front().person).own;
  return out;
}

}  // namespace

void bind_hand(py::module_& module) {
  module.def("hand_dimensions", &dimensions, py::arg("scene"));
  module.def("hand_segments", &segments, py::arg("scene"));
  module.def("hand_joints", &joints, py::arg("scene"));
}

}  // namespace handsim::python
