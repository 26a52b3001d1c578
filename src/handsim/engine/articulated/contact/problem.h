// Contacts, joint stops and torque limits of one step: a nonlinear complementarity problem in the change x of
// the joint rates,
//   A x = g + J^T p(r0 + J x) + servos(x),  low <= x <= high.
// A is the joint-space inertia, with the implicit springs and dampers; g is what drives the step without
// contact. Contact is compliant (regularised): the normal impulse is max(0, -r_n / R), or falls with r_n as a
// pad's law says (PadPoint), whose inverse slope is then R at the last evaluation. Friction is Coulomb's
// with a circular cone, -r_t / R_t projected on the disc of radius coefficient times normal impulse. Impulses
// are so functions of the velocities and the unknowns are the joint rates, however many contacts there are
// (the primal formulation of Todorov 2014, "Convex and analytically-invertible dynamics with contacts and
// constraints", ICRA, and of Castro, Permenter and Han 2022, "An unconstrained convex formulation of
// compliant contact", IEEE T-RO). Unlike theirs the law is Coulomb's own, not its convex relaxation: a
// sliding contact does not lift off. islands.h says how it is solved.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "handsim/core/pose.h"
#include "handsim/engine/articulated/contact/unknowns.h"
#include "handsim/engine/collision/pad_memory.h"

namespace handsim::engine::articulated {

/// The usual numbers of contacts, of their rows and of discs that slide: room for them is made at the start.
inline constexpr std::size_t kUsualContacts = 16, kUsualRows = 4, kUsualSliding = 6;
inline constexpr std::size_t kMostRows = 6;  ///< of a contact

/// The position of a value against its two limits.
enum class LimitSide : signed char { low = -1, within = 0, high = 1 };
constexpr int sign(LimitSide side) { return static_cast<int>(side); }
/// @param sign -1, 0 or 1
constexpr LimitSide side_of(double sign) { return static_cast<LimitSide>(static_cast<int>(sign)); }

/// Friction on the edge of its disc, and which way.
struct Sliding {
  bool slides = false;  ///< the impulse is on the disc's edge
  /// While it slides: direction of slip (unit); direction opposite to the impulse, as a share of the limit;
  /// limit over speed, the stiffness across the slip. Both directions agree in the solution.
  double slip_x = 1, slip_y = 0, force_x = 1, force_y = 0, tangent_stiffness = 0;
};

/// Rows with impulses in a disc of radius `coefficient` x normal impulse: sliding, rolling (2), spinning (1).
struct Disc : Sliding {
  enum class Kind { sliding, spinning, rolling };
  Kind kind = Kind::sliding;
  std::size_t row = 1, size = 2;  ///< among the contact's
  double coefficient = 0;
  double regularization = 0;  ///< R_t: velocity per impulse, > 0
  double limit = 0;           ///< radius of the disc, where it is held fixed
  double change = 0;          ///< of the limit that the last solution asks for
};

inline constexpr int kNone = -1;  ///< No unknown, or no pair of bodies.

/// The unknowns that rows depend on, in ContactProblem::dofs, and the same as runs, in ContactProblem::runs.
struct Dofs {
  std::size_t first_dof = 0, dof_count = 0, first_run = 0, run_count = 0;
};

/// A contact: normal row and rows of its discs. Or a bilateral constraint: a row whose velocity is to vanish.
struct ContactRows : Dofs {
  std::array<double, kMostRows> r0{};  ///< velocities at x = 0 [m/s, rad/s]; the normal one less its target
  std::array<double, kMostRows> impulse{};  ///< in: warm start; out: solution
  double regularization = 0;                ///< R of the normal row
  const PadPoint* pad = nullptr;            ///< instead: the law of the normal row, whose target is 0
  std::array<Disc, 3> discs;
  std::size_t rows = 1, disc_count = 0;
  bool open = true;  ///< no normal impulse; in: in the last step, out: in this one
  bool bilateral = false;
  int pair = kNone;                               ///< of the bodies that touch
  std::size_t first_entry = 0, first_wrench = 0;  ///< in ContactProblem::J and ContactProblem::wrenches
};

/// The limits of an unknown: its bounds; and the servo that acts on it, which adds offset - slope x, clamped
/// to +-limit, to the right side of the equation. There is no servo where `limit` is 0.
struct Limits {
  double low, high;                         ///< bounds
  LimitSide side = LimitSide::within;       ///< in: it starts on the bound; out: the bound holds it
  bool bounced = false;                     ///< a restitution has moved the bound
  double offset = 0, slope = 0, limit = 0;  ///< of the servo
  LimitSide saturated = LimitSide::within;  ///< in: in the last step; out: in this one
  double bound() const { return side == LimitSide::low ? low : high; }
  LimitSide side_of_pull(double pull) const {
    return pull > limit ? LimitSide::high : (pull < -limit ? LimitSide::low : LimitSide::within);
  }
  double torque(double pull) const { return saturated == LimitSide::within ? pull : sign(saturated) * limit; }
};

/// Two bodies that touch, by the unknowns that carry them last, or kNone.
struct Pair : Dofs {
  int a = kNone, b = kNone;
  Vec3 apart = Vec3::Zero();  ///< from b's origin to a's [m]
};

/// The part of a problem that a solution changes: x, the impulses, and the active set.
struct Iterate {
  std::vector<double> x;
  std::vector<ContactRows> contacts;
  std::vector<Limits> limits;
  void reserve(std::size_t n) {
    reserve_each(n, x, limits);
    contacts.reserve(kUsualContacts);
  }
};

/// The numbers of a problem and of its solution.
struct ContactProblem : Iterate {
  const Unknowns* unknowns = nullptr;
  std::vector<double> A, g;
  std::vector<double> start;  ///< where the iteration starts; zero where nothing better is known
  std::vector<int> dofs;
  std::vector<Run> runs;
  std::vector<Pair> pairs;
  /// Motion of all that an unknown carries at a rate of 1, at its tree's origin; wrenches of rows on body a,
  /// at a's origin. kSpatial numbers each.
  std::vector<double> motions, wrenches;
  std::vector<double> J;    ///< rows by unknowns; of pairs only where `with_jacobians`
  std::size_t entries = 0;  ///< of J
  bool with_jacobians = false;

