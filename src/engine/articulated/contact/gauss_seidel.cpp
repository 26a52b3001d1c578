// Heaps: block Gauss-Seidel with projection, contact by contact (Jourdan, Alart and Jean 1998, "A
// Gauss-Seidel like algorithm to solve frictional contact problems", CMAME 155), instead of Newton's method,
// whose linear systems grow with the square of the island. Impulses start from those of the last step. Rates
// and impulses agree at any time; after the last sweep the contact law holds to the residual.
#include <algorithm>
#include <cmath>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact/solver.h"

namespace handsim::engine::articulated {

namespace {

/// As many as quick_step has iterations by default; every other one in the opposite order.
constexpr int kSweeps = 20;

}  // namespace

/// Velocity of a block's row, without R times its impulse.
double ContactNewton::velocity(const Block& block, std::size_t row) const {
  if (block.kind != Block::Kind::contact) return x_[block.index];
  const ContactRows& contact = contacts_[block.index];
  const double* J = entries(contact) + row * contact.dof_count;
  double out = contact.start[row];
  for (std::size_t k = 0; k < contact.dof_count; ++k) out += J[k] * x_[at(dofs_[contact.first_dof + k])];
  return out;
}

/// x += A^-1 J^T impulse of a row.
void ContactNewton::apply_impulse(const Block& block, std::size_t row, double impulse) {
  if (impulse == 0) return;
  const std::vector<Range>& ranges = scratch().ranges;
  std::size_t width = 0;
  for (std::size_t k = 0; k < block.range_count; ++k) {
    const Range& range = ranges[block.first_range + k];
    width += at(range.last - range.first + 1);
  }
  const double* Y = scratch().Y.data() + block.first_entry + row * width;
  for (std::size_t k = 0; k < block.range_count; ++k) {
    const Range& range = ranges[block.first_range + k];
    for (int i = range.first; i <= range.last; ++i) x_[at(i)] += *Y++ * impulse;
  }
}

/// Finds A^-1 J^T and the diagonal block of J A^-1 J^T; A is factored in M_.
void ContactNewton::add_block(Block block) {
  const bool contact = block.kind == Block::Kind::contact;
  const int own = static_cast<int>(block.index);
  const std::span<const int> dofs =
      contact ? std::span(dofs_).subspan(contacts_[block.index].first_dof, contacts_[block.index].dof_count)
              : std::span(&own, 1);
  const double* J = contact ? entries(contacts_[block.index]) : nullptr;
  std::vector<Range>& ranges = scratch().ranges;
  std::vector<double>& Y = scratch().Y;
  block.first_range = ranges.size();
  for (const int dof : dofs)
    if (ranges.size() == block.first_range || dof > ranges.back().last)
      ranges.push_back({tree_first_[at(dof)], tree_last_[at(dof)]});
  block.range_count = ranges.size() - block.first_range;
  block.first_entry = Y.size();
  for (std::size_t row = 0; row < block.rows; ++row) {
    std::size_t k = 0;
    for (std::size_t range = block.first_range; range < ranges.size(); ++range) {
      const auto [first, last] = ranges[range];
      for (; k < dofs.size() && dofs[k] <= last; ++k)
        d_[at(dofs[k])] = contact ? J[row * dofs.size() + k] : 1;
      solve_tree(d_.data(), first, last);
      for (int i = first; i <= last; ++i) {
        Y.push_back(d_[at(i)]);
        d_[at(i)] = 0;
      }
    }
  }
  const std::size_t width = (Y.size() - block.first_entry) / block.rows;
  for (std::size_t col = 0; col < block.rows; ++col) {
    for (std::size_t row = 0; row < block.rows; ++row) {
      double sum = 0;
      std::size_t place = block.first_entry + col * width, k = 0;
      for (std::size_t range = block.first_range; range < ranges.size(); ++range) {
        const auto [first, last] = ranges[range];
        for (; k < dofs.size() && dofs[k] <= last; ++k)
          sum += (contact ? J[row * dofs.size() + k] : 1) * Y[place + at(dofs[k] - first)];
        place += at(last - first + 1);
      }
      block.D[row * kMostRows + col] = sum;
    }
  }
  scratch().blocks.push_back(block);
}

void ContactNewton::add_blocks() {
  scratch().blocks.clear();
  scratch().ranges.clear();
  scratch().Y.clear();
  std::fill(d_.begin(), d_.end(), 0.0);
  for (std::size_t c = 0; c < contacts_.size(); ++c)
    add_block({.kind = Block::Kind::contact, .index = c, .rows = contacts_[c].rows});
  for (int i = 0; i < n_; ++i) {
    if (servos_[at(i)].limit > 0) add_block({.kind = Block::Kind::servo, .index = at(i)});
    if (std::isfinite(bounds_[at(i)].low) || std::isfinite(bounds_[at(i)].high))
      add_block({.kind = Block::Kind::stop, .index = at(i)});
  }
}

/// Solves one block with all others fixed. @returns the largest change of velocity [m/s, rad/s]
double ContactNewton::solve_block(Block& block) {
  const double D = block.D[0];
  const auto apply = [&](double now, double next) {
    apply_impulse(block, 0, next - now);
    return std::abs(next - now) * D;
  };
  if (block.kind == Block::Kind::servo) {
    Servo& servo = servos_[block.index];
    const double pull = servo.offset - servo.slope * (x_[block.index] - D * block.impulse);
    const double next = std::clamp(pull / (1 + servo.slope * D), -servo.limit, servo.limit);
    servo.saturated = next >= servo.limit ? 1 : (next <= -servo.limit ? -1 : 0);
    const double change = apply(block.impulse, next);
    block.impulse = next;
    return change;
  }
  if (block.kind == Block::Kind::stop) {
    Bound& bound = bounds_[block.index];
    const double free = x_[block.index] - D * block.impulse;
    const double next = (std::clamp(free, bound.low, bound.high) - free) / D;
    bound.side = next > 0 ? -1 : (next < 0 ? 1 : 0);
    const double change = apply(block.impulse, next);
    block.impulse = next;
    return change;
  }
  return solve_contact(block);
}

/// The normal row, then each disc with the new normal impulse.
double ContactNewton::solve_contact(const Block& block) {
  const double D = block.D[0];
  ContactRows& contact = contacts_[block.index];
  double& normal = contact.impulse[0];
  double next =
      normal - (velocity(block, 0) + contact.regularization * normal) / (D + contact.regularization);
  if (!contact.bilateral) next = std::max(next, 0.0);
  double change = std::abs(next - normal) * D;
  apply_impulse(block, 0, next - normal);
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
    const double vx = velocity(block, disc.row) + disc.regularization * p[0];
    const double vy = two ? velocity(block, disc.row + 1) + disc.regularization * p[1] : 0;
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
    apply_impulse(block, disc.row, x - p[0]);
    p[0] = x;
    if (!two) continue;
    apply_impulse(block, disc.row + 1, y - p[1]);
    p[1] = y;
  }
  return change;
}

void ContactNewton::gauss_seidel(double tolerance, NewtonReport& report) {
  report.iterative = true;
  find_jacobians();
  find_structure({});
  structured_ = false;
  factored_.clear();
  M_start_ = A_start_;
  M_ = A_;
  kernel_.factor(factor());
  add_blocks();
  x_ = g_;
  solve_tree(x_.data(), 0, n_ - 1);
  std::vector<Block>& blocks = scratch().blocks;
  for (const Block& block : blocks)
    if (block.kind == Block::Kind::contact)
      for (std::size_t row = 0; row < block.rows; ++row)
        apply_impulse(block, row, contacts_[block.index].impulse[row]);
  bool converged = false;
  for (int sweep = 0; sweep < kSweeps && !converged; ++sweep) {
    report.residual = 0;
    const std::size_t count = blocks.size();
    for (std::size_t i = 0; i < count; ++i)
      report.residual = std::max(report.residual, solve_block(blocks[sweep % 2 == 0 ? i : count - 1 - i]));
    converged = report.residual <= tolerance;
    ++report.iterations;
  }
  report.solved = true;
}

}  // namespace handsim::engine::articulated
