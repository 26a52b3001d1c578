#include "handsim/engine/muscles.h"
#include "handsim/engine/tendon_kernels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "handsim/model/elastic_lanes.h"
#include "handsim/model/muscle_curves.h"

namespace handsim::engine {

Muscles::Muscles(const model::Model& model, const Settings& settings, const TendonLayout::Solves& solves,
                 const TendonKernel* kernel)
    : step_(settings.step),
      muscles_(settings.effects.has(model::Effect::muscles) ? std::span(model.muscles)
                                                            : std::span<const model::Muscle>()),
      layout_(muscles_,
              settings.effects.has(model::Effect::tendon_coupling) ? std::span(model.bands)
                                                                   : std::span<const model::Band>(),
              solves),
      kernel_(kernel ? kernel : tendon_kernels().back()),
      torques_(as_index(model.dof_count())) {
  for (Start* each : {&start_, &before_})
    for (std::vector<double>* lanes : {&each->activations, &each->fibres, &each->bridges})
      lanes->resize(as_index(layout_.arrays().blocks) * kTendonLanes);
  collect_parts();
}

/// The entry of two coordinates, made where there is none.
std::size_t Muscles::slot(int a, int b) {
  const int row = std::max(a, b), column = std::min(a, b);
  for (std::size_t i = 0; i < slopes_.size(); ++i)
    if (slopes_[i].row == row && slopes_[i].column == column) return i;
  slopes_.push_back({row, column, 0});
  return slopes_.size() - 1;
}

void Muscles::collect_parts() {
  const TendonArrays& all = layout_.arrays();
  for (int c = 0; c < all.coordinates; ++c)
    for (std::size_t k = 0; k < kTendonLanes; ++k) {
      const CoordinateRow& row = all.coordinate[c];
      torque_parts_.push_back({&row.torque[k], as_index(row.dof[k])});
      slope_parts_.push_back({&row.own[k], slot(row.dof[k], row.dof[k])});
    }
  for (int s = 0; s < all.pairs; ++s)
    for (std::size_t k = 0; k < kTendonLanes; ++k) {
      const auto& [a, b] = layout_.pair(as_index(s));
      slope_parts_.push_back({&all.sum[s].sum[k], slot(all.coordinate[a].dof[k], all.coordinate[b].dof[k])});
    }
}

void Muscles::reset(const model::State& state) {
  const TendonArrays& all = layout_.arrays();
  goes_on_ = false;
  begun_ = 0;
  for (std::size_t i = 0; i < muscles_.size(); ++i) {
    const TendonLayout::Place& place = layout_.muscles()[i];
    TendonBlock& block = all.block[place.block];
    block.activation[place.lane] = state.activation[i];
    if (block.elastic != kRigid) all.elastic[block.elastic].fibre[place.lane] = state.fibre_length[i];
    if (block.bridges != kRigid) all.bridges[block.bridges].stretch[place.lane] = state.bridge_stretch[i];
  }
}

/// Lengths at the start of the last step; null: rigid tendons.
double* Muscles::fibres(int block) const {
  const int row = layout_.arrays().block[block].elastic;
  return row == kRigid ? nullptr : layout_.arrays().elastic[row].fibre;
}

/// Stretches at the start of the last step; null: none.
double* Muscles::bridges(int block) const {
  const int row = layout_.arrays().block[block].bridges;
  return row == kRigid ? nullptr : layout_.arrays().bridges[row].stretch;
}

void Muscles::pull(const Start& start) {
  kernel_->pull(layout_.arrays(),
                {start.q.data(), start.u.data(),
                 start.excitations.empty() ? nullptr : start.excitations.data(), step_, goes_on_});
  goes_on_ = true;
}

void Muscles::begin_step(std::span<const double> q, std::span<const double> u,
                         std::span<const double> excitations) {
  std::swap(start_, before_);
  begun_ = std::min(begun_ + 1, 2);
  start_.q.assign(q.begin(), q.end());
  start_.u.assign(u.begin(), u.end());
  start_.excitations.assign(excitations.begin(), excitations.end());
  const TendonArrays& all = layout_.arrays();
  for (int i = 0; i < all.blocks; ++i)
    std::copy_n(all.block[i].activation, kTendonLanes, &start_.activations[as_index(i) * kTendonLanes]);
  pull(start_);
  for (int i = 0; i < all.blocks; ++i) {
    if (const double* lanes = fibres(i))
      std::copy_n(lanes, kTendonLanes, &start_.fibres[as_index(i) * kTendonLanes]);
    if (const double* lanes = bridges(i))
      std::copy_n(lanes, kTendonLanes, &start_.bridges[as_index(i) * kTendonLanes]);
  }
  std::ranges::fill(torques_, 0.0);
  for (Slope& each : slopes_) each.value = 0;
  for (const Part& each : torque_parts_) torques_[each.to] += *each.from;
  for (const Part& each : slope_parts_) slopes_[each.to].value += *each.from;
}

void Muscles::restore_step() {
  if (begun_ == 2) std::swap(start_, before_);
  for (int i = 0; i < layout_.arrays().blocks; ++i) {
    std::copy_n(&start_.activations[as_index(i) * kTendonLanes], kTendonLanes,
                layout_.arrays().block[i].activation);
    if (double* lanes = fibres(i))
      std::copy_n(&start_.fibres[as_index(i) * kTendonLanes], kTendonLanes, lanes);
    if (double* lanes = bridges(i))
      std::copy_n(&start_.bridges[as_index(i) * kTendonLanes], kTendonLanes, lanes);
  }
  goes_on_ = false;
  // The step before leaves its tensions and rates again, which `store_state` and the next step ask for.
  if (begun_ == 2) pull(start_);
  --begun_;
}

void Muscles::by_coordinate(std::span<const double> u, std::span<const double> given,
                            std::vector<double>& torques, std::vector<double>& damping) const {
  damping.assign(torques_.size(), 0);
  for (const Slope& each : slopes_) damping[as_index(each.row)] += each.value;
  torques = torques_;
  for (std::size_t i = 0; i < torques.size(); ++i)
    torques[i] += damping[i] * u[i] + (given.empty() ? 0 : given[i]);
}

/// Rate of a tendon's length with the arms of the start [m/s].
double Muscles::rate_at(const TendonLayout::Place& place, std::span<const double> u) const {
  const TendonArrays& all = layout_.arrays();
  const TendonBlock& block = all.block[place.block];
  double rate = 0;
  for (int i = 0; i < block.arms; ++i) {
    const ArmRow& arm = all.arm[block.first_arm + i];
    rate -= arm.arm[place.lane] * u[as_index(all.coordinate[arm.coordinate].dof[place.lane])];
  }
  return rate;
}

/// Length and speed of the fibres, and stretch of their cross-bridges, at the end of the step, with the bits
/// that the kernel finds before the next one. @param rate of muscle and tendon
void Muscles::place_fibres(std::size_t muscle, std::span<const double> q, double rate,
                           model::State& state) const {
  const model::Muscle& of = muscles_[muscle];
  const TendonLayout::Place& place = layout_.muscles()[muscle];
  const auto lane = place.lane;
  const TendonArrays& all = layout_.arrays();
  const TendonBlock& block = all.block[place.block];
  const BridgeRow* bridges = block.bridges == kRigid ? nullptr : all.bridges + block.bridges;
  double &length = state.fibre_length[muscle], &speed = state.fibre_speed[muscle];
  const double more = rate - block.rate[lane];
  double faster = 0;  // of the normalised fibres
  if (of.tendon_strain) {
    const ElasticRow& row = all.elastic[block.elastic];
    const double reach = std::max(block.least[lane], row.reach[lane] + row.share[lane] * more);
    length = std::sqrt(block.height[lane] + reach * reach);
    speed = (length - row.fibre[lane]) / step_;
    if (bridges)
      faster = (reach - model::fibre_reach(model::hill_constants(of), row.fibre[lane])) * (1.0 / step_) *
               (reach / length) * block.per_length[lane];
  } else {
    const model::Fibre fibre = model::fibre_at(of, path_state(of.path, q).excursion);
    length = fibre.length;
    speed = fibre.cosine * (block.rate[lane] + more);
    if (bridges) faster = rate * bridges->per[lane];
  }
  if (!bridges) return;
  const double top = model::top_speed(model::hill_constants(of), block.activation[lane]);
  const model::HillBridges<double> start = {bridges->softness[lane], bridges->stretch[lane], 1.0 / step_};
  state.bridge_stretch[muscle] = model::bridge_stretch(faster, top, start, step_);
}

void Muscles::store_state(std::span<const double> q, std::span<const double> u, model::State& state) const {
  for (std::size_t i = 0; i < muscles_.size(); ++i) {
    const TendonLayout::Place& place = layout_.muscles()[i];
    const TendonBlock& block = layout_.arrays().block[place.block];
    const double rate = rate_at(place, u), faster = rate - block.rate[place.lane];
    state.activation[i] = block.activation[place.lane];
    state.tendon_force[i] = std::max(0.0, block.force[place.lane] + block.slope[place.lane] * faster);
    place_fibres(i, q, rate, state);
  }
}

}  // namespace handsim::engine
