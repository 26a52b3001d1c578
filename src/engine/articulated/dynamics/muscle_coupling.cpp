#include "handsim/engine/articulated/dynamics/muscle_coupling.h"

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
  find_sources();
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
      added.depth = added.parent == kNoDof ? 0 : dofs_[at(added.parent)].depth + 1;
      added.row = carrier_.size();
      const std::size_t over = added.depth == 0 ? 0 : dofs_[at(added.parent)].row;
      for (std::size_t k = 0; k < added.depth; ++k) carrier_.push_back(carrier_[over + k]);
      carrier_.push_back(dofs_.size() - 1);
      added.rate = space_.rate_index(dof);
      added.single = rate_count(nodes[i].kind) == 1;
      if (added.single) added.axis = mechanism.axis_view(i);
    }
  for (std::vector<double>* matrix : {&H_, &A_, &L_}) matrix->resize(carrier_.size());
  for (std::vector<double>* vector : {&x_, &b_, &inverse_}) vector->resize(dofs_.size());
  locked_.resize(dofs_.size());
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
    const Dof &row = dofs_[at(place(i))], &column = dofs_[at(place(j))];
    entries_.push_back({place(i), place(j), i, j, k, row.row + column.depth, row.rate, column.rate});
  }
}

void MuscleCoupling::find_sources() {
  const auto& nodes = mechanism_.topology().nodes;
  const std::size_t width = mechanism_.stride();
  // Where the kernel starts with each batch.
  std::vector<std::size_t> first(at(mechanism_.tree().batches), 0);
  std::vector<std::size_t> depth(first.size(), 0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (rate_count(nodes[i].kind) == 1) depth[at(mechanism_.slot(i).batch)] = at(nodes[i].depth) + 1;
  std::size_t end = 0;
  for (std::size_t b = 0; b < first.size(); ++b) {
    first[b] = end;
    end += width * depth[b];
  }
  lanes_.resize(end);
  for (const Dof& each : dofs_) {
    if (!each.single) return sources_.clear();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (space_.first_dof(static_cast<int>(i)) != each.dof) continue;
      const LaneSlot& slot = mechanism_.slot(i);
      for (std::size_t k = 0; k <= each.depth; ++k)
        sources_.push_back({first[at(slot.batch)] + k * width + at(slot.lane), each.row + each.depth - k});
    }
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

void MuscleCoupling::find_inertia() {
  if (have_inertia_) return;
  have_inertia_ = true;
  if (!sources_.empty()) {
    mechanism_.kernel().inertia(mechanism_.tree(), lanes_.data());
    for (const Source& each : sources_) H_[each.to] = lanes_[each.from];
    return;
  }
  space_.find_inertia([&](int dof) { return with_tendons_[at(dof)] != 0; });
  for (const Dof& each : dofs_)
    for (std::size_t k = 0; k <= each.depth; ++k)
      H_[each.row + k] = space_.inertia(each.dof, dofs_[carrier_[each.row + k]].dof);
}

/// A = H + weights + h B, and b = h B du.
void MuscleCoupling::assemble(double step) {
  find_inertia();
  const std::span<const double> du = mechanism_.du();
  std::copy(H_.begin(), H_.end(), A_.begin());
  for (std::size_t i = 0; i < dofs_.size(); ++i) {
    if (dofs_[i].single) A_[dofs_[i].row + dofs_[i].depth] += *dofs_[i].axis.weight;
    locked_[i] = dofs_[i].single && *dofs_[i].axis.side != 0;
    b_[i] = 0;
  }
  for (const Entry& each : entries_) {
    const double value = step * slopes()[each.slope].value;
    A_[each.at] += value;
    b_[at(each.i)] += value * du[each.rate_j];
    if (each.i != each.j) b_[at(each.j)] += value * du[each.rate_i];
  }
}

/// x = A^-1 b with x = 0 where a stop locks a coordinate: L^T L as in joint_space.h, by rows of H.
void MuscleCoupling::solve() {
  std::copy(A_.begin(), A_.end(), L_.begin());
  std::copy(b_.begin(), b_.end(), x_.begin());
  if (std::find(locked_.begin(), locked_.end(), 1) != locked_.end())
    for (std::size_t i = 0; i < dofs_.size(); ++i) {
      double* row = &L_[dofs_[i].row];
      const std::size_t* carrier = &carrier_[dofs_[i].row];
      for (std::size_t k = 0; k <= dofs_[i].depth; ++k)
        if (locked_[i] || locked_[carrier[k]]) row[k] = k == dofs_[i].depth ? 1 : 0;
      if (locked_[i]) x_[i] = 0;
    }
  for (std::size_t k = dofs_.size(); k-- > 0;) {
    const Dof& own = dofs_[k];
    const double* row = &L_[own.row];
    const std::size_t* carrier = &carrier_[own.row];
    const double inverse = inverse_[k] = 1 / row[own.depth];
    for (std::size_t i = own.depth; i-- > 0;) {
      const double share = row[i] * inverse;
      x_[carrier[i]] -= share * x_[k];
      double* to = &L_[dofs_[carrier[i]].row];
      for (std::size_t j = 0; j <= i; ++j) to[j] -= share * row[j];
    }
  }
  for (std::size_t i = 0; i < dofs_.size(); ++i) {
    const double* row = &L_[dofs_[i].row];
    const std::size_t* carrier = &carrier_[dofs_[i].row];
    double sum = x_[i];
    for (std::size_t j = 0; j < dofs_[i].depth; ++j) sum -= row[j] * x_[carrier[j]];
    x_[i] = sum * inverse_[i];
  }
}

void MuscleCoupling::correct(double step) {
  assemble(step);
  solve();
  const std::span<double> du = mechanism_.du();
  for (std::size_t i = 0; i < dofs_.size(); ++i) du[dofs_[i].rate] -= x_[i];
  if (std::find(locked_.begin(), locked_.end(), 1) == locked_.end()) return;
  // What the equation of a locked coordinate lacks is its stop's: b - A x.
  for (std::size_t i = 0; i < dofs_.size(); ++i) {
    if (locked_[i]) *dofs_[i].axis.reaction += b_[i];
    for (std::size_t k = 0; k < dofs_[i].depth; ++k) {
      const double entry = A_[dofs_[i].row + k];
      const std::size_t j = carrier_[dofs_[i].row + k];
      if (locked_[i]) *dofs_[i].axis.reaction -= entry * x_[j];
      if (locked_[j]) *dofs_[j].axis.reaction -= entry * x_[i];
    }
  }
}

void MuscleCoupling::find_torques(double step) {
  const std::span<double> du = mechanism_.du(), tau = mechanism_.torques();
  for (const Entry& each : entries_) {
    const double value = step * slopes()[each.slope].value;
    tau[each.rate_i] -= value * du[each.rate_j];
    if (each.i != each.j) tau[each.rate_j] -= value * du[each.rate_i];
  }
}

}  // namespace handsim::engine::articulated
