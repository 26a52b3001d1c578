// The chosen numbers of the contact solver and the signs of wrong ones. Words in quotes are in summary.json.
#pragma once

#include <array>

namespace handsim::engine::articulated {

struct Tuning {
  // The contact law (contact_rows.cpp).
  /// Regularisation R of rigid contacts along the normal and across it, as a share of the inverse masses of
  /// the two bodies (Todorov 2014 scales R in the same way). It makes impulses unique where joints, stops and
  /// other contacts leave them undetermined. What friction holds creeps by 3e-5 um/s under a body's weight at
  /// 1 ms, and surfaces sink to the contact layer by 0.03 um/s. With a tenth of R_t grasps take up to 16 %
  /// more Newton steps, with ten times as much fingers of 5 g that press with 10 N creep by 2 um/s.
  double normal_regularization = 1e-5, friction_regularization = 1e-7;
  /// Regularisation of the rows of loops, as a share of the inverse inertia along them. What it lets open is
  /// closed after the step. Too large: loops drift within a step; too small: steps fail to converge.
  double loop_regularization = 1e-8;
  /// Joints can make bodies harder to slide than their masses say: a finger of milligrams on a rail. Where
  /// the inertia lets them slide by less than `firm_below` of that, R_t is reduced in proportion, down to
  /// `least_share`. Too small: such fingers creep; too large: more Newton steps.
  double firm_below = 0.1, least_share = 1e-4;
  /// A rigid contact whose bodies are this many times as light as the scene's heaviest may have to carry it,
  /// as a pea carries a box. If a load presses such bodies in faster than `most_yield` [m/s], 10 um a step at
  /// 1 ms, their contact is made stiffer, to `firm_share` of that speed, in `stiffenings` passes at most. Too
  /// large: "penetration" grows; too small: each step is solved many times.
  double light_pair = 1e4, most_yield = 0.01, firm_share = 0.1;
  int stiffenings = 12;

  // Newton's method (newton.cpp).
  /// Largest |F_i| / (A_ii step) [m/s^2, rad/s^2]. Too large: "contact_residual"; too small: fallbacks.
  double tolerance = 1e-4;
  /// A start with a residual within this share of the tolerance is the solution: 1e-5 m/s^2, as steps with an
  /// earlier factor leave. Larger: what is held creeps; smaller: holds take more steps.
  double at_rest = 0.1;
  /// Newton steps from the last active set. Fewer: "steps_by_fixed_friction_limits"; more: slow failures.
  int newton_steps = 15;
  /// Steps with the factor of an earlier problem. After its k-th failure in a row 2^(k-1) - 1 problems pass
  /// without a trial; k - 1 counts up to `most_failures`. Fewer: holds factor in every step; more: wasted
  /// steps.
  int reused_steps = 3, most_failures = 5;
  /// An island of more unknowns is a heap: more than two hands with what they hold, or a dozen loose bodies.
  /// It gets `heap_steps` Newton steps (none above `most_work` multiplications) and falls back to
  /// Gauss-Seidel. Larger: heaps get slow; smaller: hands that hold each other are relaxed ("steps_relaxed").
  int heap = 72, heap_steps = 6;
  double most_work = 5e4;

  /// A step that deepens a pad by more e-folds of its stiffness is shortened. Larger: "contact_sweeps" by
  /// steps that overshoot; smaller: by short ones.
  double most_rises = 1;

  // Fixed limits of friction (fixed_limits.cpp).
  /// Newton steps at fixed limits: at most 45 in 10,000 random drops. And trials of a line search.
  int fixed_steps = 100, searches = 30;
  /// A line search ends where the energy's slope is this share of that at its start, or with a whole step.
  double flat = 0.1;
  /// Compliance of stops as penalties, times the inverse inertia. Larger: stops give; smaller: rounding.
  double stop_compliance = 1e-7;
  /// Updates of the limits, Newton steps with Coulomb's law from the solution of each, and multiplications in
  /// factorisations after which the iteration ends: 0.05 s or less. Fewer: "lcp_failures".
  int limit_updates = 240, steps_from_fixed = 6;
  double most_fallback_work = 1.2e7;
  /// After so many updates the limits start anew, at these multiples of the largest normal impulse by turns:
  /// from large ones sticking solutions are found, from small ones sliding solutions.
  int restart = 40;
  std::array<double, 5> restart_at = {10, 0.3, 2, 0.05, 1};
  /// Largest relaxation factor of an update, and that of every fourth: small ones end limit cycles, large
  /// ones speed up slow convergence; its growth while updates grow, to 100 times the largest.
  double short_relaxation = 0.7, long_relaxation = 1000, growth = 2;
  /// From this update on every fourth moves limits by this share to a Newton step's for Coulomb's law.
  int predicted_updates = 80;
  double predicted_share = 0.5;

  // Gauss-Seidel (gauss_seidel.cpp).
  /// Sweeps, as quick_step's default; every other one in the opposite order. Fewer: heaps sink.
  int sweeps = 20;
};
inline constexpr Tuning kTuning;

}  // namespace handsim::engine::articulated
