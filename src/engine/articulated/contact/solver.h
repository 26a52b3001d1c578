// Contacts, joint stops and torque limits of one step: a nonlinear complementarity problem in the change x of
// the joint rates,
//   A x = g + J^T p(r0 + J x) + servos(x),  low <= x <= high.
// A is the joint-space inertia, with the implicit springs and dampers; g is what drives the step without
// contact. Contact is compliant (regularised): the normal impulse is max(0, -r_n / R), friction is Coulomb's
// with a circular cone, -r_t / R_t projected on the disc of radius coefficient times normal impulse. Impulses
// are so functions of the velocities and the unknowns are the joint rates, however many contacts there are
// (the primal formulation of Todorov 2014, "Convex and analytically-invertible dynamics with contacts and
// constraints", ICRA, and of Castro, Permenter and Han 2022, "An unconstrained convex formulation of
// compliant contact", IEEE T-RO). Unlike theirs the law is Coulomb's own, not its convex relaxation: a
// sliding contact does not lift off.
//
// The solution is found by semi-smooth Newton steps (Alart and Curnier 1991, "A mixed formulation for
// frictional contact problems prone to Newton like solution methods", CMAME 92) from the active set of the
// last step; the factor is sparse along the branches of the mechanism (Featherstone 2008, section 6.5). While
// the active set stays, the factor of an earlier problem serves for as long as its steps converge fast (the
// modified Newton method), as they do in a hold. Where the last solution solves the next problem, as it often
// does in a hold, no step is taken.
// Coulomb's law is not the gradient of an energy, so these steps need not converge. Then friction's limits
// are held fixed, which makes the problem convex: Newton's method with an exact line search solves it, and
// the limits are iterated (fixed_limits.cpp). Heaps are solved by block Gauss-Seidel
// (gauss_seidel.cpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/core/pose.h"
#include "handsim/engine/articulated/contact/problem.h"

namespace handsim::engine::articulated {

/// What a solution took and how exact it is.
struct NewtonReport {
  int iterations = 0;      ///< linear systems solved
  int limit_updates = 0;   ///< of friction's limits, where Newton's method alone did not converge
  double residual = 0;     ///< largest error of a rate [rad/s or m/s]
  bool solved = false;     ///< the residual is within the tolerance; always true if `iterative`
  bool iterative = false;  ///< by block Gauss-Seidel: too large for Newton's method
};

class ContactNewton : private NewtonRoom {
 public:
  /// @param kernel must outlive this.
  explicit ContactNewton(const RowKernel& kernel = row_kernel()) : kernel_(kernel) {}

  /// While this lives, problems have the room of the thread, and their solution is lost at its end: thousands
  /// of solvers that take turns need one room. Without it, a solver has its own.
  class Stay {
   public:
    explicit Stay(ContactNewton& solver) : Stay(solver, scratch().whole) {}
    ~Stay() { room_.swap(mine_); }
    Stay(const Stay&) = delete;
    Stay& operator=(const Stay&) = delete;

   private:
    friend class ContactNewton;
    Stay(ContactNewton& solver, NewtonRoom& room) : room_(room), mine_(solver) { room_.swap(mine_); }
    NewtonRoom &room_, &mine_;
  };

  /// @param first for every unknown i the least j <= i with A_ij not zero, whatever the state.
  void resize(std::span<const int> first);
  /// The unknowns that the problems to come have: those of whole trees, ascending, of the numbers given to
  /// `resize`. From here on they are numbered by their place among these. @returns whether they changed
  bool select(std::span<const int> unknowns);
  int size() const { return n_; }
  /// Starts a new problem: A and g zero, no contacts, bounds or servos.
  void begin();
  /// A's entry, i <= j.
  double& inertia(int i, int j) { return A_[entry(i, j)]; }
  std::span<double> drive() { return g_; }
  /// Where the iteration starts; zero where nothing better is known.
  std::span<double> start() { return start_; }
  /// Bounds x_i; `side` -1 or 1: starts on the lower or the upper bound.
  void bound(int i, double low, double high, double side);
  /// Adds offset - slope x_i, clamped to +-limit, to the right side.
  void servo(int i, double offset, double slope, double limit, double saturated);
  /// Adds a contact that depends on the given unknowns, one at least, in ascending order. The caller fills in
  /// its J, rows by unknowns.
  ContactRows& add(std::span<const int> dofs, std::size_t rows);
  std::span<double> jacobian(const ContactRows& contact) {
    return {J_.data() + contact.first_entry, contact.rows * contact.dof_count};
  }
  /// How an unknown moves what it carries, at the origin of its tree [kSpatial numbers].
  double* motion(int i) { return motions_.data() + kSpatial * static_cast<std::size_t>(i); }
  /// Two bodies, by the unknowns that carry them last, or kNone; `dofs`: what moves one against the other,
  /// one at least.
  /// @param apart from b's origin to a's [m]
  void add_pair(int a, int b, const Vec3& apart, std::span<const int> dofs);
  /// Adds a contact of the last pair. The caller fills in its wrenches on body a at a's origin, one for each
  /// row.
  ContactRows& add_contact(std::size_t rows);
  double* wrenches(const ContactRows& contact) { return wrenches_.data() + kSpatial * contact.first_wrench; }

