#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/study/track/pose_fit.h"

namespace handsim::python {

using study::PoseFit;

namespace {

PoseFit fit_of(const SceneHandle& of, std::size_t hand) {
  const hand::HandSpec& spec = *of.scene->spec.hands.at(hand).model;
  const hand::BuiltHand& built = of.scene->hands.at(hand);
  return {study::HandTree(spec, built, of.scene->model.hands.at(hand).side), study::keypoints(spec, built)};
}

/// @param points [21, 3]; those that are not finite were not seen. @param pose x y z, w x y z, angles
/// @return distances [63] and their derivatives by position, turn and angles
py::tuple rows(PoseFit& self, const py::object& points, const py::object& pose) {
  const Numbers p(points, {21, 3}, "points"),
      x(pose, {static_cast<py::ssize_t>(self.tree().size() + 1)}, "pose");
  std::vector<study::MeasuredPoint> frame(21);
  for (std::size_t i = 0; i < frame.size(); ++i)
    if (const Vec3 at = Eigen::Map<const Vec3>(&p.span()[3 * i]); at.allFinite()) frame[i].point = at;
  const auto all = x.span();
  const study::HandPose at{{{all[0], all[1], all[2]}, Quat(all[3], all[4], all[5], all[6]).normalized()},
                           {all.begin() + 7, all.end()}};
  const study::Rows found = self.rows(frame, at, std::vector<bool>(21));
  const Eigen::MatrixXd across = found.jacobian.transpose();
  return py::make_tuple(
      array_of({found.residuals.data(), 63}),
      array_of({across.data(), static_cast<std::size_t>(across.size())}, self.tree().size()));
}

}  // namespace

void bind_fit(py::module_& module) {
  module.def("hand_fit", &fit_of, py::arg("scene"), py::arg("hand"));
  bind_class<PoseFit>(module, "HandFit")
      .def("axes", [](const PoseFit& self) { return names(self.tree().axes()); })
      .def("rows", &rows, py::arg("points"), py::arg("pose"));
}

}  // namespace handsim::python
