#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/study/track/pose_fit.h"

namespace handsim::python {

namespace {

using study::HandPose;

/// The 21 points of a frame [m]; those that are not finite were not seen.
std::vector<study::MeasuredPoint> frame_of(const Numbers& points) {
  std::vector<study::MeasuredPoint> out(points.span().size() / 3);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Vec3 point = Eigen::Map<const Vec3>(points.span().data() + 3 * i);
    if (point.allFinite()) out[i].point = point;
  }
  return out;
}

/// x, y, z, w, x, y, z of the wrist and the angles.
HandPose pose_of(const study::PoseFit& fit, const py::object& pose) {
  const std::size_t angles = fit.tree().axes().size();
  const Numbers numbers(pose, {static_cast<py::ssize_t>(7 + angles)}, "pose");
  const auto all = numbers.span();
  return {{{all[0], all[1], all[2]}, Quat(all[3], all[4], all[5], all[6]).normalized()},
          {all.begin() + 7, all.end()}};
}

}  // namespace

void bind_fit(py::module_& module) {
  using study::PoseFit;
  module.def(
      "hand_fit",
      [](const SceneHandle& of, std::size_t hand) {
        const auto& spec = *of.scene->spec.hands.at(hand).model;
        const hand::BuiltHand& built = of.scene->hands.at(hand);
        return std::make_unique<PoseFit>(study::HandTree(spec, built, of.scene->model.hands.at(hand).side),
                                         study::keypoints(spec, built));
      },
      py::arg("scene"), py::arg("hand"));
  bind_class<PoseFit>(module, "HandFit")
      .def("axes",
           [](const PoseFit& self) {
             std::vector<std::string> out;
             for (const study::TreeAxis& axis : self.tree().axes()) out.push_back(axis.name);
             return out;
           })
      .def("find",
           [](PoseFit& self, const py::object& points) {
             const auto frame = frame_of(Numbers(points, {21, 3}, "points"));
             const HandPose pose = self.find(frame, 0.025).pose;
             const Quat& q = pose.wrist.q;
             std::vector<double> out = {
                 pose.wrist.p.x(), pose.wrist.p.y(), pose.wrist.p.z(), q.w(), q.x(), q.y(), q.z()};
             out.insert(out.end(), pose.angles.begin(), pose.angles.end());
             return array_of(out);
           })
      .def("rows", [](PoseFit& self, const py::object& points, const py::object& pose) {
        const auto frame = frame_of(Numbers(points, {21, 3}, "points"));
        const study::Rows rows = self.rows(frame, pose_of(self, pose), std::vector<bool>(21));
        const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> jacobian = rows.jacobian;
        return py::make_tuple(array_of({rows.residuals.data(), 63}),
                              array_of({jacobian.data(), static_cast<std::size_t>(jacobian.size())},
                                       static_cast<std::size_t>(jacobian.cols())));
      });
}

}  // namespace handsim::python
