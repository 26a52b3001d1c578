#include "handsim/engine/ode/ode_engine.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/engine/checks.h"
#include "handsim/engine/multibody/projection.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::ode {

OdeEngine::OdeEngine(const model::Model& model, const Settings& settings)
    : model_(checked(model, settings)), settings_(settings), residual_(model, settings.erp()) {
  if (settings.ode().projection) require_regular_start(model, settings, model::initial_state(model));
  enter_ode();
  try {
    build();
  } catch (const OdeFault& fault) {
    throw input_error("model", "ODE: " + fault.message, "a model that ODE accepts");
  }
}

void OdeEngine::set_gravity() {
  const Vec3 gravity = settings_.effects.has(model::Effect::gravity) ? model_.gravity : Vec3::Zero();
  dWorldSetGravity(ids_.world.get(), gravity.x(), gravity.y(), gravity.z());
  if (contacts_) contacts_->set_gravity(gravity);
}

void OdeEngine::build() {
  ids_ = make_world();
  const dWorldID world = ids_.world.get();
  set_gravity();
  dWorldSetERP(world, settings_.ode().erp);
  dWorldSetCFM(world, settings_.ode().cfm);
  dWorldSetQuickStepNumIterations(world, settings_.ode().iterations);
  immovable_ = immovable_bodies(model_, settings_.effects);
  bodies_ = make_bodies(world, model_, immovable_);
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (bodies_[i].id != nullptr) moving_.push_back(i);
  state_ = model::initial_state(model_);
  joints_ = std::make_unique<Joints>(world, model_, settings_, bodies_, state_);
  muscles_ = std::make_unique<Muscles>(model_, settings_, [](int a, int b) { return a == b; });
  muscles_->reset(state_);
  if (needs_contacts(model_, settings_.effects))
    contacts_ = std::make_unique<Contacts>(ids_, model_, settings_, bodies_);
  if (settings_.ode().projection) closed_ = islands(model_, settings_);
  write(state_);
  if (contacts_) contacts_->place_immovable(state_);
}

/// Takes a state over into ODE; kinematic bodies that stand still have no velocity, whatever it says.
void OdeEngine::write(const model::State& state) {
  state_ = state;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (immovable_[i]) state_.bodies[i].v = state_.bodies[i].w = Vec3::Zero();
    write_state(bodies_[i], state_.bodies[i]);
  }
  joints_->read_coordinates(state_);
}

bool OdeEngine::immovable_moved(const model::State& state) const {
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (immovable_[i] && (state.bodies[i].p != state_.bodies[i].p ||
                          state.bodies[i].q.coeffs() != state_.bodies[i].q.coeffs()))
      return true;
  return false;
}

void OdeEngine::set_state(const model::State& state) {
  if (failure_) throw Error(*failure_);
  require_state(model_, state);
  stop_rows_ = 0;
  enter_ode();
  try {
    const bool moved = immovable_moved(state);
    if (moved) joints_->reanchor(state);
    write(state);
    if (contacts_) contacts_->reset(state);
    if (moved && contacts_) contacts_->place_immovable(state_);
    muscles_->reset(state);
  } catch (const OdeFault& fault) {
    fail(fault);
  }
}

void OdeEngine::save(ArchiveWriter& out) const {
  if (failure_) throw Error(*failure_);
  out(stop_rows_, contacts_ != nullptr);
  if (contacts_) contacts_->save(out);
}

void OdeEngine::restore(const model::State& state, ArchiveReader& in) {
  set_state(state);
  in(stop_rows_);
  bool with_contacts = false;
  in(with_contacts);
  if (with_contacts != (contacts_ != nullptr)) in.refuse("contacts of another scene", "those of this one");
  if (contacts_) contacts_->restore(in);
}

void OdeEngine::refresh() {
  if (failure_) throw Error(*failure_);
  set_gravity();
  for (const std::size_t i : moving_)
    if (!model_.bodies[i].kinematic) set_mass(bodies_[i].id, model_.bodies[i]);
}

std::span<const Contact> OdeEngine::contacts() const {
  return contacts_ ? std::span<const Contact>(contacts_->list()) : std::span<const Contact>();
}

std::string OdeEngine::version() const {
  return fmt::format("ODE {} {}", dODE_VERSION, sizeof(dReal) == sizeof(double) ? "double" : "single");
}

std::vector<std::string> OdeEngine::notes() const { return joints_->notes(); }

std::unique_ptr<Engine> make(const model::Model& model, const Settings& settings) {
  return std::make_unique<OdeEngine>(model, settings);
}

}  // namespace handsim::engine::ode
