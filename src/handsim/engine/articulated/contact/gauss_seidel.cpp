// Heaps: block Gauss-Seidel with projection, contact by contact (Jourdan, Alart and Jean 1998, "A
// Gauss-Seidel like algorithm to solve frictional contact problems", CMAME 155), instead of Newton's method,
// whose linear systems grow with the square of the island. Contacts start from the impulses of the last step.
// Rates and impulses agree at any time; after the last sweep the contact law holds to the residual.
#include <algorithm>
#include <cmath>

#include "handsim/engine/articulated/contact/gauss_seidel.h"
#include "handsim/engine/articulated/contact/tuning.h"

namespace handsim::engine::articulated {

namespace {

struct Block {
  enum class Kind { contact, stop, servo };
  Kind kind = Kind::contact;
  std::size_t index = 0, rows = 1;  ///< contact or unknown
  std::size_t first_tree = 0, tree_count = 0, first_entry = 0;
  std::array<double, kMostRows * kMostRows> D{};  ///< diagonal block of J A^-1 J^T
  double impulse = 0;                             ///< of a stop or servo
};

/// The impulse p of a pad with p = p(free + D p), by Newton's method in a bracket.
double pad_impulse(const PadPoint& pad, double free, double D, double start) {
  double low = 0, high = std::max(pad.at(free).impulse, 0.0), p = std::clamp(start, low, high);
  for (int i = 0; i < kTuning.searches && high > 0; ++i) {
    const PadPoint::Push push = pad.at(free + D * p);
    const double beyond = p - push.impulse;
    (beyond > 0 ? high : low) = p;
    double next = p - beyond / (1 + D * push.slope);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    if (next == p) break;
    p = next;
  }
  return p;
}

class Sweeps {
 public:
  Sweeps(ContactProblem& p, SparseFactor& factor, Workspace& w) : p_(p), factor_(factor), w_(w) {
    p.compute_jacobians(w.kernel);
    factor.factor_inertia(p, w);
    std::ranges::fill(w.d, 0.0);
    for (std::size_t c = 0; c < p.contacts.size(); ++c)
      add({.kind = Block::Kind::contact, .index = c, .rows = p.contacts[c].rows});
    for (int i = 0; i < p.size(); ++i) {
      if (p.limits[as_index(i)].limit > 0) add({.kind = Block::Kind::servo, .index = as_index(i)});
      if (std::isfinite(p.limits[as_index(i)].low) || std::isfinite(p.limits[as_index(i)].high))
        add({.kind = Block::Kind::stop, .index = as_index(i)});
    }
    p.x = p.g;
    factor.solve_tree(w, p.x.data(), *p.unknowns, {0, p.size()});
    for (const Block& block : blocks_)
      for (std::size_t row = 0; block.kind == Block::Kind::contact && row < block.rows; ++row)
        apply(block, row, p.contacts[block.index].impulse[row]);
  }

  /// @returns the largest change of velocity [m/s, rad/s], infinite where one is no number
  double sweep(bool backwards) {
    double most = 0;
    const std::size_t count = blocks_.size();
    for (std::size_t i = 0; i < count; ++i) {
      const double change = solve(blocks_[backwards ? count - 1 - i : i]);
      if (!std::isfinite(change)) return HUGE_VAL;
      most = std::max(most, change);
    }
    return most;
  }

 private:
  /// Finds A^-1 J^T and the diagonal block of J A^-1 J^T.
  void add(Block block) {
    const bool contact = block.kind == Block::Kind::contact;
    const int own = static_cast<int>(block.index);
    const std::span<const int> dofs = contact ? p_.dofs_of(p_.contacts[block.index]) : std::span(&own, 1);
    const auto J = [&](std::size_t row, std::size_t k) {
      return contact ? p_.entries_of(p_.contacts[block.index])[row * dofs.size() + k] : 1;
    };
    block.first_tree = trees_.size();
    for (const int dof : dofs)
      if (trees_.size() == block.first_tree || dof >= trees_.back().end)
        trees_.push_back(p_.unknowns->tree(dof));
    block.tree_count = trees_.size() - block.first_tree;
    block.first_entry = Y_.size();
    for (std::size_t row = 0; row < block.rows; ++row) {
      std::size_t k = 0;
      for (const Run& tree : trees_of(block)) {
        for (; k < dofs.size() && dofs[k] < tree.end; ++k) w_.d[as_index(dofs[k])] = J(row, k);
        factor_.solve_tree(w_, w_.d.data(), *p_.unknowns, tree);
        for (int i = tree.first; i < tree.end; ++i) {
          Y_.push_back(w_.d[as_index(i)]);
          w_.d[as_index(i)] = 0;
        }
      }
    }
    const std::size_t width = width_of(block);
    for (std::size_t col = 0; col < block.rows; ++col)
      for (std::size_t row = 0; row < block.rows; ++row) {
        double sum = 0;
        std::size_t place = block.first_entry + col * width, k = 0;
        for (const Run& tree : trees_of(block)) {
          for (; k < dofs.size() && dofs[k] < tree.end; ++k)
            sum += J(row, k) * Y_[place + as_index(dofs[k] - tree.first)];
          place += as_index(tree.size());
        }
        block.D[row * kMostRows + col] = sum;
      }
    blocks_.push_back(block);
  }

