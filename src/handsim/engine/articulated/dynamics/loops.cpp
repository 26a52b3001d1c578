#include "handsim/engine/articulated/dynamics/loops.h"

#include <algorithm>
#include <cmath>

namespace handsim::engine::articulated {

namespace {

/// A row that adds less than this share of what it might to the ones taken before is dependent on them.
constexpr double kDependent = 1e-12;
constexpr int kClosings = 20;
constexpr double kClosed = 1e-14;

/// Two unit vectors that make a right-handed frame with a unit vector.
std::pair<Vec3, Vec3> across(const Vec3& axis) {
  const Vec3 first = axis.unitOrthogonal();
  return {first, axis.cross(first)};
}

}  // namespace

Loops::Loops(const model::Model& model, Mechanism& mechanism)
    : model_(model), mechanism_(mechanism), space_(mechanism) {
  const std::size_t n = as_index(space_.size());
  std::size_t rows = n;
  for (const Cut& cut : mechanism.topology().cuts)
    rows += 6 - as_index(model::dof_count(model.joints[as_index(cut.joint)].kind));
  rows_.reserve(rows);
  locked_.reserve(n);
  order_.reserve(rows);
  for (std::vector<double>* matrix : {&J_, &Y_}) matrix->resize(rows * n);
  K_.resize(rows * rows);
  for (std::vector<double>* of_dofs : {&bias_, &zero_, &x_, &delta_, &kept_}) of_dofs->resize(n);
  for (std::vector<double>* of_rows : {&wanted_, &multipliers_, &column_, &scale_}) of_rows->resize(rows);
  rates_.resize(mechanism.q().size());
  row_rates_.reserve(rows);
}

Loops::Side Loops::motion_of(const CutSide& side, int island) const {
  Side out;
  const Vec3 origin = mechanism_.origin(island);
  if (!side.node) {
    const BaseMotion& base = mechanism_.base(side.base);
    const Vec3 r = base.pose.q * side.frame.p;
    out.p = base.pose.p + r - origin;
    out.R = (base.pose.q * side.frame.q).toRotationMatrix();
    out.v = base.v + base.w.cross(r);
    out.w = base.w;
    out.dv = base.dv + base.dw.cross(r) + base.w.cross(base.w.cross(r)) - mechanism_.gravity();
    out.dw = base.dw;
    return out;
  }
  const Frame<1>& frame = lanes_of<1>(mechanism_.tree()).batch[*side.node].frame;
  Mat3 R;
  for (int k = 0; k < 9; ++k) R(k / 3, k % 3) = frame.R[k][0];
  out.p = Vec3(frame.p[0][0], frame.p[1][0], frame.p[2][0]) + R * side.frame.p;
  out.R = R * side.frame.q.toRotationMatrix();
  const Spatial v = space_.velocity(*side.node), a = space_.acceleration(*side.node);
  out.w = v.head<3>();
  out.v = v.tail<3>() + out.w.cross(out.p);
  out.dw = a.head<3>();
  out.dv = a.tail<3>() + out.dw.cross(out.p) + out.w.cross(out.v);
  return out;
}

/// How far b's point is from a's along a direction, fixed in the world or turning with a.
void Loops::add_point_row(const Side& a, const Side& b, const Vec3& direction, bool turning) {
  Row row;
  const Vec3 gap = b.p - a.p;
  const Vec3 w = turning ? a.w : Vec3::Zero(), dw = turning ? a.dw : Vec3::Zero();
  const Vec3 rate = b.v - a.v - w.cross(gap);
  row.value = direction.dot(gap);
  row.rate = direction.dot(rate);
  // Acceleration in the turning frame: less Euler's, centrifugal and Coriolis terms.
  row.drift = direction.dot(b.dv - a.dv - dw.cross(gap) - w.cross(w.cross(gap)) - 2 * w.cross(rate));
  row.on_child << b.p.cross(direction), direction;
  if (turning)
    row.on_parent = row.on_child;
  else
    row.on_parent << a.p.cross(direction), direction;
  rows_.push_back(row);
}

/// The cosine between x, fixed in a, and y, fixed in b.
void Loops::add_angle_row(const Side& a, const Side& b, const Vec3& x, const Vec3& y) {
  Row row;
  const Vec3 normal = y.cross(x);
  row.value = x.dot(y);
  row.rate = (b.w - a.w).dot(normal);
  row.drift = (b.dw - a.dw).dot(normal) + (b.w - a.w).dot(b.w.cross(y).cross(x) + y.cross(a.w.cross(x)));
  row.on_child << normal, Vec3::Zero();
  row.on_parent = row.on_child;
  rows_.push_back(row);
}

void Loops::compute_rows() {
  rows_.clear();
  for (const Cut& cut : mechanism_.topology().cuts) {
    const model::Joint& joint = model_.joints[as_index(cut.joint)];
    const Side a = motion_of(cut.parent, cut.island), b = motion_of(cut.child, cut.island);
    const auto slides = as_index(joint.type().slides);
    // The direction of a slide, or any, and two across it.
    const Vec3 r = slides > 0 ? joint.axes[0].axis : Vec3::UnitX();
    const auto [s, t] = across(r);
    if (slides > 0) {
      add_point_row(a, b, a.R * s, true);
      add_point_row(a, b, a.R * t, true);
    } else {
      for (int k = 0; k < 3; ++k) add_point_row(a, b, Vec3::Unit(k), false);
    }
    switch (joint.type().turns) {
      case 0:
        add_angle_row(a, b, a.R * s, b.R * t);
        add_angle_row(a, b, a.R * t, b.R * r);
        add_angle_row(a, b, a.R * r, b.R * s);
        break;
      case 1: {
        const Vec3& axis = joint.axes[slides].axis;
        const auto [u, w] = across(axis);
        add_angle_row(a, b, a.R * u, b.R * axis);
        add_angle_row(a, b, a.R * w, b.R * axis);
        break;
      }
      case 2:
        add_angle_row(a, b, a.R * joint.axes[slides].axis, b.R * joint.axes[slides + 1].axis);
    }
  }
}

std::span<const double> Loops::rates() {
  compute_rows();
  row_rates_.clear();
  for (const Row& row : rows_) row_rates_.push_back(row.rate);
  return row_rates_;
}

std::span<const double> Loops::jacobian() {
  fill_jacobian();
  return {J_.data(), rows_.size() * as_index(space_.size())};
}

void Loops::fill_jacobian() {
  const std::size_t n = as_index(space_.size());
  std::fill_n(J_.begin(), rows_.size() * n, 0.0);
  std::size_t i = 0;
  for (const Cut& cut : mechanism_.topology().cuts) {
    const int count = 6 - model::dof_count(model_.joints[as_index(cut.joint)].kind);
    for (int k = 0; k < count; ++k, ++i) {
      const std::span<double> row(J_.data() + i * n, n);
      if (cut.parent.node) space_.add_row(*cut.parent.node, rows_[i].on_parent, -1, row);
      if (cut.child.node) space_.add_row(*cut.child.node, rows_[i].on_child, 1, row);
    }
  }
}

void Loops::compute_jacobian() {
  const std::size_t n = as_index(space_.size()), total = rows_.size() + locked_.size();
  fill_jacobian();
  std::size_t i = 0;
  for (const Cut& cut : mechanism_.topology().cuts) {
    const int count = 6 - model::dof_count(model_.joints[as_index(cut.joint)].kind);
    const double parent = cut.parent.node ? space_.row_scale(*cut.parent.node) : 0,
                 child = cut.child.node ? space_.row_scale(*cut.child.node) : 0;
    for (int k = 0; k < count; ++k, ++i)
      scale_[i] = parent * rows_[i].on_parent.squaredNorm() + child * rows_[i].on_child.squaredNorm();
  }
  std::fill_n(J_.begin() + static_cast<std::ptrdiff_t>(i * n), locked_.size() * n, 0.0);
  for (const int dof : locked_) {
    J_[i * n + as_index(dof)] = 1;
    scale_[i++] = 0;
  }
  std::copy_n(J_.begin(), total * n, Y_.begin());
  for (std::size_t k = 0; k < total; ++k) space_.solve_transposed({Y_.data() + k * n, n});
  for (std::size_t k = 0; k < total; ++k)
    for (std::size_t j = 0; j <= k; ++j) {
      double sum = 0;
      for (std::size_t d = 0; d < n; ++d) sum += Y_[k * n + d] * Y_[j * n + d];
      K_[k * total + j] = K_[j * total + k] = sum;
    }
  factor_rows();
}

/// Cholesky's factor of the independent part of K, the row with the most to add first.
void Loops::factor_rows() {
  const std::size_t m = rows_.size() + locked_.size();
  order_.clear();
  // wanted_ holds what is left of each diagonal entry meanwhile.
  for (std::size_t i = 0; i < m; ++i) {
    wanted_[i] = K_[i * m + i];
    if (scale_[i] == 0) scale_[i] = wanted_[i];
  }
  for (std::size_t step = 0; step < m; ++step) {
    std::size_t best = m;
    for (std::size_t i = 0; i < m; ++i) {
      const bool taken = std::ranges::find(order_, static_cast<int>(i)) != order_.end();
      if (taken || !(wanted_[i] > kDependent * scale_[i])) continue;
      if (best == m || wanted_[i] * scale_[best] > wanted_[best] * scale_[i]) best = i;
    }
    if (best == m) break;
    // Column `best` of the factor stands in K's column of that number.
    const double pivot = std::sqrt(wanted_[best]);
    for (std::size_t i = 0; i < m; ++i) {
      double sum = K_[i * m + best];
      for (const int k : order_) sum -= K_[i * m + as_index(k)] * K_[best * m + as_index(k)];
      column_[i] = sum / pivot;
    }
    for (std::size_t i = 0; i < m; ++i) {
      K_[i * m + best] = column_[i];
      if (i != best) wanted_[i] -= column_[i] * column_[i];
    }
    order_.push_back(static_cast<int>(best));
  }
}

void Loops::correct(std::span<double> wanted, std::span<double> out) {
  const std::size_t m = rows_.size() + locked_.size(), n = as_index(space_.size());
  std::fill_n(multipliers_.begin(), m, 0.0);
  for (std::size_t k = 0; k < order_.size(); ++k) {
    const std::size_t row = as_index(order_[k]);
    double sum = wanted[row];
    for (std::size_t j = 0; j < k; ++j)
      sum -= K_[row * m + as_index(order_[j])] * multipliers_[as_index(order_[j])];
    multipliers_[row] = sum / K_[row * m + row];
  }
  for (std::size_t k = order_.size(); k-- > 0;) {
    const std::size_t row = as_index(order_[k]);
    double sum = multipliers_[row];
    for (std::size_t j = k + 1; j < order_.size(); ++j)
      sum -= K_[as_index(order_[j]) * m + row] * multipliers_[as_index(order_[j])];
    multipliers_[row] = sum / K_[row * m + row];
  }
  std::ranges::fill(x_, 0.0);
  for (const int row : order_)
    for (std::size_t d = 0; d < n; ++d) x_[d] += Y_[as_index(row) * n + d] * multipliers_[as_index(row)];
  space_.solve_factor(x_);
  for (std::size_t d = 0; d < n; ++d) out[d] += x_[d];
}

void Loops::solve(std::optional<double> step) {
  const LaneTreeOf<1>& tree = lanes_of<1>(mechanism_.tree());
  const std::size_t n = as_index(space_.size());
  const std::span<double> du = mechanism_.du();
  space_.inverse_dynamics(zero_, bias_);
  space_.compute_inertia();
  locked_.clear();
  for (int i = 0; i < tree.batches; ++i) {
    const NodeBatch<1>& b = tree.batch[i];
    for (int k = 0; k < rate_count(b.kind); ++k) {
      const std::size_t dof = as_index(b.u + k);
      const Axis<1>* axis = rate_count(b.kind) == 1 ? tree.axis + b.axis : nullptr;
      du[dof] = (axis ? axis->force[0] : tree.joint3[b.axis].tau[k][0]) - bias_[dof];
      if (axis) space_.add_to_diagonal(static_cast<int>(dof), axis->weight[0]);
      if (axis && axis->locked[0] != 0) locked_.push_back(static_cast<int>(dof));
    }
  }
  space_.factor();
  space_.solve_transposed(du);
  space_.solve_factor(du);
  compute_rows();
  compute_jacobian();
  for (std::size_t i = 0; i < rows_.size() + locked_.size(); ++i) {
    double now = 0;
    for (std::size_t d = 0; d < n; ++d) now += J_[i * n + d] * du[d];
    wanted_[i] = (i >= rows_.size() ? axis_of(locked_[i - rows_.size()]).given[0]
                                    : (step ? -rows_[i].rate / *step : -rows_[i].drift)) -
                 now;
  }
  correct(wanted_, du);
  for (std::size_t i = 0; i < locked_.size(); ++i)
    axis_of(locked_[i]).reaction[0] = multipliers_[rows_.size() + i];
}

Axis<1>& Loops::axis_of(int dof) const {
  const LaneTreeOf<1>& tree = lanes_of<1>(mechanism_.tree());
  for (int i = 0;; ++i)
    if (tree.batch[i].u == dof) return tree.axis[tree.batch[i].axis];
}

double Loops::close() {
  const LaneTree& tree = mechanism_.tree();
  const Kernel& kernel = mechanism_.kernel();
  const std::size_t n = as_index(space_.size());
  locked_.clear();
  double error = 0, last = 0;
  for (int k = 0; k < kClosings; ++k) {
    if (k > 0) {
      mechanism_.update_bases();
      kernel.kinematics(tree);
    }
    compute_rows();
    error = 0;
    for (const Row& row : rows_) error = std::max(error, std::abs(row.value));
    // Rounding is reached where an iteration no longer helps.
    if (error < kClosed || (k > 1 && error > 0.1 * last && error < 1e-12)) break;
    last = error;
    space_.compute_inertia();
    space_.factor();
    compute_jacobian();
    for (std::size_t i = 0; i < rows_.size(); ++i) wanted_[i] = -rows_[i].value;
    // As a motion of one second at constant rates.
    std::ranges::fill(delta_, 0.0);
    correct(wanted_, delta_);
    std::copy_n(tree.u, n, kept_.begin());
    std::copy_n(delta_.begin(), n, tree.u);
    kernel.position_rates(tree, rates_.data());
    std::copy_n(kept_.begin(), n, tree.u);
    for (std::size_t i = 0; i < rates_.size(); ++i) tree.q[i] += rates_[i];
    kernel.normalise(tree);
  }
  close_rates();
  return error;
}

void Loops::close_rates() {
  locked_.clear();
  compute_rows();
  double error = 0;
  for (const Row& row : rows_) error = std::max(error, std::abs(row.rate));
  if (error < kClosed) return;
  space_.compute_inertia();
  space_.factor();
  compute_jacobian();
  for (std::size_t i = 0; i < rows_.size(); ++i) wanted_[i] = -rows_[i].rate;
  correct(wanted_, mechanism_.u());
  mechanism_.kernel().velocities(mechanism_.tree());
}

}  // namespace handsim::engine::articulated
