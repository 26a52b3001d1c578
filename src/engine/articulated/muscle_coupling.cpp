#include "handsim/engine/articulated/muscle_coupling.h"

#include <algorithm>
#include <cmath>

#include "handsim/core/index.h"

namespace handsim::engine::articulated {

namespace {

/// The joint space's dof of each coordinate of the model.
std::vector<int> dofs_of_model(const model::Model& model, const Mechanism& mechanism,
                               const JointSpace& space) {
  std::vector<int> out(at(model.dof_count()), kNoDof);
  const auto& nodes = mechanism.topology().nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (nodes[i].joint && rate_count(nodes[i].kind) == 1)
      out[at(model.joints[at(*nodes[i].joint)].first_dof + nodes[i].axis_index)] =
          space.first_dof(static_cast<int>(i));
  return out;
}

}  // namespace

MuscleCoupling::MuscleCoupling(const model::Model& model, const Settings& settings, Mechanism& mechanism)
    : mechanism_(mechanism),
      space_(mechanism),
      space_dof_(dofs_of_model(model, mechanism, space_)),
      muscles_(model, settings, [this](int a, int b) { return on_one_branch(a, b); }) {
  if (muscles_.empty()) return;
  q_at_.resize(space_dof_.size());
  u_at_.resize(space_dof_.size());
  const auto& nodes = mechanism.topology().nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!nodes[i].joint || rate_count(nodes[i].kind) != 1) continue;
    const auto dof = at(model.joints[at(*nodes[i].joint)].first_dof + nodes[i].axis_index);
    q_at_[dof] = mechanism.view(i).q;
    u_at_[dof] = mechanism.view(i).u;
  }
  q_.resize(space_dof_.size());
  u_.resize(space_dof_.size());
  given_.resize(space_dof_.size());
  find_trees(mechanism);
  find_entries();
}

/// True if one of two coordinates of the model carries the other.
bool MuscleCoupling::on_one_branch(int a, int b) const {
  const int x = space_dof_[at(a)], y = space_dof_[at(b)];
  if (x == kNoDof || y == kNoDof) return false;
  int low = std::max(x, y);
  while (low > std::min(x, y)) low = space_.parent_dof(low);
  return low == std::min(x, y);
}

/// The dofs of all trees with tendons: B changes the accelerations of the whole tree.
void MuscleCoupling::find_trees(const Mechanism& mechanism) {
  const auto root = [&](int dof) {
    while (space_.parent_dof(dof) != kNoDof) dof = space_.parent_dof(dof);
    return dof;
  };
  std::vector<char> roots(at(space_.size()), 0);
  with_tendons_.assign(at(space_.size()), 0);
  for (const Muscles::Slope& each : slopes())
    if (const int dof = space_dof_[at(each.row)]; dof != kNoDof) roots[at(root(dof))] = 1;
  std::vector<int> place(at(space_.size()), kNoDof);
  const auto& nodes = mechanism.topology().nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (int dof = space_.first_dof(static_cast<int>(i)); dof <= space_.last_dof(static_cast<int>(i));
         ++dof) {
      if (!roots[at(root(dof))]) continue;
      with_tendons_[at(dof)] = 1;
      place[at(dof)] = static_cast<int>(dofs_.size());
      Dof& added = dofs_.emplace_back();
      added.dof = dof;
      added.parent = space_.parent_dof(dof) == kNoDof ? kNoDof : place[at(space_.parent_dof(dof))];
      added.rate = space_.rate_index(dof);
      added.single = rate_count(nodes[i].kind) == 1;
      if (added.single) added.axis = mechanism.axis_view(i);
    }
  for (std::vector<double>* matrix : {&H_, &A_, &L_}) matrix->resize(dofs_.size() * dofs_.size());
  x_.resize(dofs_.size());
  b_.resize(dofs_.size());
}

void MuscleCoupling::find_entries() {
  const auto place = [&](int dof) {
    const auto found =
        std::find_if(dofs_.begin(), dofs_.end(), [&](const Dof& each) { return each.dof == dof; });
    return static_cast<int>(found - dofs_.begin());
  };
  for (std::size_t k = 0; k < slopes().size(); ++k) {
    const int a = space_dof_[at(slopes()[k].row)], b = space_dof_[at(slopes()[k].column)];
    if (a == kNoDof || b == kNoDof) continue;
    const int i = std::max(a, b), j = std::min(a, b);
    entries_.push_back({place(i), place(j), i, j, k});
  }
}

