#include "handsim/simulation/watch/climb_figures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/model/kinematics.h"
#include "handsim/model/pulleys.h"
#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

namespace {

template <class Archive, class T>
void carry_loaded(Archive& archive, T& grip) {
  archive(grip.time, grip.load, grip.travel, grip.contacts);
  archive.list(grip.parts, [](auto& each, auto& part) { carry_part(each, part); });
  archive.list(grip.fingers, [](auto& each, auto& load) {
    each(load.finger, load.deep, load.superficial, load.a2, load.a4, load.ligaments);
  });
}

Json fingers_json(const std::vector<FingerLoad>& fingers) {
  Json out = Json::array();
  for (const FingerLoad& each : fingers)
    out.push_back({{"finger", each.finger},
                   {"FDP_N", each.deep},
                   {"FDS_N", each.superficial},
                   {"A2_N", each.a2},
                   {"A2_of_FDP_N", each.deep > 0 ? each.a2 * each.deep / (each.deep + each.superficial) : 0},
                   {"A2_of_strength", each.a2 / model::kA2Strength},
                   {"A4_N", each.a4},
                   {"A4_of_strength", each.a4 / model::kA4Strength},
                   {"DIP_on_ligaments", each.ligaments}});
  return out;
}

}  // namespace

double load_at(const scene::ClimbPlan& plan, double time) {
  return std::clamp(plan.load.rate * (time - plan.loading().start), 0.0, plan.load.most);
}

/// Finds the flexors of the four fingers, of a hand that has them, and their joints.
void ClimbWatch::collect_flexors(const model::Model& model, const hand::BuiltHand& hand) {
  const std::string of = model.hands[plan_.hand].name + ".";
  const auto dof = [&](const std::string& axis) -> std::optional<int> {
    for (const model::Joint& joint : model.joints)
      for (std::size_t a = 0; a < joint.axes.size(); ++a)
        if (joint.name + "." + joint.axes[a].name == of + axis) return joint.first_dof + static_cast<int>(a);
    return std::nullopt;
  };
  const auto path = [&](const std::string& name) {
    model::TendonPath out;
    for (const model::Muscle& muscle : hand.muscles.muscles)
      if (muscle.name == name)
        for (model::MomentArm arm : muscle.path.arms)
          if (const auto found = dof(hand.axes[as_index(arm.dof)].name)) {
            arm.dof = *found;
            out.arms.push_back(arm);
          }
    return out;
  };
  const auto in_effect = [&](const std::string& name) -> std::optional<std::size_t> {
    for (std::size_t i = 0; i < model.muscles.size(); ++i)
      if (model.muscles[i].name == of + name) return i;
    return std::nullopt;
  };
  const std::array<const char*, 4> fingers = {"index", "middle", "ring", "little"};
  for (std::size_t i = 0; i < fingers.size(); ++i) {
    const std::string number = std::to_string(i + 2), finger = fingers[i];
    const auto dip = dof(finger + "_dip.flexion"), pip = dof(finger + "_pip.flexion");
    Flexors each{finger, path("FDP" + number),      path("FDS" + number),     0,
                 0,      in_effect("FDP" + number), in_effect("FDS" + number)};
    if (!dip || !pip || each.deep.arms.empty() || each.superficial.arms.empty()) continue;
    each.dip = as_index(*dip);
    each.pip = as_index(*pip);
    flexors_.push_back(std::move(each));
  }
}

FingerLoad ClimbWatch::Flexors::load(const model::State& state, const Eigen::VectorXd& held) const {
  const auto arm = [&](const model::TendonPath& path, std::size_t dof) {
    const model::PathState now = model::path_state(path, state.q);
    for (std::size_t i = 0; i < path.arms.size(); ++i)
      if (as_index(path.arms[i].dof) == dof) return now.arm[i];
    return 0.0;
  };
  model::FlexorTensions tensions;
  if (deep_muscle && superficial_muscle)
    tensions = {state.tendon_force[*deep_muscle], state.tendon_force[*superficial_muscle]};
  else
    tensions = model::flexor_tensions(state.tau[dip], state.tau[pip], arm(deep, dip), arm(deep, pip),
                                      arm(superficial, pip));
  const model::PulleyForces pulleys = model::pulley_forces(tensions, state.q[pip]);
  const double extends = -held[static_cast<Eigen::Index>(dip)], flexes = tensions.deep * arm(deep, dip);
  return {finger,     tensions.deep, tensions.superficial,
          pulleys.a2, pulleys.a4,    extends > 0 ? std::max(0.0, 1 - flexes / extends) : 0};
}

ClimbWatch::ClimbWatch(const model::Model& model, const scene::ClimbPlan& plan, const hand::BuiltHand& built,
                       double step)
    : model_(&model), plan_(plan), half_step_(step / 2) {
  collect_flexors(model, built);
  const model::HandIndex& hand = model.hands[plan.hand];
  dof_ = as_index(model.joints[as_index(*hand.rail)].first_dof);
  for (const model::Shape& shape : model.shapes) {
    const bool mine = std::ranges::find(hand.bodies, shape.body) != hand.bodies.end();
    part_of_shape_.push_back(mine ? hand_part(shape.part) : std::nullopt);
  }
  for (const std::optional<std::size_t> object : model.objects_of_shapes())
    of_hold_.push_back(object && model.objects[*object].name == plan.hold);
  figures_.name = hand.name + "." + plan.hold;
  figures_.strength = plan.strength;
}

