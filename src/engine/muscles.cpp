#include "handsim/engine/muscles.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/index.h"
#include "handsim/model/muscle_curves.h"

namespace handsim::engine {

namespace {

constexpr int kNoSlot = -1;

}  // namespace

void require_excitations(const model::Model& model, const Settings& settings,
                         std::span<const double> excitations) {
  if (excitations.empty()) return;
  if (!settings.effects.has(model::Effect::muscles))
    throw input_error("excitations", "excitations without the muscles effect", "muscles among the effects");
  if (excitations.size() != model.muscles.size())
    throw input_error("excitations", fmt::format("{}", excitations.size()),
                      fmt::format("one for each of {} muscles", model.muscles.size()));
  for (std::size_t i = 0; i < excitations.size(); ++i)
    // Written so that NaN fails.
    if (!(excitations[i] >= 0 && excitations[i] <= 1))
      throw input_error("excitations." + model.muscles[i].name, fmt::format("{:g}", excitations[i]),
                        "0 to 1");
}

Muscles::Muscles(const model::Model& model, const Settings& settings, const Solves& solves)
    : step_(settings.step) {
  const auto add = [&](const model::TendonPath& path) -> Tendon& {
    Tendon& out = tendons_.emplace_back();
    out.path = &path;
    out.first = arms_.add(path);
    out.count = path.arms.size();
    return out;
  };
  if (settings.effects.has(model::Effect::muscles))
    for (const model::Muscle& muscle : model.muscles) add(muscle.path).muscle = &muscle;
  if (settings.effects.has(model::Effect::tendon_coupling))
    for (const model::Ligament& ligament : model.ligaments) add(ligament.path).ligament = &ligament;
  if (settings.effects.has(model::Effect::muscles)) muscles_ = model.muscles.size();
  torques_.resize(at(model.dof_count()));
  for (Tendon& tendon : tendons_)
    for (const model::MomentArm& arm : tendon.path->arms) tendon.own.push_back(slot(arm.dof, arm.dof));
  for (Tendon& tendon : tendons_) {
    const auto& arms = tendon.path->arms;
    for (std::size_t i = 0; i < arms.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        tendon.slots.push_back(solves(arms[i].dof, arms[j].dof) ? slot(arms[i].dof, arms[j].dof) : kNoSlot);
  }
}

/// The entry of two coordinates, made where there is none.
int Muscles::slot(int a, int b) {
  const int row = std::max(a, b), column = std::min(a, b);
  for (std::size_t i = 0; i < slopes_.size(); ++i)
    if (slopes_[i].row == row && slopes_[i].column == column) return static_cast<int>(i);
  slopes_.push_back({row, column, 0});
  return static_cast<int>(slopes_.size()) - 1;
}

/// Of the tendon's length [m/s].
double Muscles::rate_of(const Tendon& tendon, std::span<const double> u) const {
  const double* r = arms_.arm() + tendon.first;
  const int* dof = arms_.dof() + tendon.first;
  double out = 0;
  for (std::size_t i = 0; i < tendon.count; ++i) out -= r[i] * u[at(dof[i])];
  return out;
}

/// Tension at the start and its slope, into torques and B.
void Muscles::pull(Tendon& tendon, std::span<const double> u, double activation) {
  const double* r = arms_.arm() + tendon.first;
  const int* dof = arms_.dof() + tendon.first;
  const double* bend = arms_.bend() + tendon.first;
  const double excursion = arms_.excursion(static_cast<std::size_t>(&tendon - tendons_.data()));
  const double rate = tendon.rate = rate_of(tendon, u);
  if (tendon.muscle) {
    const model::Tension found = model::tension(*tendon.muscle, excursion, rate, activation);
    tendon.force = found.force;
    tendon.slope = step_ * std::max(0.0, found.stiffness) + found.damping;
    // The length at the step's end, at the rate of its start.
    tendon.force = std::max(0.0, tendon.force + step_ * found.stiffness * rate);
  } else {
    const model::Ligament& band = *tendon.ligament;
    const double x = -excursion - band.rest;
    const bool slack = !band.both_ways && x + step_ * rate <= 0;
    tendon.force = slack ? 0 : band.stiffness * (x + step_ * rate) + band.damping * rate;
    tendon.slope = slack ? 0 : step_ * band.stiffness + band.damping;
    if (!band.both_ways) tendon.force = std::max(0.0, tendon.force);
  }
  if (tendon.force == 0 && tendon.slope == 0) return;
  const int* slot = tendon.slots.data();
  for (std::size_t i = 0; i < tendon.count; ++i) {
    torques_[at(dof[i])] += r[i] * tendon.force;
    double& own = slopes_[at(tendon.own[i])].value;
    // An arm that grows against the motion holds the coordinate like a spring.
    own += r[i] * r[i] * tendon.slope + step_ * std::max(0.0, -bend[i] * tendon.force);
    for (std::size_t j = 0; j < i; ++j, ++slot) {
      const double entry = r[i] * r[j] * tendon.slope;
      if (*slot != kNoSlot) {
        slopes_[at(*slot)].value += entry;
      } else {
        own += std::abs(entry);
        slopes_[at(tendon.own[j])].value += std::abs(entry);
      }
    }
  }
}

void Muscles::begin(std::span<const double> q, std::span<const double> u,
                    std::span<const double> excitations) {
  std::fill(torques_.begin(), torques_.end(), 0.0);
  for (Slope& each : slopes_) each.value = 0;
  arms_.evaluate(q);
  std::size_t muscle = 0;
  for (Tendon& tendon : tendons_) {
    double activation = 0;
    if (tendon.muscle) {
      double& now = activation_[muscle];
      now = model::next_activation(*tendon.muscle, now, excitations.empty() ? 0 : excitations[muscle], step_);
      activation = now;
      ++muscle;
    }
    pull(tendon, u, activation);
  }
}

void Muscles::by_coordinate(std::span<const double> u, std::span<const double> given,
                            std::vector<double>& torques, std::vector<double>& damping) const {
  damping.assign(torques_.size(), 0);
  for (const Slope& each : slopes_) damping[at(each.row)] += each.value;
  torques = torques_;
  for (std::size_t i = 0; i < torques.size(); ++i)
    torques[i] += damping[i] * u[i] + (given.empty() ? 0 : given[i]);
}

double Muscles::tension_at(const Tendon& tendon, std::span<const double> u) const {
  return tendon.force + tendon.slope * (rate_of(tendon, u) - tendon.rate);
}

void Muscles::end(std::span<const double> q, std::span<const double> u, model::State& state) const {
  if (muscles_ == 0) return;
  state.activation = activation_;
  for (std::size_t i = 0; i < muscles_; ++i) {
    const Tendon& tendon = tendons_[i];
    state.tendon_force[i] = std::max(0.0, tension_at(tendon, u));
    state.fibre_length[i] = model::fibre_at(*tendon.muscle, path_state(*tendon.path, q).excursion).length;
  }
}

}  // namespace handsim::engine
