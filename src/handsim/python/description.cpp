// What a scene's model is made of, and the skins of its hands, as tuples and arrays: _model.py names their
// fields.
#include "handsim/model/kinematics.h"
#include "handsim/output/render/skin.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"

namespace handsim::python {

namespace {

constexpr const char* kShapeKinds[] = {"box", "capsule", "cylinder", "sphere", "convex_mesh", "plane"};
static_assert(std::size(kShapeKinds) == static_cast<std::size_t>(model::ShapeKind::plane) + 1);
constexpr const char* kPartNames[] = {"palm",   "thumb",  "index",  "middle",   "ring",
                                      "little", "object", "ground", "mechanism"};
static_assert(std::size(kPartNames) == static_cast<std::size_t>(model::Part::mechanism) + 1);

/// Numbers by row.
template <class Rows>
py::array_t<double> rows_of(const Rows& rows, std::size_t columns = 0) {
  std::vector<double> out;
  for (const auto& row : rows)
    for (const auto x : row) out.push_back(static_cast<double>(x));
  return array_of(out, columns);
}

std::array<double, 7> numbers(const Pose& x) {
  return {x.p.x(), x.p.y(), x.p.z(), x.q.w(), x.q.x(), x.q.y(), x.q.z()};
}

py::array_t<double> array(const Eigen::MatrixXd& m) { return rows_of(m.rowwise(), as_index(m.cols())); }

py::tuple joint_tuple(const model::Joint& joint) {
  py::list axes;
  std::vector<bool> slides;
  for (int k = 0; k < dof_count(joint.kind); ++k) slides.push_back(joint.slides(as_index(k)));
  for (const model::JointAxis& axis : joint.axes) {
    const model::Stop stop = axis.stop.value_or(model::Stop{-HUGE_VAL, HUGE_VAL});
    const model::Tissue tissue = axis.tissue.value_or(model::Tissue{});
    axes.append(py::make_tuple(axis.name, array(axis.axis), stop.low, stop.high, tissue.stiffness,
                               tissue.damping, tissue.rest));
  }
  return py::make_tuple(joint.name, joint.type().name, slides, joint.parent, joint.child,
                        numbers(joint.parent_frame), numbers(joint.child_frame), axes, joint.closes_loop);
}

py::tuple shape_tuple(const model::Model& model, const model::Shape& shape, const output::Colour& colour) {
  std::vector<Vec3> corners;
  std::vector<std::array<unsigned, 3>> faces;
  for (int face = 0; shape.mesh && face < shape.mesh->face_count(); ++face) {
    const auto loop = shape.mesh->corners(face);
    for (std::size_t i = 1; i + 1 < loop.size(); ++i) faces.push_back({loop[0], loop[i], loop[i + 1]});
  }
  if (shape.mesh) corners = shape.mesh->vertices;
  const model::Material& material = model.materials[as_index(shape.material)];
  return py::make_tuple(shape.name, kShapeKinds[static_cast<std::size_t>(shape.kind)], shape.body,
                        numbers(shape.pose), shape.radius, shape.length, array(shape.edges),
                        kPartNames[static_cast<std::size_t>(shape.part)],
                        std::array{colour.r, colour.g, colour.b}, material.friction, material.restitution,
                        rows_of(corners, 3), rows_of(faces, 3));
}

py::dict description(const SceneHandle& of) {
  const model::Model& model = of.scene->model;
  py::list bodies, joints, shapes, nails, hands;
  for (const model::Body& body : model.bodies)
    bodies.append(
        py::make_tuple(body.name, body.mass, array(body.inertia), numbers(body.zero_pose), body.kinematic));
  for (const model::Joint& joint : model.joints) joints.append(joint_tuple(joint));
  const model::State zero = model::initial_state(model);
  std::vector<output::Colour> colours(model.shapes.size());
  for (const output::DrawShape& drawn : output::draw_list(model, zero, {}).shapes) {
    const model::Shape& on = model.shapes[as_index(drawn.shape)];
    if (!drawn.mark) colours[as_index(drawn.shape)] = drawn.colour;
    if (!drawn.mark || !drawn.fine) continue;
    model::Shape nail = on;
    nail.name += ".nail";
    nail.kind = model::ShapeKind::capsule;
    nail.pose = zero.bodies[as_index(on.body)].pose().inverse() * drawn.solid.pose;
    nail.radius = drawn.solid.round;
    nail.length = 2 * drawn.solid.half.z();
    nails.append(shape_tuple(model, nail, drawn.colour));
  }
  for (std::size_t i = 0; i < model.shapes.size(); ++i)
    shapes.append(shape_tuple(model, model.shapes[i], colours[i]));
  for (const model::HandIndex& hand : model.hands) {
    py::list tips;
    for (const model::Fingertip& tip : hand.fingertips)
      tips.append(py::make_tuple(tip.name, tip.body, array(tip.point)));
    hands.append(
        py::make_tuple(hand.name, hand.bodies, hand.palm, numbers(hand.wrist_frame), hand.joints, tips));
  }
  using py::arg;
  return py::dict(arg("gravity") = array(model.gravity), arg("bodies") = bodies, arg("joints") = joints,
                  arg("shapes") = shapes, arg("nails") = nails, arg("hands") = hands);
}

/// The skin of each hand: bodies, their rest poses, points, faces, shares of the bodies, colour.
py::list skins(const SceneHandle& of) {
  py::list out;
  const output::Colour tone = output::from_srgb(of.scene->spec.pictures.skin_colour);
  for (const auto& skin : output::skins_of(of.scene->model)) {
    std::vector<std::array<double, 7>> rest;
    for (const Pose& x : skin->rest) rest.push_back(numbers(x));
    out.append(py::make_tuple(skin->bodies, rows_of(rest, 7), rows_of(skin->points, 3),
                              rows_of(skin->faces, 3), array(skin->weights.cast<double>()),
                              std::array{tone.r, tone.g, tone.b}));
  }
  return out;
}

}  // namespace

void bind_description(py::module_& module) {
  module.def("description", &description);
  module.def("skins", &skins);
}

}  // namespace handsim::python
