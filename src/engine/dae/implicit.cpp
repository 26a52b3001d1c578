#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

namespace {

Mat3 cross_matrix(const Vec3& v) {
  Mat3 out;
  out << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return out;
}

}  // namespace

Matrix implicit_mass(const System& system, const model::State& state, double a, double b) {
  Matrix out = system.mass_matrix();
  const Vector u = system.velocities(state);
  for (Index i = 0; i < system.body_count(); ++i) {
    // d(w x I w) = ([w] I - [I w]) dw.
    const Vec3 w = u.segment<3>(kTwistSize * i + 3);
    const Mat3& inertia = system.inertia(i);
    out.block<3, 3>(kTwistSize * i + 3, kTwistSize * i + 3) +=
        a * (cross_matrix(w) * inertia - cross_matrix(inertia * w));
  }
  Vector row(u.size());
  for (const TissueRow& each : system.tissue(state)) {
    row.setZero();
    system.add_transposed(each.row, 1, state, row);
    out += a * (each.tissue.damping + b * each.tissue.stiffness) * row * row.transpose();
  }
  return out;
}

}  // namespace handsim::engine::dae