  /// Starts from `start` and from the active set that `open`, `slides` and the bounds' sides say. Where
  /// Coulomb's law is not met to the tolerance, the result is the solution with fixed friction limits that
  /// comes nearest to it; `residual` says how near.
  /// @param tolerance of rates [rad/s or m/s]
  NewtonReport solve(double tolerance);

  /// The factor, which the next problem may use again.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  void forget_factor();

  std::span<const double> x() const { return x_; }
  std::span<const ContactRows> contacts() const { return contacts_; }
  ContactRows& contact(std::size_t i) { return contacts_[i]; }
  double side(int i) const { return bounds_[static_cast<std::size_t>(i)].side; }
  double saturated(int i) const { return servos_[static_cast<std::size_t>(i)].saturated; }

 private:
  /// An island of more unknowns is a heap: more than two hands with what they hold, or a dozen loose bodies.
  /// Chosen.
  static constexpr int kHeap = 72;
  static double end_of(const Bound& bound) { return bound.side < 0 ? bound.low : bound.high; }
  enum class Law {
    coulomb,
    active_set,   ///< of the last step: as `open`, `slides` and `saturated` say, whatever the velocities
    fixed_limits  ///< friction's limits are Disc::limit, whatever the normal impulse; bounds are penalties
  };
  /// First and second derivative of the energy along a direction.
  struct Slope {
    double value = 0, rise = 0;
  };

  /// Index of entry (i, j) in A and in M, j from i to the row's last column: packed rows.
  std::size_t entry(int i, int j) const {
    return A_start_[static_cast<std::size_t>(i)] + static_cast<std::size_t>(j);
  }
  std::size_t M_entry(int i, int j) const {
    return M_start_[static_cast<std::size_t>(i)] + static_cast<std::size_t>(j);
  }
  void list_dofs(std::span<const int> dofs);
  void find_jacobians();
  void find_jacobian(const ContactRows& contact);
  void multiply_rows(const double* x, double* out);
  void find_relative_motion(const Pair& pair, double* out) const;
  void add_pair_wrench(const Pair& pair, const double* wrench);
  double* motion_of(int body) { return carried_.data() + kSpatial * place_of(body); }
  const double* motion_of(int body) const { return carried_.data() + kSpatial * place_of(body); }
  std::size_t place_of(int body) const { return static_cast<std::size_t>(body == kNone ? n_ : body); }