LoadedGrip ClimbWatch::grip(const engine::Engine& engine) const {
  LoadedGrip out;
  out.time = engine.state().time;
  out.load = load_at(plan_, out.time);
  out.travel = figures_.travel;
  PartForces parts;
  Eigen::VectorXd held = Eigen::VectorXd::Zero(model_->dof_count());
  for (const engine::Contact& contact : engine.contacts()) {
    const auto a = as_index(contact.shape_a), b = as_index(contact.shape_b);
    const bool first = of_hold_[b];
    const std::optional<std::size_t> part = part_of_shape_[first ? a : b];
    if (!(first || of_hold_[a]) || !part || contact.normal_force() <= 0) continue;
    parts.add(*part, contact);
    const int body = model_->shapes[first ? a : b].body;
    held += (first ? 1 : -1) *
            model::jacobian(*model_, engine.state(), body, contact.position).topRows<3>().transpose() *
            contact.force;
    ++out.contacts;
  }
  out.parts = parts.touched();
  for (const Flexors& each : flexors_) out.fingers.push_back(each.load(engine.state(), held));
  return out;
}

void ClimbWatch::update(const engine::Engine& engine) {
  const model::State& state = engine.state();
  if (state.time < plan_.loading().start - half_step_) return;
  const double q = state.q[dof_], rate = state.u[dof_];
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
  // `complete` does not change the rest of the run, and is not in its snapshots.
  figures_.complete = state.time >= plan_.loading().end - half_step_;
  if (std::abs(rate) > kHeldSpeed) return;
  figures_.carried = load_at(plan_, state.time);
  figures_.carried_time = state.time;
  if (figures_.carried >= grips_.back().load + kGripEvery) grips_.push_back(grip(engine));
}

template <class Archive, class Self>
void ClimbWatch::serialize(Archive& archive, Self& self) {
  auto& figures = self.figures_;
  archive(figures.failed, figures.carried, figures.carried_time, figures.failure_time, figures.travel,
          self.start_, self.loading_);
  archive.list(self.grips_, [](auto& each, auto& grip) { carry_loaded(each, grip); });
}

void ClimbWatch::save(ArchiveWriter& out) const { serialize(out, *this); }

void ClimbWatch::restore(ArchiveReader& in, double /*time*/) {
  serialize(in, *this);
  figures_.complete = figures_.failed;
  if (loading_ == grips_.empty())
    in.refuse("a climb whose load and grips disagree", "grips once the load has begun");
}

ClimbFigures ClimbWatch::figures() const {
  ClimbFigures out = figures_;
  if (grips_.empty()) return out;
  out.before = grips_.front();
  out.half = *std::ranges::min_element(
      grips_, {}, [half = out.carried / 2](const LoadedGrip& grip) { return std::abs(grip.load - half); });
  out.last = grips_.back();
  return out;
}

bool ClimbWatch::over(double time) const {
  return figures_.failed && time > figures_.failure_time + kAfterFailure - half_step_;
}

Climbs::Climbs(const Watched& watched) : engine_(watched.engine) {
  const scene::SceneSpec& spec = watched.scene.spec;
  for (const scene::ClimbPlan& plan : watched.scene.plans.climbs)
    each_.emplace_back(watched.scene.model, plan, watched.scene.hands[plan.hand], spec.solver.step);
}

bool Climbs::over() const {
  return std::ranges::all_of(each_, [&](const auto& climb) { return climb.over(engine_.state().time); });
}

/// A climb that outlasts its largest load carried that much; one that is cut short at least what it did.
void Climbs::add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const {
  for (const ClimbFigures& climb : figures()) {
    Verdict verdict{"climb_load", "N", climb.carried, criteria.climb_load, climb.carried_time, climb.name};
    verdict.least = true;
    if (!climb.begun() || (!climb.complete && !verdict.held())) verdict.measured.reset();
    out.push_back(std::move(verdict));
  }
}

void Climbs::add_summary(SummaryJson& out) const {
  const auto loaded_json = [](const LoadedGrip& grip) {
    return Json{{"time_s", grip.time},
                {"load_N", grip.load},
                {"travel_m", grip.travel},
                {"contacts", grip.contacts},
                {"parts", parts_json(grip.parts)},
                {"fingers", fingers_json(grip.fingers)}};
  };
  for (const ClimbFigures& climb : figures())
    out.json["climbs"].push_back({{"name", climb.name},
                                  {"failed", climb.failed},
                                  {"load_N", climb.carried},
                                  {"load_time_s", climb.carried_time},
                                  {"failure_time_s", climb.failed ? Json(climb.failure_time) : Json()},
                                  {"travel_m", climb.travel},
                                  {"grip_strength_norm_N", climb.strength.norm},
                                  {"grip_strength_deviation_N", climb.strength.deviation},
                                  {"grip_strength_N", climb.strength.own},
                                  {"grip_strength_measured", climb.strength.measured},
                                  {"load_over_norm", climb.share()},
                                  {"before", loaded_json(climb.before)},
                                  {"half_load", loaded_json(climb.half)},
                                  {"last", loaded_json(climb.last)}});
}

}  // namespace handsim::simulation
