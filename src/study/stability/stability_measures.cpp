#include <algorithm>

#include "handsim/core/index.h"
#include "handsim/study/stability/stability_measures.h"

namespace handsim::study {

using simulation::Simulation;

bool within(const MeasureSpec& spec, const Simulation& now) {
  const double time = now.state().time;
  return time >= spec.from - 1e-9 && time <= spec.until + 1e-9;
}

void keep_larger(std::optional<Figure>& figure, double value, const std::string& where) {
  if (!figure || value > figure->value) figure = Figure{value, where};
}

std::size_t body_of(const scene::Scene& scene, const std::string& name) {
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i)
    if (scene.model.bodies[i].name == name) return i;
  throw input_error("measures.body", name, "a body of the scene that moves");
}

std::vector<std::size_t> bodies_of(const scene::Scene& scene, const MeasureSpec& spec) {
  if (!spec.body.empty()) return {body_of(scene, spec.body)};
  std::vector<std::size_t> out;
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i)
    if (!scene.model.bodies[i].kinematic) out.push_back(i);
  return out;
}

double Coordinate::value(const model::State& state) const { return state.q[at(joint->first_dof) + axis]; }

double Coordinate::rate(const model::State& state) const { return state.u[at(joint->first_dof) + axis]; }

Coordinate coordinate_of(const scene::Scene& scene, const std::string& name) {
  for (const model::Joint& joint : scene.model.joints) {
    if (joint.name == name) return {&joint, 0};
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (joint.name + "." + joint.axes[a].name == name) return {&joint, a};
  }
  throw input_error("measures.joint", name, "a joint of the scene, or joint.axis");
}

Measure::Measure(const scene::Scene& scene, const MeasureSpec& spec)
    : reduce_(measure_kind(spec.kind)->reduce), sample_(measure_kind(spec.kind)->make(scene, spec)) {}

void Measure::update(const Simulation& now) {
  now_ = &now;
  if (reduce_ == Reduce::at_end) return;
  std::optional<Figure> sample = sample_(now);
  if (!sample) return;
  scale_ = std::max(scale_, sample->scale);
  if (reduce_ == Reduce::largest && kept_ && !(sample->value > kept_->value)) return;
  if (reduce_ != Reduce::total) sample->time = now.state().time;
  kept_ = std::move(sample);
}

std::optional<Figure> Measure::figure() const {
  if (reduce_ == Reduce::at_end) return now_ ? sample_(*now_) : std::nullopt;
  std::optional<Figure> out = kept_;
  if (out) out->value /= scale_;
  return out;
}

std::span<const MeasureKind> measure_kinds() {
  static const std::vector<MeasureKind> all = [] {
    std::vector<MeasureKind> out;
    for (const std::span<const MeasureKind> theme : {motion_measures(), joint_measures()})
      out.insert(out.end(), theme.begin(), theme.end());
    return out;
  }();
  return all;
}

const MeasureKind* measure_kind(std::string_view name) {
  const std::span<const MeasureKind> kinds = measure_kinds();
  const auto at =
      std::find_if(kinds.begin(), kinds.end(), [&](const MeasureKind& kind) { return kind.name == name; });
  return at == kinds.end() ? nullptr : &*at;
}

}  // namespace handsim::study
