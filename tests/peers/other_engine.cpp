#include "peers/other_engine.h"

#include <fmt/format.h>

#include "handsim/engine/checks.h"
#include "handsim/model/kinematics.h"

namespace handsim::peers {

OtherEngine::OtherEngine(const model::Model& model, const engine::Settings& settings)
    : model_(model),
      settings_(settings),
      state_(model::initial_state(model)),
      tests_contacts_(engine::needs_contacts(model, settings.effects)) {
  std::vector<Problem> problems;
  for (const model::Material& material : model.materials)
    if (tests_contacts_ && material.restitution > 0)
      problems.push_back({std::nullopt, material.name, "a surface that bounces", "none"});
  if (settings.effects.has(model::Effect::wrist_motion) && !model.drives.empty())
    problems.push_back({std::nullopt, "drives", "a body that moves as told", "none"});
  if (!problems.empty()) throw Error(problems);
}

void OtherEngine::fail(const std::string& what) {
  failure_ = {state_.time, "the engine", what, "it gave up"};
  throw Error(*failure_);
}

std::optional<double> OtherEngine::common_friction() const {
  if (!settings_.effects.has(model::Effect::friction)) return 0;
  std::optional<double> common;
  for (const model::Shape& shape : model_.shapes) {
    const double own = model_.materials[static_cast<std::size_t>(shape.material)].friction;
    if (common && *common != own) return std::nullopt;
    common = own;
  }
  return common;
}

void OtherEngine::check() {
  for (std::size_t i = 1; i < state_.bodies.size(); ++i) {
    const model::BodyState& body = state_.bodies[i];
    if (body.p.allFinite() && body.v.norm() < engine::kMaxSpeed && body.w.norm() < engine::kMaxAngularSpeed)
      continue;
    failure_ = {state_.time, model_.bodies[i].name, "speed [m/s]", fmt::format("{:g}", body.v.norm())};
    throw Error(*failure_);
  }
}

engine::StepReport OtherEngine::step(const engine::StepInput& input) {
  if (failure_) throw Error(*failure_);
  advance(input);
  state_.time = engine::next_time(state_.time, settings_.step);
  contacts_.clear();
  read(state_, contacts_);
  check();
  model::update_coordinates(model_, state_);
  engine::StepReport report;
  report.contacts = static_cast<int>(contacts_.size());
  return report;
}

void OtherEngine::set_state(const model::State& state) {
  if (failure_) throw Error(*failure_);
  engine::require_state(model_, state);
  state_ = state;
  model::update_coordinates(model_, state_);
  put(state_);
}

}  // namespace handsim::peers
