#include "handsim/engine/articulated/articulated_engine_derivatives.h"

#include "handsim/engine/articulated/articulated_engine.h"

namespace handsim::engine::articulated {

bool derive(const Engine& engine, StepDerivatives* out) {
  const auto* own = dynamic_cast<const ArticulatedEngine*>(&engine);
  if (own) own->derive(out);
  return own != nullptr;
}

/// Refuses what has no derivatives, and keeps the start of the step.
void ArticulatedEngine::begin_derivatives() {
  const auto refuse = [](const char* got, const char* need) { throw input_error("derivatives", got, need); };
  if (smooth_) refuse("a method for smooth motion", "method semi_implicit_euler");
  if (loops_) refuse("closed loops", "a scene without loops");
  if (momentum_.jointed()) refuse("a free hand", "hands with a fixed or driven wrist");
  if (settings_.effects.has(model::Effect::muscles) && model::any_elastic(model_.muscles))
    refuse("elastic tendons", "rigid ones");
  if (settings_.effects.has(model::Effect::muscles) && model::any_short_range(model_.muscles))
    refuse("muscles with a short-range stiffness", "muscles without");
  for (const Node& node : mechanism_.topology().nodes)
    if (node.kind == NodeKind::ball && node.reversed)
      refuse("a ball joint whose parent is carried by its child", "joints from the base outwards");
  state();
  ArchiveWriter out;
  save(out);
  derived_from_ = out.take();
}

/// After a refusal in the middle of the step, whose next attempt has to find the warm starts as they were.
void ArticulatedEngine::undo_derivatives() {
  if (!derive_) return;
  ArchiveReader in(derived_from_, "the step's start");
  restore(model::State(state_), in);
}

/// Between the solution of the step and its motion.
void ArticulatedEngine::compute_derivatives(const StepInput& input, const StepReport& report) {
  if (!slopes_)
    slopes_ = std::make_unique<StepSlopes>(model_, settings_, mechanism_, muscles_.get(), contact_.get());
  if (report.contacts > 0 && (report.iterative || report.lcp_failures > 0 || !slopes_->refine()))
    throw input_error("derivatives", "contacts that Newton's method does not solve", "another state or step");
  if (report.contacts == 0 && report.lcp_failures > 0)
    throw input_error("derivatives", "stops and torque limits that do not agree", "another state or step");
  if (!derive_->step_only) slopes_->find(input, state_, report.contacts > 0, *derive_);
}

}  // namespace handsim::engine::articulated
