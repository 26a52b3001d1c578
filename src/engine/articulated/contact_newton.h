// The impulses of contacts, joint stops and torque limits in a step, found together: the change x of the
// joint rates obeys
//   A x = g + J^T p(r0 + J x) + servos(x),  low <= x <= high,
// A being the joint-space inertia, springs and dampers in it, and g what drives it without contact. The
// normal impulse is max(0, -r_n / softness), friction Coulomb's with the true cone: -r_t / softness, cut to
// the coefficient times the normal impulse. The softness makes impulses the velocities' own function, so that
// the unknowns are the joint rates however many contacts there are.
//
// Semi-smooth Newton steps on that equation (Alart and Curnier 1991), sparse along the branches of the
// mechanism, from what was in force in the last step. They are quick and find nearly all solutions, but
// Coulomb's friction is the slope of no energy, so that nothing makes them converge. Where they do not,
// friction's limits are held and updated from outside (contact_newton_limits.cpp): that cannot fail to give a
// step.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace handsim::engine::articulated {

/// So many are solved without allocating.
inline constexpr std::size_t kUsualContacts = 64;
inline constexpr std::size_t kMostRows = 6;  ///< of a contact

/// Rows that take at most `coefficient` times the normal impulse together: two of sliding or rolling, one of
/// spinning.
struct Disc {
  enum class Kind { sliding, spinning, rolling };
  Kind kind = Kind::sliding;
  std::size_t row = 1, size = 2;  ///< among the contact's
  double coefficient = 0;
  double softness = 0;  ///< velocity per impulse, > 0
  double limit = 0;     ///< of the impulse, where it is fixed
  double change = 0;    ///< that the last solution asked of it
  bool slides = false;  ///< the limit is in force
  /// Where it slides: which way (unit), against which way it pushes, as a share of the limit, and limit over
  /// speed. Both ways agree in the solution.
  double x = 1, y = 0, px = 1, py = 0, lateral = 0;
};

/// A contact: its normal row, then those of its discs. Or a tie: one row that is to stand still, whichever
/// way it has to be pushed.
struct ContactRows {
  std::array<double, kMostRows>
      start{};  ///< r0 [m/s, rad/s]; normal: less the velocity that it is to have at least
  std::array<double, kMostRows> impulse{};  ///< in: to start from; out
  double softness = 0;                      ///< of the normal row, as a disc has it
  std::array<Disc, 3> discs;
  std::size_t rows = 1, disc_count = 0;
  bool open = true;  ///< in: as it was in the last step; out
  bool tie = false;
  std::size_t first_dof = 0, dof_count = 0, first_entry = 0;  ///< in the solver's lists
};

/// How far a solution got.
struct NewtonReport {
  int iterations = 0;      ///< systems solved
  int limit_updates = 0;   ///< of friction's limits, where Newton's method alone did not find the solution
  double residual = 0;     ///< most that a rate may be off by [rad/s or m/s]
  bool solved = false;     ///< the residual is within the tolerance, but where `iterative`
  bool iterative = false;  ///< by relaxation: too large for Newton's method
};

class ContactNewton {
 public:
  /// @param first for every unknown i the least j <= i with A_ij not zero, whatever the state.
  void resize(std::span<const int> first);
  int size() const { return n_; }
  /// Empties the problem: A, g zero, no contacts, bounds or servos.
  void begin();
  /// A's entry, i <= j.
  double& inertia(int i, int j) { return A_[entry(i, j)]; }
  std::span<double> drive() { return g_; }
  /// Keeps x_i within bounds; `side` -1, 1: starts on one.
  void bound(int i, double low, double high, double side);
  /// Adds offset - slope x_i to the right side, cut to +-limit.
  void servo(int i, double offset, double slope, double limit, double saturated);
  /// Adds a contact that moves with some unknowns, ascending; its J, rows by unknowns, is to be filled in.
  ContactRows& add(std::span<const int> dofs, std::size_t rows);
  std::span<double> jacobian(const ContactRows& contact) {
    return {J_.data() + contact.first_entry, contact.rows * contact.dof_count};
  }

  /// Starts from x = 0 and from what `open`, `slides` and the bounds' sides name. Where Coulomb's law is not
  /// found to the tolerance, the result is a step whose friction has limits of other normal impulses than its
  /// own; `residual` says what that comes to.
  /// @param tolerance of rates [rad/s or m/s]
  NewtonReport solve(double tolerance);

  std::span<const double> x() const { return x_; }
  std::span<const ContactRows> contacts() const { return contacts_; }
  ContactRows& contact(std::size_t i) { return contacts_[i]; }
  double side(int i) const { return bounds_[static_cast<std::size_t>(i)].side; }
  double saturated(int i) const { return servos_[static_cast<std::size_t>(i)].saturated; }

 private:
  struct Bound {
    double low, high, side;
  };
  struct Servo {
    double offset = 0, slope = 0, limit = 0, saturated = 0;
  };
  enum class Law {
    coulomb,
    as_it_was,    ///< the parts of it that `open`, `slides` and `saturated` name, whatever the velocities
    fixed_limits  ///< friction's limits are Disc::limit, whatever the normal impulse; bounds are stiff
                  ///< springs
  };
  /// Derivative of the energy along a direction, and its own.
  struct Slope {
    double value = 0, rise = 0;
  };