  /// Starts a new problem: A and g zero, no contacts, bounds or servos.
  void reset(const Unknowns& of);
  void reserve(const Unknowns& most);
  int size() const { return unknowns->size(); }
  Iterate& iterate() { return *this; }
  /// A's entry, i <= j.
  double& inertia(int i, int j) { return A[unknowns->row_start[as_index(i)] + as_index(j)]; }
  double inertia(int i) const { return A[unknowns->row_start[as_index(i)] + as_index(i)]; }
  double* motion(int i) { return motions.data() + kSpatial * as_index(i); }
  /// Adds a contact on these unknowns (at least one, in ascending order). The caller fills in its J.
  ContactRows& add(std::span<const int> of, std::size_t rows);
  std::span<double> jacobian(const ContactRows& contact) {
    return {J.data() + contact.first_entry, contact.rows * contact.dof_count};
  }
  /// Two bodies; `of`: what moves one against the other, one at least.
  void add_pair(int a, int b, const Vec3& apart, std::span<const int> of);
  /// Adds a contact of the last pair. The caller fills in its wrenches.
  ContactRows& add_contact(std::size_t rows);
  double* wrenches_of(const ContactRows& contact) {
    return wrenches.data() + kSpatial * contact.first_wrench;
  }
  /// J of all pairs.
  void compute_jacobians(const RowKernel& kernel);

  std::span<const int> dofs_of(const Dofs& of) const { return {dofs.data() + of.first_dof, of.dof_count}; }
  std::span<const Run> runs_of(const Dofs& of) const { return {runs.data() + of.first_run, of.run_count}; }
  const double* entries_of(const ContactRows& contact) const { return J.data() + contact.first_entry; }
  /// Rows of a contact from one of them on.
  RowBlock block(const ContactRows& contact, std::size_t first, std::size_t count) const {
    return {entries_of(contact) + first * contact.dof_count, count, contact.dof_count,
            runs.data() + contact.first_run, contact.run_count};
  }

 private:
  void list(Dofs& out, std::span<const int> of);
};

/// Asserts what solvers rely on: sizes, A's pattern, order of unknowns, rows and limits. Nothing with NDEBUG.
void check(const ContactProblem& p);

}  // namespace handsim::engine::articulated