  void lay_out(std::span<const int> first);
  bool lay_out_some(std::span<const int> unknowns, const ContactNewton* whole);
  std::size_t widest() const;
  void reserve(const ContactNewton& like, NewtonRoom& room);
  void clear();
  void find_islands();
  void list_islands();
  int island_of(const ContactRows& contact) const {
    const auto tree = static_cast<std::size_t>(tree_of_[static_cast<std::size_t>(dofs_[contact.first_dof])]);
    return island_of_tree_[tree];
  }
  static std::span<const int> part(const std::vector<int>& all, const std::vector<int>& first, int island) {
    const auto i = static_cast<std::size_t>(island);
    return {all.data() + first[i], all.data() + first[i + 1]};
  }
  std::span<const int> members(int island) const { return part(members_, first_member_, island); }
  std::span<const int> touching(int island) const { return part(touching_, first_touching_, island); }
  void load_island(const ContactNewton& whole, int island);
  void load_dofs(const ContactNewton& whole, const ContactRows& contact);
  void load_pair(const ContactNewton& whole, int pair);
  void store_island(ContactNewton& whole, int island) const;
  NewtonReport solve_island(double tolerance);
  void find_chains();
  void find_structure(std::span<const ContactRows> contacts);
  std::span<const Run> runs(const Chain& chain) const {
    return {runs_.data() + chain.first_run, chain.run_count};
  }
  std::span<const Run> runs(const ContactRows& contact) const {
    return {dof_runs_.data() + contact.first_run, contact.run_count};
  }
  std::size_t lay_out_rows(std::span<const int> last, std::vector<std::size_t>& start) const;
  double factor_work() const;
  static void apply_law(ContactRows& contact, const double* r, Law law);
  double bound_compliance(int i) const;
  /// Held on a bound.
  bool kept(int i) const {
    return law_ != Law::fixed_limits && bounds_[static_cast<std::size_t>(i)].side != 0;
  }
  void evaluate_residual(Law law);
  void find_row_velocities(bool still);
  void add_contact_impulses();
  void find_rounding();
  double largest_residual() const;
  double residual(double tolerance);
  bool release_bounds();
  bool solved(double tolerance, NewtonReport& report);
  /// Minus the derivative of a disc's impulse by its velocity: xx, xy, yy.
  static std::array<double, 3> stiffness(const Disc& disc) {
    if (!disc.slides) return {1 / disc.regularization, 0, 1 / disc.regularization};
    return {disc.tangent_stiffness * (1 - disc.force_x * disc.slip_x),
            -0.5 * disc.tangent_stiffness * (disc.force_x * disc.slip_y + disc.force_y * disc.slip_x),
            disc.tangent_stiffness * (1 - disc.force_y * disc.slip_y)};
  }
  void update_structure();
  void find_active_set();
  bool factor_fits();
  bool reuse_factor(double tolerance, NewtonReport& report);
  bool solved_by_old_factor(double tolerance, NewtonReport& report);
  bool starts_solved(double tolerance, NewtonReport& report);
  void find_factor();
  void assemble();
  void add_stiffness(const ContactRows& contact);
  Triangle A() { return {A_.data(), A_start_.data()}; }
  Factor factor() { return {{M_.data(), M_start_.data()}, chains_.data(), chains_.size(), runs_.data()}; }
  Coupling coupling() {
    return {column_range_.data(), columns_.size(), C_.data(), G_.data(), K_.data(), h_.data(),
            pivots_.data()};
  }
  const double* entries(const ContactRows& contact) const {
    return (contact.pair == kNone ? J_ : scratch().J).data() + contact.first_entry;
  }
  /// Rows of a contact from one of them on.
  RowBlock rows(const ContactRows& contact, std::size_t first, std::size_t count) const {
    return {entries(contact) + first * contact.dof_count, count, contact.dof_count,
            dof_runs_.data() + contact.first_run, contact.run_count};
  }
  RowBlock rows(const ContactRows& contact) const { return rows(contact, 0, contact.rows); }
  /// x = M^-1 x, of a range of unknowns that no entry joins to others.
  void solve_tree(double* x, int first, int last) {
    const std::size_t chain = chain_of_[static_cast<std::size_t>(first)],
                      end = chain_of_[static_cast<std::size_t>(last)] + 1;
    kernel_.eliminate(factor(), x, chain, end);
    kernel_.substitute_back(factor(), x, chain, end);
  }
  void list_columns();
  void size_columns();
  void add_coupling();
  void add_column(std::size_t column);
  void find_newton_step(NewtonReport& report);
  void update_directions();
  void advance(double share);
  void newton_steps(int most, double tolerance, NewtonReport& report);
  Slope energy_slope(double share) const;
  double line_search();
  bool minimise(double tolerance, NewtonReport& report);
  double update_limits(double relaxation, double most);
  void predict_limits(NewtonReport& report);
  void restart_limits(double multiple);
  void iterate_limits(double tolerance, NewtonReport& report);