  /// Where A and M have entry (i, j), j from i to the row's last: rows stand one after the other.
  std::size_t entry(int i, int j) const {
    return A_start_[static_cast<std::size_t>(i)] + static_cast<std::size_t>(j);
  }
  std::size_t M_entry(int i, int j) const {
    return M_start_[static_cast<std::size_t>(i)] + static_cast<std::size_t>(j);
  }
  void lay_out(std::span<const int> first);
  void reserve(std::size_t n);
  void find_islands();
  /// What no unknown moves is the first island's.
  int island_of(const ContactRows& contact) const {
    return contact.dof_count > 0 ? island_of_[static_cast<std::size_t>(dofs_[contact.first_dof])] : 0;
  }
  static std::span<const int> part(const std::vector<int>& all, const std::vector<int>& first, int island) {
    const auto i = static_cast<std::size_t>(island);
    return {all.data() + first[i], all.data() + first[i + 1]};
  }
  std::span<const int> members(int island) const { return part(members_, first_member_, island); }
  std::span<const int> touching(int island) const { return part(touching_, first_touching_, island); }
  void load_island(const ContactNewton& whole, int island);
  void store_island(ContactNewton& whole, int island) const;
  NewtonReport solve_island(double tolerance);
  void widen();
  void lay_out(std::span<const int> last, std::vector<std::size_t>& start, std::vector<double>& rows) const;
  double factor_work() const;
  static void apply_law(ContactRows& contact, const double* r, Law law);
  double bound_compliance(int i) const;
  /// On a bound, and not to move.
  bool kept(int i) const {
    return law_ != Law::fixed_limits && bounds_[static_cast<std::size_t>(i)].side != 0;
  }
  void evaluate(Law law);
  double residual() const;
  bool release();
  bool solved(double tolerance, NewtonReport& report);
  /// Of a disc's impulses against its velocities: xx, xy, yy.
  static std::array<double, 3> stiffness(const Disc& disc) {
    if (!disc.slides) return {1 / disc.softness, 0, 1 / disc.softness};
    return {disc.lateral * (1 - disc.px * disc.x),
            -0.5 * disc.lateral * (disc.px * disc.y + disc.py * disc.x),
            disc.lateral * (1 - disc.py * disc.y)};
  }
  void assemble();
  void factor();
  /// Of unknowns that hang together with no others.
  void solve_factored(double* x, int first, int end) const;
  void couple();
  void find_changes();
  void find_step(NewtonReport& report);
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

  /// A row block of relaxation: a contact, a stop or a servo, and what unit impulses in it do.
  struct Block {
    enum class Kind { contact, stop, servo };
    Kind kind = Kind::contact;
    std::size_t index = 0, rows = 1;  ///< contact or unknown
    std::size_t first_range = 0, range_count = 0, first_entry = 0;
    std::array<double, kMostRows * kMostRows> D{};  ///< velocity per impulse, without softness
    double impulse = 0;                             ///< of a stop or servo
  };
  struct Range {
    int first = 0, last = 0;  ///< unknowns, last included
  };
  void add_block(Block block);
  void add_blocks();
  double relax_block(Block& block);
  void move(const Block& block, std::size_t row, double impulse);
  double velocity(const Block& block, std::size_t row) const;
  void relax(double tolerance, NewtonReport& report);

  /// A step, and how far it is from Coulomb's law.
  struct Solution {
    std::vector<double> x;
    std::vector<ContactRows> contacts;
    std::vector<Bound> bounds;
    double residual = 0;
  };

  int n_ = 0;
  std::vector<int> A_first_, A_last_;  ///< last column of a row of A
  std::vector<int> first_, last_;      ///< of the factor
  std::vector<std::size_t> A_start_, M_start_;
  std::vector<int> tree_first_, tree_last_;  ///< unknowns of each one's tree
  Law law_ = Law::coulomb;
  std::vector<double> A_, M_, g_, x_, F_, sum_, d_, Ad_;
  std::vector<Bound> bounds_;
  std::vector<Servo> servos_;
  std::vector<ContactRows> contacts_;
  Solution latest_, nearest_;
  int islands_ = 0;
  std::vector<int> island_of_;  ///< of each unknown: trees that contacts and ties join
  std::vector<int> place_;      ///< of each unknown, in its island
  /// Unknowns and contacts island by island, and where each island's begin.
  std::vector<int> members_, first_member_, touching_, first_touching_;
  std::unique_ptr<ContactNewton> part_;  ///< solves islands one by one
  std::vector<int> part_first_, next_;
  std::vector<Block> blocks_;
  std::vector<Range> ranges_;
  std::vector<double> Y_;  ///< A^-1 J^T of the blocks' rows, over their ranges
  std::vector<int> dofs_;
  std::vector<double> J_, r_, s_;
  /// What a sliding contact's normal impulse does to its friction: M - C G^T is the whole derivative.
  struct Entry {
    std::size_t column = 0;
    int dof = 0;
    double C = 0, G = 0;
  };
  std::vector<Entry> coupling_;
  std::size_t coupled_ = 0;
  std::vector<double> C_, K_;
};

}  // namespace handsim::engine::articulated
