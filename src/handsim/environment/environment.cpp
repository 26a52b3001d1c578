#include "handsim/environment/environment.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/scene/compile/overruled.h"

namespace handsim::environment {

namespace {

void require_size(const char* what, std::size_t got, std::size_t need, const char* of) {
  if (got != 0 && got != need)
    throw input_error(std::string("action.") + what, fmt::format("{}", got),
                      fmt::format("one for each of {} {}, or none", need, of));
}

}  // namespace

/// The part of a scene that a simulation needs, without its sources: thousands of environments may have a
/// copy.
std::shared_ptr<scene::Scene> Environment::lean(const scene::Scene& scene) {
  auto out = std::make_shared<scene::Scene>();
  out->spec.title = scene.spec.title;
  out->spec.gravity = scene.spec.gravity;
  out->spec.solver = scene.spec.solver;
  out->spec.duration = scene.spec.duration;
  out->spec.record_every = scene.spec.record_every;
  out->spec.criteria = scene.spec.criteria;
  out->spec.contacts = scene.spec.contacts;
  out->spec.tasks = scene.spec.tasks;
  out->plans.hands = scene.plans.hands;
  out->plans.objects = scene.plans.objects;
  out->plans.grasps = scene.plans.grasps;
  out->plans.climbs = scene.plans.climbs;
  out->model = scene.model;
  out->control = scene.control;
  out->muscles = scene.muscles;
  out->lineage = scene.lineage;
  return out;
}

Environment::Environment(const scene::Scene& scene, Setup setup)
    : Environment(lean(scene), std::move(setup), false, nullptr) {}

Environment::Environment(std::shared_ptr<scene::Scene> scene, Setup setup)
    : Environment(std::move(scene), std::move(setup), false, nullptr) {}

Environment::Environment(std::shared_ptr<scene::Scene> scene, Setup setup, bool shared,
                         const Environment* like)
    : scene_(std::move(scene)),
      setup_(std::move(setup)),
      variation_(std::make_unique<Variation>(*scene_)),
      shared_(shared) {
  if (like) {
    start_ = like->start_;
    observation_ = like->observation_;
  } else {
    observation_ = std::make_shared<const Observation>(*scene_, setup_.observe);
  }
  observed_.resize(observation_->size());
  // All that share a scene have the same setup.
  if (observation_->needs_forces()) scene_->spec.solver.contact_forces = true;
  for (const Randomised& each : setup_.randomise)
    if (Variation::changes_scene(each.name)) own_scene();
  build();
  if (observation_->needs_watchers() && simulation_->watchers().empty())
    throw input_error("observe", "failed in a setup without watchers", "watchers, e.g. standard_watchers");
  state_ = simulation_->state();
  if (!like) variation_->check(setup_.randomise, state_);
  variation_->draw(setup_.randomise, 0);
  for (const Randomised& each : setup_.randomise) check_acts(each.name);
  reset();
}

void Environment::own_scene() {
  if (!std::exchange(shared_, false)) return;
  // The simulation, up to the next reset, and the observation read the shared one.
  shared_scene_ = scene_;
  scene_ = std::make_shared<scene::Scene>(*scene_);
  variation_->use(*scene_);
  copied_ = true;
}

void Environment::build() {
  copied_ = false;
  simulation_ = std::make_unique<simulation::Simulation>(scene_, setup_.watchers);
  if (!shared_ || !start_) start_ = std::make_shared<const simulation::MotionSnapshot>(simulation_->motion());
}

/// The simulation with the scene's numbers as they are now; its resets mend a failure.
void Environment::begin() {
  const bool changed = variation_->take_changed();
  if (copied_)
    build();
  else if (changed)
    simulation_->refresh();
  failure_.reset();
  steps_ = 0;
}

void Environment::reset() {
  if (!variation_->moves_start()) {
    begin();
    return simulation_->reset(*start_);
  }
  model::State state = state_;
  variation_->place(state);
  begin();
  simulation_->reset(state);
}

void Environment::reset(std::uint64_t seed) {
  variation_->draw(setup_.randomise, seed);
  reset();
}

void Environment::reset(const simulation::MotionSnapshot& moment) {
  begin();
  simulation_->reset(moment);
}

void Environment::reset_beside(const model::State& other) {
  require_size("bodies", other.bodies.size(), state_.bodies.size(), "bodies");
  require_size("q", other.q.size(), state_.q.size(), "coordinates");
  require_size("activation", other.activation.size(), state_.activation.size(), "muscles");
  model::State state = other;
  model::place_joints(scene_->model, other.q, other.u, state);
  state.activation = other.activation;
  begin();
  simulation_->reset(state);
}

void Environment::reset(const Start& start) {
  const model::Model& model = scene_->model;
  const auto dofs = as_index(model.dof_count());
  std::vector<int> objects;
  for (const model::ObjectIndex& object : model.objects)
    if (object.body) objects.push_back(*object.body);
  require_size("q", start.q.size(), dofs, "coordinates");
  require_size("u", start.u.size(), dofs, "coordinates");
  require_size("objects", start.objects.size(), objects.size(), "objects");
  model::State state = state_;
  for (std::size_t i = 0; i < start.objects.size(); ++i) {
    model::BodyState& body = state.bodies[as_index(objects[i])];
    body = {start.objects[i].p, start.objects[i].q, Vec3::Zero(), Vec3::Zero()};
  }
  const std::span<const double> q = start.q.empty() ? std::span<const double>(state_.q) : start.q;
  std::vector<double> u(dofs);
  if (start.q.empty()) u = state_.u;
  if (!start.u.empty()) u.assign(start.u.begin(), start.u.end());
  simulation::place_start(*scene_, q, u, state);
  begin();
  simulation_->reset(state);
}

void Environment::restore(const simulation::RunSnapshot& snapshot) {
  simulation_->restore(snapshot);
  failure_.reset();
  steps_ = 0;
}

void Environment::check(const Action& action, int substeps) const {
  const model::Model& model = scene_->model;
  require_size("wrists", action.wrists.size(), model.drives.size(), "driven wrists");
  require_size("wrist_rates", action.wrist_rates.size(), model.drives.size(), "driven wrists");
  if (!action.wrists.empty() && !action.wrist_rates.empty())
    throw input_error("action.wrists", "poses and velocities", "one of the two");
  for (const model::PoseRate& rate : action.wrist_rates)
    if (!rate.v.allFinite() || !rate.w.allFinite())
      throw input_error("action.wrist_rates", "one that is not finite", "finite numbers");
  if (substeps < 1) throw input_error("substeps", fmt::format("{}", substeps), "1 or more");
}

/// Poses of the driven wrists at the end of one of the substeps.
std::span<const Pose> Environment::wrist_targets(const Action& action, int step, int substeps) {
  const model::Model& model = scene_->model;
  const std::size_t count = std::max(action.wrists.size(), action.wrist_rates.size());
  if (count == 0) return {};
  if (step == 0) {
    from_.clear();
    for (const model::Drive& drive : model.drives)
      from_.push_back(simulation_->state().bodies[as_index(drive.body)].pose() * drive.frame);
  }
  const double share = static_cast<double>(step + 1) / substeps;
  const double time = (step + 1) * scene_->spec.solver.step;
  targets_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (action.wrists.empty()) {
      const model::PoseRate& rate = action.wrist_rates[i];
      targets_.push_back(
          {from_[i].p + time * rate.v, (rotation_quaternion(time * rate.w) * from_[i].q).normalized()});
      continue;
    }
    const Vec3 turn = rotation_vector(action.wrists[i].q * from_[i].q.conjugate());
    targets_.push_back({from_[i].p + share * (action.wrists[i].p - from_[i].p),
                        (rotation_quaternion(share * turn) * from_[i].q).normalized()});
  }
  return targets_;
}

void Environment::step(const Action& action, int substeps, const std::function<void()>& after) {
  if (failure_) throw Error(*failure_);
  check(action, substeps);
  try {
    for (int i = 0; i < substeps; ++i) {
      simulation_->step({.torques = action.torques,
                         .forces = action.forces,
                         .drive_targets = wrist_targets(action, i, substeps),
                         .excitations = action.excitations},
                        action.angles);
      ++steps_;
      if (after) after();
    }
  } catch (const Error& error) {
    if (!error.problems().empty()) throw;
    failure_.emplace(error);
    throw;
  }
}

std::span<const double> Environment::observe() {
  observation_->write(*simulation_, observed_);
  return observed_;
}

void Environment::set(std::string_view name, std::span<const double> values) {
  if (Variation::changes_scene(name)) own_scene();
  variation_->set(name, values);
  check_acts(name);
}

/// @throws Error (input) for a number that another key overrules.
void Environment::check_acts(std::string_view name) const {
  if (const auto by = scene::idle_because(*scene_, std::string(name)))
    throw input_error(std::string(name), "a number without effect (" + *by + ")",
                      "one that acts in this scene");
}

}  // namespace handsim::environment
