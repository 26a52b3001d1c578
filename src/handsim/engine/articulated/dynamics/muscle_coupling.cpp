#include "handsim/engine/articulated/dynamics/muscle_coupling.h"

#include <algorithm>

namespace handsim::engine::articulated {

namespace {

/// The joint space's dof of each coordinate of the model.
std::vector<int> dofs_of_model(const model::Model& model, const Mechanism& mechanism,
                               const JointSpace& space) {
  std::vector<int> out(as_index(model.dof_count()), kNoDof);
  const auto& nodes = mechanism.topology().nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (nodes[i].joint && rate_count(nodes[i].kind) == 1)
      out[as_index(model.joints[as_index(*nodes[i].joint)].first_dof + nodes[i].axis_index)] =
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
    const auto dof = as_index(model.joints[as_index(*nodes[i].joint)].first_dof + nodes[i].axis_index);
    q_at_[dof] = mechanism.view(i).q;
    u_at_[dof] = mechanism.view(i).u;
  }
  q_.resize(space_dof_.size());
  u_.resize(space_dof_.size());
  given_.resize(space_dof_.size());
  collect_trees();
  collect_entries();
  collect_sources();
}

/// True if one of two coordinates of the model carries the other.
bool MuscleCoupling::on_one_branch(int a, int b) const {
  const int x = space_dof_[as_index(a)], y = space_dof_[as_index(b)];
  if (x == kNoDof || y == kNoDof) return false;
  int low = std::max(x, y);
  while (low > std::min(x, y)) low = space_.parent_dof(low);
  return low == std::min(x, y);
}

bool MuscleCoupling::pulls(std::size_t dof) const {
  return std::ranges::any_of(muscles_.slopes(), [&](const Muscles::Slope& each) {
    return as_index(each.row) == dof || as_index(each.column) == dof;
  });
}

/// The dofs of all trees with tendons: B changes the accelerations of the whole tree.
void MuscleCoupling::collect_trees() {
  const auto root = [&](int dof) {
    while (space_.parent_dof(dof) != kNoDof) dof = space_.parent_dof(dof);
    return dof;
  };
  std::vector<char> roots(as_index(space_.size()), 0);
  with_tendons_.assign(as_index(space_.size()), 0);
  for (const Muscles::Slope& each : muscles_.slopes())
    if (const int dof = space_dof_[as_index(each.row)]; dof != kNoDof) roots[as_index(root(dof))] = 1;
  std::vector<int> place(as_index(space_.size()), kNoDof);
  const auto& nodes = mechanism_.topology().nodes;
  for (int node = 0; node < static_cast<int>(nodes.size()); ++node)
    for (int dof = space_.first_dof(node); dof <= space_.last_dof(node); ++dof) {
      if (!roots[as_index(root(dof))]) continue;
      with_tendons_[as_index(dof)] = 1;
      place[as_index(dof)] = static_cast<int>(rows_.size());
      const int parent = space_.parent_dof(dof) == kNoDof ? kNoDof : place[as_index(space_.parent_dof(dof))];
      Coupled& added = rows_.emplace_back();
      added.dof = dof;
      added.node = node;
      added.depth = parent == kNoDof ? 0 : rows_[as_index(parent)].depth + 1;
      added.row = static_cast<int>(carrier_.size());
      for (int k = 0; k < added.depth; ++k)
        carrier_.push_back(carrier_[as_index(rows_[as_index(parent)].row + k)]);
      carrier_.push_back(place[as_index(dof)]);
      single_ = single_ && rate_count(nodes[as_index(node)].kind) == 1;
    }
}

void MuscleCoupling::collect_entries() {
  const auto place = [&](int dof) {
    return static_cast<int>(std::ranges::find(rows_, dof, &Coupled::dof) - rows_.begin());
  };
  for (std::size_t k = 0; k < muscles_.slopes().size(); ++k) {
    const Muscles::Slope& slope = muscles_.slopes()[k];
    const int a = space_dof_[as_index(slope.row)], b = space_dof_[as_index(slope.column)];
    if (a == kNoDof || b == kNoDof) continue;
    const int i = place(std::max(a, b)), j = place(std::min(a, b));
    entries_.push_back({i, j, rows_[as_index(i)].row + rows_[as_index(j)].depth, k});
    space_dofs_.emplace_back(std::max(a, b), std::min(a, b));
  }
}

/// Where H comes from: the kernel, or JointSpace where a tree has a node of several rates.
void MuscleCoupling::collect_sources() {
  const auto& nodes = mechanism_.topology().nodes;
  const std::size_t width = mechanism_.stride();
  // Where the kernel starts with each batch.
  std::vector<std::size_t> first(as_index(mechanism_.tree().batches), 0), depth(first.size(), 0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (rate_count(nodes[i].kind) == 1)
      depth[as_index(mechanism_.slot(i).batch)] = as_index(nodes[i].depth) + 1;
  std::size_t end = 0;
  for (std::size_t b = 0; b < first.size(); ++b) {
    first[b] = end;
    end += width * depth[b];
  }
  static const double none = 0;
  for (Coupled& dof : rows_) {
    const LaneSlot& slot = mechanism_.slot(as_index(dof.node));
    for (int k = 0; k <= dof.depth; ++k) {
      const std::size_t row =
          first[as_index(slot.batch)] + as_index(dof.depth - k) * width + as_index(slot.lane);
      from_.push_back(single_ ? static_cast<int>(row) : dof.row + k);
    }
    dof.du = &mechanism_.du()[space_.rate_index(dof.dof)];
    dof.tau = &mechanism_.torques()[space_.rate_index(dof.dof)];
    dof.reaction = dof.force = &unused_;
    dof.weight = dof.side = &none;
    if (rate_count(nodes[as_index(dof.node)].kind) != 1) continue;
    const NodeView& axis = mechanism_.view(as_index(dof.node));
    dof.reaction = axis.reaction;
    dof.force = axis.force;
    dof.weight = axis.weight;
    dof.side = axis.side;
  }
  inertia_.resize(single_ ? end : carrier_.size());
  slope_.resize(entries_.size());
  for (auto* numbers : {&A_, &L_}) numbers->resize(carrier_.size());
  for (auto* numbers : {&x_, &b_, &inverse_}) numbers->resize(rows_.size());
}

std::span<const double> MuscleCoupling::begin_step(const StepInput& input) {
  for (std::size_t i = 0; i < q_at_.size(); ++i) {
    if (!q_at_[i]) continue;
    q_[i] = *q_at_[i];
    u_[i] = *u_at_[i];
  }
  return begin_step(q_, u_, input);
}

std::span<const double> MuscleCoupling::begin_step(std::span<const double> q, std::span<const double> u,
                                                   const StepInput& input) {
  have_inertia_ = false;
  muscles_.begin_step(q, u, input.excitations);
  const std::span<const double> own = muscles_.torques();
  for (std::size_t i = 0; i < given_.size(); ++i)
    given_[i] = own[i] + (input.torques.empty() ? 0 : input.torques[i]);
  for (std::size_t k = 0; k < entries_.size(); ++k) slope_[k] = muscles_.slopes()[entries_[k].slope].value;
  return given_;
}

void MuscleCoupling::compute_inertia() {
  if (have_inertia_) return;
  have_inertia_ = true;
  if (single_) return mechanism_.kernel().inertia(mechanism_.tree(), inertia_.data());
  space_.compute_inertia([&](int dof) { return with_tendons_[as_index(dof)] != 0; });
  for (const Coupled& each : rows_)
    for (int k = each.row; k <= each.row + each.depth; ++k)
      inertia_[as_index(k)] = space_.inertia(each.dof, rows_[as_index(carrier_[as_index(k)])].dof);
}

}  // namespace handsim::engine::articulated
