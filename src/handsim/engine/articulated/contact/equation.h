// The contact law at given rates, and the residual F = A x - g - J^T p - servos. A pair's rows are kept
// as wrenches: J x and J^T p are one recursion along the trees; only factors and rounding need J's entries.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "handsim/engine/articulated/contact/problem.h"

namespace handsim::engine::articulated {

enum class Law {
  coulomb,
  active_set,   ///< of the last step: as `open`, `slides` and `saturated` say, whatever the velocities
  fixed_limits  ///< friction's limits are Disc::limit, whatever the normal impulse; bounds are penalties
};

/// Memory in which problems are solved: one for each thread, however many engines there are.
struct Workspace {
  /// @param of_rows must outlive this object.
  explicit Workspace(const RowKernel& of_rows = row_kernel()) : kernel(of_rows) {}
  void reserve(const Unknowns& most);
  void resize(const ContactProblem& problem);

  const RowKernel& kernel;
  ContactProblem problem, island;  ///< the engine's, and an island of it

  // The residual.
  Law law = Law::coulomb;        ///< of the last evaluation: says what a step and a factor are
  std::vector<double> F, r;      ///< residual; row velocities, kMostRows a contact
  std::vector<double> rounding;  ///< sums of the magnitudes of F's terms but A x
  bool rounding_known = false;   ///< these are of the last evaluation
  std::vector<double> carried;   ///< motions of, or wrenches on, what the unknowns carry

  // A step and its line search.
  std::vector<double> d, s;        ///< step, and J d
  std::vector<double> Ad, smooth;  ///< A d, and A x - g

  /// The numbers of a contact that a step changes: two fifths of all.
  struct Outcome {
    std::array<double, kMostRows> impulse{};
    std::array<Sliding, 3> discs;
    bool open = false;
  };
  Iterate before;  ///< steps that may fail; all but its contacts
  std::vector<Outcome> contacts_before;
  Iterate latest, best;  ///< with fixed limits

  std::vector<int> layout, active;   // What the factor is compared with.
  std::vector<std::uint64_t> links;  ///< bits: later chains that each chain has entries in

  // Islands: of each tree; place of each unknown; unknowns and contacts island by island, and where they
  // begin.
  std::vector<int> island_of_tree, place, members, first_member, touching, first_touching, next;
};

/// Minus the derivative of a disc's impulse by its velocity: xx, xy, yy.
inline std::array<double, 3> stiffness(const Disc& disc) {
  if (!disc.slides) return {1 / disc.regularization, 0, 1 / disc.regularization};
  return {disc.tangent_stiffness * (1 - disc.force_x * disc.slip_x),
          -0.5 * disc.tangent_stiffness * (disc.force_x * disc.slip_y + disc.force_y * disc.slip_x),
          disc.tangent_stiffness * (1 - disc.force_y * disc.slip_y)};
}
/// Computes the impulses of a contact at row velocities r, and its active set, which Law::active_set keeps.
void apply_law(ContactRows& contact, const double* r, Law law);
/// The compliance of an unknown's stop where stops are penalties.
double stop_compliance(const ContactProblem& p, int i);
/// out = J x, kMostRows a contact.
void multiply_rows(ContactProblem& p, Workspace& w, const double* x, double* out);
/// Computes the impulses at x, and the residual. @param whole_step x is that of the last evaluation plus d
void evaluate(ContactProblem& p, Workspace& w, Law law, bool whole_step = false);
/// Computes the sums of the magnitudes of the residual's terms, unless they are known.
void compute_rounding(ContactProblem& p, Workspace& w);
/// Largest entry of F as a rate, without rounding where that is known.
double largest_residual(const ContactProblem& p, const Workspace& w);
/// largest_residual(); where it exceeds the tolerance, the rounding is computed and subtracted.
double residual(ContactProblem& p, Workspace& w, double tolerance);
/// Removes bounds whose multiplier has the wrong sign from the active set. @returns whether there were any
bool release_bounds(ContactProblem& p, Workspace& w);

}  // namespace handsim::engine::articulated
