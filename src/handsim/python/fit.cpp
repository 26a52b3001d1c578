#include <pybind11/eigen.h>

#include "handsim/app/commands.h"
#include "handsim/core/error.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"
#include "handsim/study/track/track.h"

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

/// What `track` finds in frames of 21 points of one hand, of a person whom nobody has named.
/// @param points a row for each frame; not finite: not seen. @param names of the points in the convention,
/// without one those of keypoints
/// @return the fit of that hand; its length and breadth [m]; noise of a coordinate [m]; numbers of tracked
/// frames and of those that show the other hand; bones and points that the frames hardly show; warnings
py::tuple measured_fit(const SceneHandle& of, std::size_t hand, const std::vector<double>& times,
                       const Array& points, const std::vector<std::string>& names,
                       const std::optional<std::filesystem::path>& convention) {
  if (names.size() != 21 || points.cols() != 63 || points.rows() != static_cast<Eigen::Index>(times.size()))
    throw input_error("measured_fit", "arrays of another shape", "a time and 21 points for each frame");
  const scene::HandEntry& entry = of.scene->spec.hands.at(hand);
  const model::Side side = of.scene->model.hands.at(hand).side;
  study::TrackInput input;
  input.model = *entry.model, input.person = entry.person, input.person_named = false;
  if (convention)
    input.markers = app::load_kind(*convention, scene::FileKind::marker_set, study::read_marker_set);
  study::Recording recording;
  recording.file = side == model::Side::left ? "left" : "right", recording.times = times;
  for (Eigen::Index i = 0; i < 21; ++i)
    for (Eigen::Index k = 0; k < points.rows(); ++k)
      if (const Vec3 p = points.row(k).segment<3>(3 * i); p.allFinite())
        recording.channels[recording.file + "." + names[as_index(i)]].points.add(as_index(k), p);
  const study::TrackResult found = without_gil([&] { return study::run_track(input, recording); });
  const hand::BuiltHand built = hand::build_hand(input.model, found.person);
  std::vector<study::Feature> all = study::features_for(input, built, side), features;
  for (std::size_t i = 0; i < found.shares.size(); ++i) all[i].shares = found.shares[i];
  for (const std::string& name : names)
    for (const study::Feature& each : all)
      if (each.name == recording.file + "." + name) features.emplace_back(each).from.reset();
  if (features.size() != names.size())
    throw input_error("points", "a convention without some of the 21 keypoints", "one with all of them");
  const study::TrackedHand& tracked = found.hands.front();
  return py::make_tuple(PoseFit(study::HandTree(input.model, built, side), std::move(features)),
                        *found.person.hand_length, *found.person.hand_breadth, tracked.noise,
                        tracked.count(study::FrameStatus::tracked),
                        tracked.count(study::FrameStatus::swapped), found.not_shown, found.warnings);
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
/// @return pose, motion, change of the angles before; for `finish` W, (1 + W P)^-1 W, change of the rates,
/// residuals that are left and their number; None where the points are not near the prediction
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
  const study::Rows all = self.rows(frame_of(points), at, std::vector<bool>(21));
  VectorXd r = all.residuals.head(63);
  Eigen::MatrixXd J = all.jacobian.topRows(63);
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
  const Eigen::PartialPivLU<Matrix> factored(mixed);
  const VectorXd share = factored.solve(J.transpose() * r / (-noise * noise));
  const VectorXd change = P * share;
  return py::make_tuple(numbers_of(self.tree().moved(at, change.head(n))),
                        Matrix(moved.bottomRows(2) + Eigen::Map<const Matrix>(change.data() + n, 2, n)),
                        VectorXd(late.transpose() * share), W, Matrix(factored.solve(W)),
                        VectorXd(change.segment(n, n)), VectorXd(r + J * change.head(n)), 3 * near);
}

}  // namespace

void bind_fit(py::module_& module) {
  module.def("hand_fit", &fit_of);
  module.def("measured_fit", &measured_fit);
  bind_class<PoseFit>(module, "HandFit")
      .def("axes", [](const PoseFit& self) { return names(self.tree().axes()); })
      .def("points",
           [](PoseFit& self, const VectorXd& pose) {
             return Matrix(self.rows(study::MeasuredFrame(21, {Vec3::Zero(), {}}), pose_of(self, pose),
                                     std::vector<bool>(21))
                               .residuals.head(63)
                               .reshaped<Eigen::RowMajor>(21, 3));
           })
      .def("find", [](PoseFit& self, const Points& points,
                      double outlier) { return numbers_of(self.find(frame_of(points), outlier).pose); })
      .def("follow", &follow);
}

}  // namespace handsim::python