  std::span<const Run> trees_of(const Block& block) const {
    return {trees_.data() + block.first_tree, block.tree_count};
  }
  std::size_t width_of(const Block& block) const {
    std::size_t width = 0;
    for (const Run& tree : trees_of(block)) width += as_index(tree.size());
    return width;
  }

  /// Velocity of a contact's row, without R times its impulse.
  double velocity(const ContactRows& contact, std::size_t row) const {
    const double* J = p_.entries_of(contact) + row * contact.dof_count;
    double out = contact.r0[row];
    for (const int dof : p_.dofs_of(contact)) out += *J++ * p_.x[as_index(dof)];
    return out;
  }

  /// x += A^-1 J^T impulse of a row.
  void apply(const Block& block, std::size_t row, double impulse) {
    if (impulse == 0) return;
    const double* Y = Y_.data() + block.first_entry + row * width_of(block);
    for (const Run& tree : trees_of(block))
      for (int i = tree.first; i < tree.end; ++i) p_.x[as_index(i)] += *Y++ * impulse;
  }

  /// Solves one block with all others fixed. @returns the largest change of velocity [m/s, rad/s]
  double solve(Block& block) {
    if (block.kind == Block::Kind::contact) return solve_contact(block);
    const double D = block.D[0], free = p_.x[block.index] - D * block.impulse;
    double next = 0;
    if (block.kind == Block::Kind::servo) {
      Limits& servo = p_.limits[block.index];
      next =
          std::clamp((servo.offset - servo.slope * free) / (1 + servo.slope * D), -servo.limit, servo.limit);
      servo.saturated =
          next >= servo.limit ? LimitSide::high : (next <= -servo.limit ? LimitSide::low : LimitSide::within);
    } else {
      Limits& bound = p_.limits[block.index];
      next = (std::clamp(free, bound.low, bound.high) - free) / D;
      bound.side = next > 0 ? LimitSide::low : (next < 0 ? LimitSide::high : LimitSide::within);
    }
    const double change = next - block.impulse;
    apply(block, 0, change);
    block.impulse = next;
    return std::abs(change) * D;
  }

  /// The normal row, then each disc with the new normal impulse.
  double solve_contact(const Block& block) {
    const double D = block.D[0];
    ContactRows& contact = p_.contacts[block.index];
    double& normal = contact.impulse[0];
    double next = contact.pad ? pad_impulse(*contact.pad, velocity(contact, 0) - D * normal, D, normal)
                              : normal - (velocity(contact, 0) + contact.regularization * normal) /
                                             (D + contact.regularization);
    if (!contact.bilateral) next = std::max(next, 0.0);
    double change = std::abs(next - normal) * D;
    apply(block, 0, next - normal);
    normal = next;
    contact.open = !contact.bilateral && !(normal > 0);
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = contact.discs[k];
      double* p = contact.impulse.data() + disc.row;
      const bool two = disc.size > 1;
      const auto entry_of = [&](std::size_t i, std::size_t j) {
        return block.D[(disc.row + i) * kMostRows + disc.row + j];
      };
      const double xx = entry_of(0, 0) + disc.regularization,
                   yy = two ? entry_of(1, 1) + disc.regularization : 0, xy = two ? entry_of(0, 1) : 0;
      // The larger eigenvalue: a step by it overshoots in no direction.
      const double largest = 0.5 * (xx + yy) + std::sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
      const double vx = velocity(contact, disc.row) + disc.regularization * p[0];
      const double vy = two ? velocity(contact, disc.row + 1) + disc.regularization * p[1] : 0;
      double x = p[0] - vx / largest, y = two ? p[1] - vy / largest : 0;
      const double size = std::sqrt(x * x + y * y), limit = disc.coefficient * normal;
      disc.slides = size > limit;
      if (disc.slides) {
        x *= limit / size;
        y *= limit / size;
        disc.slip_x = disc.force_x = -x / std::max(limit, 1e-300);
        disc.slip_y = disc.force_y = -y / std::max(limit, 1e-300);
        disc.tangent_stiffness =
            limit / std::max(std::sqrt(vx * vx + vy * vy), limit * disc.regularization + 1e-300);
      }
      change = std::max({change, std::abs(x - p[0]) * largest, two ? std::abs(y - p[1]) * largest : 0});
      apply(block, disc.row, x - p[0]);
      p[0] = x;
      if (!two) continue;
      apply(block, disc.row + 1, y - p[1]);
      p[1] = y;
    }
    return change;
  }

  ContactProblem& p_;
  SparseFactor& factor_;
  Workspace& w_;
  std::vector<Block> blocks_;
  std::vector<Run> trees_;
  std::vector<double> Y_;  ///< A^-1 J^T of the blocks' rows, over their trees
};

}  // namespace

void solve_gauss_seidel(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance,
                        NewtonReport& report) {
  report.iterative = true;
  Sweeps sweeps(p, factor, w);
  bool converged = false;
  for (int i = 0; i < kTuning.sweeps && !converged; ++i) {
    report.residual = sweeps.sweep(i % 2 != 0);
    converged = report.residual <= tolerance;
    ++report.iterations;
  }
  report.solved = std::isfinite(report.residual);
}

}  // namespace handsim::engine::articulated
