// Cut joints held by constraints in joint space: J du = -k (Featherstone 2008, section 8.4, p. 149, and 8.5).
// Rows may be dependent: only an independent set of them, chosen by pivoting, carries force.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "handsim/engine/articulated/dynamics/joint_space.h"

namespace handsim::engine::articulated {

inline constexpr double kOpen = 1e-8;  ///< Loops further apart than this after a step are not to be held [m].

class Loops {
 public:
  /// @param mechanism of one lane. Both must outlive this object.
  Loops(const model::Model& model, Mechanism& mechanism);

  /// The rows' rates as the mechanism moves [m/s, 1/s], and their Jacobian: rows by dofs of the joint space.
  std::span<const double> rates();
  std::span<const double> jacobian();

  /// du with the loops held, from the axes' forces, weights and locks: joint accelerations `a` for which the
  /// rows' own accelerations vanish (`step` none), or their rates at the end of a step [s] do.
  void solve(std::optional<double> step);
  /// Moves positions, then rates, onto the loops by the inertia's shortest way; leaves the kinematics found.
  /// Returns the largest error left [m, or cosine] without rates that no row can change.
  double close();
  /// `close` for rates alone.
  void close_rates();

 private:
  struct Row {
    double value = 0;  ///< [m], or a cosine that is to be 0
    double rate = 0;
    double drift = 0;  ///< its acceleration at joint accelerations of 0
    Spatial on_parent = Spatial::Zero(), on_child = Spatial::Zero();
  };
  struct Side {
    Vec3 p = Vec3::Zero();
    Mat3 R = Mat3::Identity();
    Vec3 v = Vec3::Zero(), w = Vec3::Zero();    ///< of the frame
    Vec3 dv = Vec3::Zero(), dw = Vec3::Zero();  ///< its acceleration at joint accelerations of 0
  };
  Side motion_of(const CutSide& side, int island) const;
  void compute_rows();
  void add_point_row(const Side& a, const Side& b, const Vec3& direction, bool turning);
  void add_angle_row(const Side& a, const Side& b, const Vec3& x, const Vec3& y);
  void fill_jacobian();
  void compute_jacobian();
  /// Multipliers for which the rows change by `wanted`; adds H^-1 J^T of them to `out`.
  void correct(std::span<double> wanted, std::span<double> out);
  void factor_rows();
  Axis<1>& axis_of(int dof) const;

  const model::Model& model_;
  Mechanism& mechanism_;
  JointSpace space_;
  std::vector<Row> rows_;
  std::vector<int> locked_;        ///< dofs on a stop
  std::vector<double> J_, Y_, K_;  ///< rows by dofs; L^-T J^T; J H^-1 J^T and its factor
  std::vector<int> order_;         ///< independent rows, best first
  std::vector<double> bias_, zero_, wanted_, x_, multipliers_, scale_, column_, delta_, kept_, rates_,
      row_rates_;
};

}  // namespace handsim::engine::articulated
