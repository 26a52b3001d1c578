// What the torques of tendons at a step's end change in the accelerations that were found without them.
#include "handsim/engine/articulated/dynamics/muscle_coupling.h"

namespace handsim::engine::articulated {

/// A = H + weights + h B, and b = h B du.
void MuscleCoupling::assemble(double step) {
  for (std::size_t k = 0; k < A_.size(); ++k) A_[k] = inertia_[as_index(from_[k])];
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    A_[as_index(rows_[i].row + rows_[i].depth)] += *rows_[i].weight;
    b_[i] = 0;
  }
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    const Entry& each = entries_[k];
    const double value = step * slope_[k];
    A_[as_index(each.at)] += value;
    b_[as_index(each.i)] += value * *rows_[as_index(each.j)].du;
    if (each.i != each.j) b_[as_index(each.j)] += value * *rows_[as_index(each.i)].du;
  }
}

/// Rows and columns of locked coordinates are those of the unit matrix, and their x is 0.
void MuscleCoupling::lock() {
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Coupled& own = rows_[i];
    for (int k = own.row; k <= own.row + own.depth; ++k)
      if (own.locked() || rows_[as_index(carrier_[as_index(k)])].locked())
        L_[as_index(k)] = k == own.row + own.depth ? 1 : 0;
    if (own.locked()) x_[i] = 0;
  }
}

/// x = A^-1 b: L^T L as in joint_space.h, by rows of H.
void MuscleCoupling::solve(bool locks) {
  L_ = A_;
  x_ = b_;
  if (locks) lock();
  for (std::size_t k = rows_.size(); k-- > 0;) {
    const double* row = &L_[as_index(rows_[k].row)];
    const int* carrier = &carrier_[as_index(rows_[k].row)];
    inverse_[k] = 1.0 / row[rows_[k].depth];
    for (int i = rows_[k].depth; i-- > 0;) {
      const double share = row[i] * inverse_[k];
      x_[as_index(carrier[i])] -= share * x_[k];
      double* to = &L_[as_index(rows_[as_index(carrier[i])].row)];
      for (int j = 0; j <= i; ++j) to[j] -= share * row[j];
    }
  }
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    double sum = x_[k];
    for (int j = 0; j < rows_[k].depth; ++j)
      sum -= L_[as_index(rows_[k].row + j)] * x_[as_index(carrier_[as_index(rows_[k].row + j)])];
    x_[k] = sum * inverse_[k];
  }
}

void MuscleCoupling::correct(double step) {
  compute_inertia();
  assemble(step);
  bool locks = false;
  for (const Coupled& each : rows_) locks = locks || each.locked();
  solve(locks);
  for (std::size_t i = 0; i < rows_.size(); ++i) *rows_[i].du -= x_[i];
  if (!locks) return;
  // What the equation of a locked coordinate lacks is its stop's: b - A x.
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Coupled& own = rows_[i];
    *own.reaction += own.locked() ? b_[i] : 0.0;
    for (int k = 0; k < own.depth; ++k) {
      const int j = carrier_[as_index(own.row + k)];
      const Coupled& other = rows_[as_index(j)];
      const double entry = A_[as_index(own.row + k)];
      if (own.locked()) *own.reaction -= entry * x_[as_index(j)];
      if (other.locked()) *other.reaction -= entry * x_[i];
    }
  }
}

void MuscleCoupling::correct_torques(double step) {
  const auto take = [](const Coupled& from, double torque) {
    *from.tau -= torque;
    *from.force -= torque;
  };
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    const Coupled &a = rows_[as_index(entries_[k].i)], &b = rows_[as_index(entries_[k].j)];
    const double value = step * slope_[k];
    take(a, value * *b.du);
    if (&a != &b) take(b, value * *a.du);
  }
}

}  // namespace handsim::engine::articulated
