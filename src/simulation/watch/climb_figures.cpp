#include "handsim/simulation/watch/climb_figures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/model/kinematics.h"

namespace handsim::simulation {

namespace {

/// The servo that holds the palm while the fingers close: stiff against fingers, critically damped for half a
/// kilogram.
constexpr double kServoStiffness = 1e5;  ///< [N/m]
constexpr double kServoDamping = 450;    ///< [N s/m]
constexpr double kServoLimit = 5000;     ///< [N]

template <class Archive, class T>
void carry_loaded(Archive& archive, T& grip) {
  archive(grip.time);
  archive(grip.load);
  archive(grip.travel);
  archive(grip.contacts);
  archive.list(grip.parts, [](auto& each, auto& part) { carry_part(each, part); });
}

/// Interpolated travel and forces say nothing new: the kept grip whose load is nearest.
const LoadedGrip& nearest(const std::vector<LoadedGrip>& grips, double load) {
  return *std::min_element(grips.begin(), grips.end(), [load](const LoadedGrip& a, const LoadedGrip& b) {
    return std::abs(a.load - load) < std::abs(b.load - load);
  });
}

}  // namespace

ClimbWatch::ClimbWatch(const model::Model& model, const scene::ClimbPlan& plan, double step)
    : model_(model), plan_(plan), half_step_(step / 2) {
  const model::HandIndex& hand = model.hands[plan.hand];
  rail_ = static_cast<std::size_t>(*hand.rail);
  dof_ = static_cast<std::size_t>(model.joints[rail_].first_dof);
  for (const model::Shape& shape : model.shapes) {
    const bool mine = std::find(hand.bodies.begin(), hand.bodies.end(), shape.body) != hand.bodies.end();
    part_of_shape_.push_back(mine ? hand_part(shape.part) : -1);
    of_hold_.push_back(shape.body == model::kWorld &&
                       (shape.name == plan.hold || shape.name.starts_with(plan.hold + ".")));
  }
  figures_.name = hand.name + "." + plan.hold;
  figures_.strength = plan.strength;
}

double ClimbWatch::load(double time) const {
  return std::clamp(plan_.load.rate * (time - plan_.loading().start), 0.0, plan_.load.most);
}

double ClimbWatch::target(double time) const {
  const scene::GraspPhase& approach = plan_.approach();
  const double share = std::clamp((time - approach.start) / (approach.end - approach.start), 0.0, 1.0);
  return -plan_.height * (1 - model::eased(model::Interpolation::minimum_jerk, share));
}

void ClimbWatch::command(const model::State& state, std::span<double> torques,
                         std::span<model::Servo> servos) const {
  const double end = state.time + 2 * half_step_;
  if (state.time > plan_.loading().start - half_step_) {
    torques[dof_] += load(end);
    return;
  }
  double q = 0;
  model::joint_coordinates(model_.joints[rail_], state, std::span(&q, 1));
  servos[dof_] = {kServoStiffness, kServoDamping, target(end) - q, 0, kServoLimit};
}

LoadedGrip ClimbWatch::grip(const engine::Engine& engine) const {
  LoadedGrip out;
  out.time = engine.state().time;
  out.load = load(out.time);
  out.travel = figures_.travel;
  std::array<PartForce, kHandParts.size()> parts;
  for (const engine::Contact& contact : engine.contacts()) {
    const auto a = static_cast<std::size_t>(contact.shape_a), b = static_cast<std::size_t>(contact.shape_b);
    const bool first = of_hold_[b];
    const int part = part_of_shape_[first ? a : b];
    if (!(first || of_hold_[a]) || part < 0 || contact.normal_force() <= 0) continue;
    PartForce& sum = parts[static_cast<std::size_t>(part)];
    ++sum.contacts;
    ++out.contacts;
    sum.normal += contact.normal_force();
    sum.friction += contact.friction_force().norm();
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].contacts == 0) continue;
    parts[i].part = kHandParts[i];
    out.parts.push_back(parts[i]);
  }
  return out;
}

void ClimbWatch::look(const engine::Engine& engine) {
  const model::State& state = engine.state();
  if (state.time < plan_.loading().start - half_step_) return;
  double q = 0, rate = 0;
  model::joint_coordinates(model_.joints[rail_], state, std::span(&q, 1));
  model::joint_rates(model_.joints[rail_], state, std::span(&rate, 1));
  if (!loading_) {
    loading_ = true;
    start_ = q;
    grips_.push_back(grip(engine));
  }
  figures_.travel = q - start_;
  if (figures_.failed) return;
  if (std::abs(figures_.travel) >= kFailedTravel) {
    figures_.failed = true;
    figures_.failure_time = state.time;
    figures_.complete = true;
    return;
  }
  // Of no effect on the rest of the run, and no part of its snapshots.
  figures_.complete = state.time >= plan_.loading().end - half_step_;
  if (std::abs(rate) > kHeldSpeed) return;
  figures_.carried = load(state.time);
  figures_.carried_time = state.time;
  if (figures_.carried >= grips_.back().load + kGripEvery) grips_.push_back(grip(engine));
}

template <class Archive, class Self>
void ClimbWatch::carry(Archive& archive, Self& self) {
  auto& figures = self.figures_;
  archive(figures.failed);
  for (auto* value :
       {&figures.carried, &figures.carried_time, &figures.failure_time, &figures.travel, &self.start_})
    archive(*value);
  archive(self.loading_);
  archive.list(self.grips_, [](auto& each, auto& grip) { carry_loaded(each, grip); });
}

void ClimbWatch::save(ArchiveWriter& out) const { carry(out, *this); }

void ClimbWatch::restore(ArchiveReader& in) {
  carry(in, *this);
  figures_.complete = figures_.failed;
  if (loading_ == grips_.empty())
    in.refuse("a climb whose load and grips disagree", "grips once the load has begun");
}

ClimbFigures ClimbWatch::figures() const {
  ClimbFigures out = figures_;
  if (grips_.empty()) return out;
  out.before = grips_.front();
  out.half = nearest(grips_, out.carried / 2);
  out.last = grips_.back();
  return out;
}

bool ClimbWatch::over(double time) const {
  return figures_.failed && time > figures_.failure_time + kAfterFailure - half_step_;
}

}  // namespace handsim::simulation
