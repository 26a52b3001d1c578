#include "handsim/study/effects/effects.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

/// The scene without the effect of a row.
struct Variant {
  EffectRow row;
  std::optional<scene::Scene> scene = {};  ///< nothing if the scene needs the effect
};

std::vector<model::Effect> effects_of(const scene::Scene& scene) {
  std::vector<model::Effect> out;
  for (int i = 0; i < model::kEffectCount; ++i)
    if (const auto effect = static_cast<model::Effect>(i); scene.spec.solver.effects.has(effect))
      out.push_back(effect);
  return out;
}

/// The scene without one of its effects. @throws Error (input) if the scene needs it.
Variant without(const scene::Scene& scene, model::Effect effect) {
  Variant out;
  out.row.name = model::name(effect);
  out.scene = scene::without_effect(scene, effect);
  for (const model::Effect other : effects_of(scene))
    if (other != effect && !out.scene->spec.solver.effects.has(other)) out.row.with.push_back(other);
  std::vector<std::string_view> left;
  for (const model::Effect other : effects_of(*out.scene)) left.push_back(model::name(other));
  out.row.set = fmt::format("effects=[{}]", fmt::join(left, ", "));
  return out;
}

/// Adds a variant for each solver setting that can be turned off.
void add_settings(const scene::Scene& scene, std::vector<Variant>& out) {
  const auto add = [&](const char* key) -> engine::Settings& {
    Variant& variant = out.emplace_back();
    variant.row.name = std::string("solver.") + key;
    variant.scene = scene;
    return variant.scene->spec.solver;
  };
  engine::Settings settings = scene.spec.solver;
  if (settings.engine() == engine::EngineKind::ode && settings.ode().projection)
    add("projection").ode().projection = false;
  if (const bool* on = engine::speculative(settings); on && *on && settings.effects.any_contact())
    *engine::speculative(add("speculative")) = false;
}

/// One variant for each effect and setting.
std::vector<Variant> variants(const scene::Scene& scene) {
  std::vector<Variant> out;
  for (const model::Effect effect : effects_of(scene)) {
    try {
      out.push_back(without(scene, effect));
    } catch (const Error& error) {
      out.emplace_back().row = {.name = std::string(model::name(effect)), .fault = error.what()};
    }
  }
  if (!out.empty()) add_settings(scene, out);
  return out;
}

/// Accumulates the differences between two runs of one model.
class Comparison {
 public:
  Comparison(const model::Model& model, EffectRow& row) : model_(model), row_(row) {}

  void update(const model::State& whole, const model::State& without) {
    for (std::size_t i = 1; i < model_.bodies.size(); ++i)
      row_.displacement.raise((without.bodies[i].p - whole.bodies[i].p).norm(), whole.time,
                              model_.bodies[i].name);
    for (const model::Joint& joint : model_.joints) {
      const auto first = static_cast<std::size_t>(joint.first_dof);
      const std::span a = std::span(whole.q).subspan(first), b = std::span(without.q).subspan(first);
      if (joint.spherical()) {
        const Quat turn = model::joint_transform(joint, a).q.conjugate() * model::joint_transform(joint, b).q;
        add_angle(rotation_vector(turn).norm(), whole.time, joint.name);
      }
      for (std::size_t k = 0; k < joint.axes.size(); ++k)
        if (!joint.slides(k))
          add_angle(std::abs(std::remainder(b[k] - a[k], 2 * M_PI)), whole.time,
                    joint.name + "." + joint.axes[k].name);
    }
    if (count_ > 0) row_.angle_rms = std::sqrt(sum_ / static_cast<double>(count_));
  }

 private:
  void add_angle(double value, double time, const std::string& where) {
    row_.angle.raise(value, time, where);
    sum_ += value * value;
    ++count_;
  }

  const model::Model& model_;
  EffectRow& row_;
  double sum_ = 0;
  long count_ = 0;
};

/// Reports steps that are done.
using Work = std::function<void(double steps)>;

/// Compares the motion of all variants with that of the complete scene, step by step, each until it fails.
void compare_motions(const scene::Scene& scene, std::vector<Variant>& variants, const Work& work) {
  struct Runner {
    EffectRow& row;
    Simulation simulation;
    Comparison comparison;
  };
  Simulation whole(scene);
  std::vector<Runner> runners;
  for (Variant& variant : variants)
    if (variant.scene)
      attempt(variant.row, true, [&] {
        runners.push_back({variant.row, Simulation(*variant.scene), {variant.scene->model, variant.row}});
      });
  for (long i = 0; i < whole.step_count(); ++i) {
    whole.step();
    for (Runner& runner : runners)
      attempt(runner.row, true, [&] {
        runner.simulation.step();
        runner.comparison.update(whole.state(), runner.simulation.state());
      });
    work(1 + static_cast<double>(runners.size()));
  }
}

/// CPU time of a step [ns]; the run records nothing.
double time_per_step(const scene::Scene& scene, const Work& work) {
  Simulation simulation(scene);
  const long steps = simulation.step_count();
  const double start = cpu_now();
  for (long i = 0; i < steps; ++i) simulation.step();
  const double taken = cpu_now() - start;
  work(static_cast<double>(steps));
  return 1e9 * taken / static_cast<double>(steps);
}

/// Times the scene and its variants in turn, so that a slower machine affects all; the first round warms up.
void time_all(const scene::Scene& scene, std::vector<Variant>& variants, EffectsResult& result,
              const Work& work) {
  std::vector<double> whole;
  std::vector<std::vector<double>> without(variants.size());
  for (int round = 0; round <= result.repeats; ++round) {
    whole.push_back(time_per_step(scene, work));
    for (std::size_t i = 0; i < variants.size(); ++i)
      if (!variants[i].row.fault) without[i].push_back(time_per_step(*variants[i].scene, work));
    if (round > 0) continue;
    whole.clear();
    for (std::vector<double>& times : without) times.clear();
  }
  result.ns_per_step = median(whole);
  for (std::size_t i = 0; i < variants.size(); ++i) {
    EffectRow& row = variants[i].row;
    if (row.fault) continue;
    row.ns_per_step = median(without[i]);
    std::vector<double> saved(whole.size());
    for (std::size_t k = 0; k < saved.size(); ++k) saved[k] = whole[k] - without[i][k];
    row.saved_ns = median(saved);
    std::ranges::sort(saved);
    row.noise_ns = 0.5 * (saved[saved.size() * 3 / 4] - saved[saved.size() / 4]);
  }
}

}  // namespace

EffectsResult run_effects(const scene::Scene& scene, int repeats,
                          const std::function<void(double)>& progress) {
  EffectsResult result;
  result.repeats = repeats;
  result.steps = Simulation(scene).step_count();
  for (const model::Joint& joint : scene.model.joints)
    result.has_angles = result.has_angles || !joint.slides(as_index(dof_count(joint.kind)) - 1);
  std::vector<Variant> all = variants(scene);
  if (all.empty()) throw input_error("effects", "no effect", "a scene with at least one effect");
  const auto possible = std::ranges::count_if(all, [](const Variant& v) { return !v.row.fault; });
  const double total =
      static_cast<double>(result.steps) * (2 + repeats) * (1 + static_cast<double>(possible));
  const Work work = [&, done = 0.0](double steps) mutable {
    done += steps;
    if (progress) progress(std::min(1.0, done / total));
  };
  compare_motions(scene, all, work);
  time_all(scene, all, result, work);
  for (Variant& variant : all) result.rows.push_back(std::move(variant.row));
  return result;
}

}  // namespace handsim::study