std::span<const double> MuscleCoupling::begin(const StepInput& input) {
  have_inertia_ = false;
  for (std::size_t i = 0; i < q_at_.size(); ++i) {
    if (!q_at_[i]) continue;
    q_[i] = *q_at_[i];
    u_[i] = *u_at_[i];
  }
  muscles_.begin(q_, u_, input.excitations);
  const std::span<const double> own = muscles_.torques();
  for (std::size_t i = 0; i < given_.size(); ++i)
    given_[i] = own[i] + (input.torques.empty() ? 0 : input.torques[i]);
  return given_;
}

/// A = H + weights + h B, and b = h B du.
void MuscleCoupling::assemble(double step) {
  if (!have_inertia_) {
    space_.find_inertia([&](int dof) { return with_tendons_[at(dof)] != 0; });
    for (int i = 0; i < static_cast<int>(dofs_.size()); ++i)
      for (int j = i; j != kNoDof; j = dofs_[at(j)].parent)
        entry(H_, i, j) = space_.inertia(dofs_[at(i)].dof, dofs_[at(j)].dof);
    have_inertia_ = true;
  }
  const std::span<const double> du = mechanism_.du();
  for (int i = 0; i < static_cast<int>(dofs_.size()); ++i) {
    for (int j = i; j != kNoDof; j = dofs_[at(j)].parent) entry(A_, i, j) = entry(H_, i, j);
    if (dofs_[at(i)].single) entry(A_, i, i) += *dofs_[at(i)].axis.weight;
    b_[at(i)] = 0;
  }
  for (const Entry& each : entries_) {
    const double value = step * slopes()[each.slope].value;
    entry(A_, each.i, each.j) += value;
    b_[at(each.i)] += value * du[dofs_[at(each.j)].rate];
    if (each.i != each.j) b_[at(each.j)] += value * du[dofs_[at(each.i)].rate];
  }
}

/// x = A^-1 b with x = 0 where a stop locks a coordinate: L^T L as in joint_space.h.
void MuscleCoupling::solve() {
  const int n = static_cast<int>(dofs_.size());
  const auto locked = [&](int i) { return dofs_[at(i)].single && *dofs_[at(i)].axis.side != 0; };
  for (int i = 0; i < n; ++i) {
    const bool fixed = locked(i);
    x_[at(i)] = fixed ? 0 : b_[at(i)];
    for (int j = i; j != kNoDof; j = dofs_[at(j)].parent)
      entry(L_, i, j) = fixed || locked(j) ? (i == j ? 1.0 : 0.0) : entry(A_, i, j);
  }
  for (int k = n - 1; k >= 0; --k) {
    const double inverse = 1 / entry(L_, k, k);
    for (int i = dofs_[at(k)].parent; i != kNoDof; i = dofs_[at(i)].parent) {
      const double share = entry(L_, k, i) * inverse;
      x_[at(i)] -= share * x_[at(k)];
      for (int j = i; j != kNoDof; j = dofs_[at(j)].parent) entry(L_, i, j) -= share * entry(L_, k, j);
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = dofs_[at(i)].parent; j != kNoDof; j = dofs_[at(j)].parent)
      x_[at(i)] -= entry(L_, i, j) * x_[at(j)];
    x_[at(i)] /= entry(L_, i, i);
  }
}

void MuscleCoupling::correct(double step) {
  assemble(step);
  solve();
  const std::span<double> du = mechanism_.du();
  const int n = static_cast<int>(dofs_.size());
  for (int i = 0; i < n; ++i) du[dofs_[at(i)].rate] -= x_[at(i)];
  // What the equation of a locked coordinate lacks is its stop's: b - A x.
  for (int i = 0; i < n; ++i) {
    const bool own = dofs_[at(i)].single && *dofs_[at(i)].axis.side != 0;
    if (own) *dofs_[at(i)].axis.reaction += b_[at(i)];
    for (int j = dofs_[at(i)].parent; j != kNoDof; j = dofs_[at(j)].parent) {
      if (own) *dofs_[at(i)].axis.reaction -= entry(A_, i, j) * x_[at(j)];
      if (dofs_[at(j)].single && *dofs_[at(j)].axis.side != 0)
        *dofs_[at(j)].axis.reaction -= entry(A_, i, j) * x_[at(i)];
    }
  }
}

void MuscleCoupling::find_torques(double step) {
  const std::span<double> du = mechanism_.du(), tau = mechanism_.torques();
  for (const Entry& each : entries_) {
    const double value = step * slopes()[each.slope].value;
    const std::size_t i = dofs_[at(each.i)].rate, j = dofs_[at(each.j)].rate;
    tau[i] -= value * du[j];
    if (i != j) tau[j] -= value * du[i];
  }
}

}  // namespace handsim::engine::articulated