  /// A block of Gauss-Seidel: a contact, a stop or a servo.
  struct Block {
    enum class Kind { contact, stop, servo };
    Kind kind = Kind::contact;
    std::size_t index = 0, rows = 1;  ///< contact or unknown
    std::size_t first_range = 0, range_count = 0, first_entry = 0;
    std::array<double, kMostRows * kMostRows> D{};  ///< diagonal block of J A^-1 J^T
    double impulse = 0;                             ///< of a stop or servo
  };
  struct Range {
    int first = 0, last = 0;  ///< unknowns, last included
  };
  void add_block(Block block);
  void add_blocks();
  double solve_block(Block& block);
  double solve_contact(const Block& block);
  void apply_impulse(const Block& block, std::size_t row, double impulse);
  double velocity(const Block& block, std::size_t row) const;
  void gauss_seidel(double tolerance, NewtonReport& report);

  /// A solution with fixed limits, and its residual with Coulomb's law.
  struct Solution {
    std::vector<double> x;
    std::vector<ContactRows> contacts;
    std::vector<Bound> bounds;
    std::vector<Servo> servos;
    double residual = 0;
  };

  /// What a solution changes of a contact.
  struct Outcome {
    std::array<double, kMostRows> impulse{};
    std::array<Sliding, 3> discs;
    bool open = false;
  };
  void keep_start();
  void back_to_start();
  bool keeps_active_set() const;

  /// What is needed within a solution only: one for each thread, however many solvers there are.
  struct Scratch {
    Solution latest, best;
    std::vector<Outcome> start;  ///< of the contacts
    std::vector<double> J;       ///< of contacts of pairs
    NewtonRoom whole, part;      ///< of solvers, and of those of their islands
    std::vector<Block> blocks;
    std::vector<Range> ranges;
    std::vector<double> Y;  ///< A^-1 J^T of the blocks' rows, over their ranges
  };
  static Scratch& scratch();

  const RowKernel& kernel_;
  int n_ = 0;
  std::vector<int> first_;             ///< as given to `resize`
  std::vector<int> A_first_, A_last_;  ///< last column of a row of A
  std::vector<int> parent_;            ///< the next unknown up the tree; n_ for a root
  std::vector<int> last_;              ///< last column of a row of the factor
  std::vector<std::size_t> A_start_, M_start_;
  std::vector<Chain> chains_;
  std::vector<std::size_t> chain_of_;  ///< of each unknown
  std::vector<Run> runs_;
  std::vector<Run> trees_;
  std::vector<int> tree_of_;                 ///< of each unknown
  std::vector<int> tree_first_, tree_last_;  ///< first and last unknown of each unknown's tree
  Law law_ = Law::coulomb;
  std::size_t A_size_ = 0;
  std::vector<double> M_;
  bool whole_ = false;           ///< x_ has changed by d_ since the last evaluation
  bool rounding_known_ = false;  ///< sum_ is of the last evaluation
  int islands_ = 0;
  std::vector<int> island_of_tree_;  ///< trees that contacts and loops couple
  std::vector<int> place_;           ///< index of each unknown in its island
  /// Unknowns and contacts island by island, and where each island's begin.
  std::vector<int> members_, first_member_, touching_, first_touching_;
  std::unique_ptr<ContactNewton> part_;        ///< solves islands one by one
  std::vector<int> loaded_;                    ///< unknowns, by the numbers given to the whole's `resize`
  std::vector<int> own_first_, next_;          ///< A_first_ in the making
  std::size_t entries_ = 0, own_entries_ = 0;  ///< of J; of contacts without a pair, in J_
  bool jacobians_known_ = false;
  /// Friction's dependence on the normal impulse: M - C G^T is the whole (unsymmetric) derivative. C and G
  /// are unknowns by columns.
  std::vector<double> C_, G_, K_;
  std::vector<std::size_t> pivots_;
  /// What the factor's pattern depends on: unknowns and contacts of the last problem. And whether that
  /// pattern has been found.
  std::vector<int> laid_out_;
  bool structured_ = false;
  /// Active set of this problem, and of the factor; empty: there is no factor.
  std::vector<int> active_, factored_;
  static constexpr int kMostFailures = 5;
  /// How often in a row the factor of an earlier problem did not do, and how many problems pass before it is
  /// tried again.
  int failures_ = 0, problems_to_pass_ = 0;
};

}  // namespace handsim::engine::articulated
