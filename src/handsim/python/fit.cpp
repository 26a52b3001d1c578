#include <pybind11/eigen.h>

#include "handsim/core/error.h"
#include "handsim/python/bindings.h"
#include "handsim/study/track/pose_fit.h"

namespace handsim::python {

using Eigen::VectorXd, study::HandPose, study::PoseFit;

namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Array = Eigen::Ref<const Matrix>;
using Points = Eigen::Ref<const Eigen::Matrix<double, 21, 3, Eigen::RowMajor>>;

PoseFit fit_of(const SceneHandle& of, std::size_t hand) {
  const hand::HandSpec& spec = *of.scene->spec.hands.at(hand).model;
  const hand::BuiltHand& built = of.scene->hands.at(hand);
  return {study::HandTree(spec, built, of.scene->model.hands.at(hand).side), study::keypoints(spec, built)};
}

/// Points that are not finite were not seen.
study::MeasuredFrame frame_of(const Points& points) {
  study::MeasuredFrame out(21);
  for (std::size_t i = 0; i < out.size(); ++i)
    if (const Vec3 p = points.row(static_cast<Eigen::Index>(i)); p.allFinite()) out[i].point = p;
  return out;
}

/// x y z, w x y z, angles.
HandPose pose_of(const PoseFit& fit, const VectorXd& x) {
  if (x.size() != static_cast<Eigen::Index>(fit.tree().size() + 1))
    throw input_error("pose", fmt::format("{} numbers", x.size()), fmt::format("{}", fit.tree().size() + 1));
  return {{x.head<3>(), Quat(x[3], x[4], x[5], x[6]).normalized()}, {x.begin() + 7, x.end()}};
}

VectorXd numbers_of(const HandPose& pose) {
  VectorXd out(7 + static_cast<Eigen::Index>(pose.angles.size()));
  out << pose.wrist.p, pose.wrist.q.w(), pose.wrist.q.vec(),
      VectorXd::Map(pose.angles.data(), out.size() - 7);
  return out;
}

/// A frame of the filter of python/handsim/_live/tracker.py, up to its angles. @param ahead [3, 2] way, rates
/// and accelerations by those before. @param spread, shared, density, F, Q as there, of the frame before
/// @return pose, motion, change of the angles before; for `finish` W, 1 + W P, change of the rates, residuals
/// that are left and their number; None where the points are not near the prediction
py::object follow(PoseFit& self, const Points& points, const VectorXd& pose, const Array& motion,
                  const Array& ahead, const Array& spread, const Array& shared, const VectorXd& density,
                  const Eigen::Matrix3d& F, const Eigen::Matrix3d& Q, double noise, double reach) {
  const auto n = static_cast<Eigen::Index>(self.tree().size()), m = n - 6;
  if (motion.rows() != 2 || motion.cols() != n || ahead.rows() != 3 || ahead.cols() != 2 ||
      spread.rows() != 3 * n || spread.cols() != 3 * n || shared.rows() != 3 * n || shared.cols() != 2 * m ||
      density.size() != n)
    throw input_error("follow", "arrays of another hand", "those of this one");
  const Matrix moved = ahead * motion;
  const HandPose at = self.tree().moved(pose_of(self, pose), moved.row(0).transpose());
  auto [r, J] = self.rows(frame_of(points), at, std::vector<bool>(21));
  int seen = 0, near = 0;
  for (Eigen::Index i = 0; i < 21; ++i) {
    const bool there = points.row(i).allFinite(), far = r.segment<3>(3 * i).norm() > reach;
    seen += there, near += there && !far;
    if (far) r.segment<3>(3 * i).setZero(), J.middleRows<3>(3 * i).setZero();
  }
  if (near < std::max(7, 3 * seen / 5)) return py::none();
  Matrix P = Matrix::Zero(3 * n, n), late = Matrix::Zero(n, 2 * m);
  for (int j = 0; j < 3; ++j) {
    late.leftCols(m) += F(0, j) * spread.block(j * n, 6, n, m);
    late.rightCols(m) += F(0, j) * shared.block(j * n, 0, n, m);
    for (int i = 0; i < 9; ++i)
      P.middleRows(i / 3 * n, n) += F(i / 3, j) * F(0, i % 3) * spread.block(j * n, i % 3 * n, n, n);
    P.middleRows(j * n, n).diagonal() += Q(j, 0) * density;
  }
  const Matrix W = J.transpose() * J / (noise * noise);
  const Matrix mixed = Matrix::Identity(n, n) + W * P.topRows(n);
  const VectorXd share = mixed.partialPivLu().solve(J.transpose() * r / (-noise * noise));
  const VectorXd change = P * share;
  return py::make_tuple(numbers_of(self.tree().moved(at, change.head(n))),
                        Matrix(moved.bottomRows(2) + Eigen::Map<const Matrix>(change.data() + n, 2, n)),
                        VectorXd(late.transpose() * share), W, mixed, VectorXd(change.segment(n, n)),
                        VectorXd(r + J * change.head(n)), 3 * near);
}

}  // namespace

void bind_fit(py::module_& module) {
  module.def("hand_fit", &fit_of);
  bind_class<PoseFit>(module, "HandFit")
      .def("axes", [](const PoseFit& self) { return names(self.tree().axes()); })
      .def("points",
           [](PoseFit& self, const VectorXd& pose) {
             return Matrix(self.rows(study::MeasuredFrame(21, {Vec3::Zero(), {}}), pose_of(self, pose),
                                     std::vector<bool>(21))
                               .residuals.reshaped<Eigen::RowMajor>(21, 3));
           })
      .def("find", [](PoseFit& self, const Points& points,
                      double outlier) { return numbers_of(self.find(frame_of(points), outlier).pose); })
      .def("follow", &follow);
}

}  // namespace handsim::python
