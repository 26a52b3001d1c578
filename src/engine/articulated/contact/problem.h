// Contacts of a step, and the numbers that ContactNewton has of one problem and that no later one starts
// from.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "handsim/core/pose.h"
#include "handsim/engine/articulated/kernels/row_kernel.h"

namespace handsim::engine::articulated {

/// Up to so many contacts are solved without allocating memory.
inline constexpr std::size_t kUsualContacts = 16;
inline constexpr std::size_t kMostRows = 6;  ///< of a contact
inline constexpr std::size_t kUsualRows = 4;

/// So many discs slide at a time, usually.
inline constexpr std::size_t kUsualSliding = 6;

/// Friction on the edge of its disc, and which way.
struct Sliding {
  bool slides = false;  ///< the impulse is on the disc's edge
  /// While it slides: direction of slip (unit); direction opposite to the impulse, as a share of the limit;
  /// limit over speed, the stiffness across the slip. Both directions agree in the solution.
  double slip_x = 1, slip_y = 0, force_x = 1, force_y = 0, tangent_stiffness = 0;
};

/// Rows whose impulse lies in a disc of radius `coefficient` times the normal impulse: two rows of sliding or
/// rolling friction, one of spinning friction.
struct Disc : Sliding {
  enum class Kind { sliding, spinning, rolling };
  Kind kind = Kind::sliding;
  std::size_t row = 1, size = 2;  ///< among the contact's
  double coefficient = 0;
  double regularization = 0;  ///< R_t: velocity per impulse, > 0
  double limit = 0;           ///< radius of the disc, where it is held fixed
  double change = 0;          ///< of the limit that the last solution asks for
};

/// No unknown, or no pair of bodies.
inline constexpr int kNone = -1;

/// A contact: its normal row, then those of its discs. Or a bilateral constraint: one row whose velocity is
/// to vanish, by an impulse of either sign.
struct ContactRows {
  std::array<double, kMostRows> start{};    ///< r0 [m/s, rad/s]; of the normal row less its target velocity
  std::array<double, kMostRows> impulse{};  ///< in: warm start; out: solution
  double regularization = 0;                ///< R of the normal row
  std::array<Disc, 3> discs;
  std::size_t rows = 1, disc_count = 0;
  bool open = true;  ///< no normal impulse; in: in the last step, out: in this one
  bool bilateral = false;
  int pair = kNone;  ///< of the bodies that touch
  /// In the lists.
  std::size_t first_dof = 0, dof_count = 0, first_run = 0, run_count = 0, first_entry = 0, first_wrench = 0;
};

class NewtonRoom {
 public:
  /// Room for the usual contacts. @param entries of A, @param widest unknowns that move a contact
  void reserve(std::size_t n, std::size_t entries, std::size_t widest);
  void swap(NewtonRoom& other);

 protected:
  struct Bound {
    double low, high, side;
  };
  struct Servo {
    double offset = 0, slope = 0, limit = 0, saturated = 0;
    double side(double pull) const { return pull > limit ? 1 : (pull < -limit ? -1 : 0); }
  };
  /// Two bodies that touch.
  struct Pair {
    int a = kNone, b = kNone;
    Vec3 apart = Vec3::Zero();
    std::size_t first_dof = 0, dof_count = 0, first_run = 0, run_count = 0;
  };
  /// A disc that slides.
  struct Column {
    std::size_t contact = 0, disc = 0;
  };

  std::vector<double> A_, g_, start_, x_, F_, sum_, d_, Ad_;
  std::vector<Bound> bounds_;
  std::vector<Servo> servos_;
  std::vector<ContactRows> contacts_;
  std::vector<int> dofs_;
  std::vector<Run> dof_runs_;  ///< the same
  std::vector<Pair> pairs_;
  /// Motions of unknowns, wrenches of contacts; motions of, and wrenches on, what the unknowns carry.
  std::vector<double> motions_, wrenches_, carried_;
  std::vector<double> J_, r_, s_;
  std::vector<Column> columns_;    ///< of C and G
  std::vector<Run> column_range_;  ///< of each chain: columns that have entries there
  std::vector<double> h_;
  std::vector<int> layout_;           ///< what the factor's pattern depends on
  std::vector<std::uint64_t> links_;  ///< bits: later chains that each chain has entries in
};

}  // namespace handsim::engine::articulated
