#include "handsim/study/effects/effects.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/machine.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

/// The scene without the effect of a row.
struct Variant {
  EffectRow* row = nullptr;
  scene::Scene scene;
};

/// What the solver does beside the effects, by key; nothing: it does not.
std::vector<std::pair<std::string, scene::Scene>> without_settings(const scene::Scene& scene) {
  std::vector<std::pair<std::string, scene::Scene>> out;
  const auto add = [&](const char* key) -> engine::Settings& {
    out.emplace_back(std::string("solver.") + key, scene);
    return out.back().second.spec.solver;
  };
  engine::Settings settings = scene.spec.solver;
  if (settings.engine() == engine::EngineKind::ode && settings.ode().projection)
    add("projection").ode().projection = false;
  if (const bool* on = engine::speculative(settings); on && *on && settings.effects.any_contact())
    *engine::speculative(add("speculative")) = false;
  if (settings.engine() == engine::EngineKind::ode && settings.ode().guard) add("guard").ode().guard.reset();
  return out;
}

/// One row for each effect and setting, and the scenes that are possible.
std::vector<Variant> variants(const scene::Scene& scene, std::vector<EffectRow>& rows) {
  const model::Effects& effects = scene.spec.solver.effects;
  std::vector<model::Effect> taken;
  for (int i = 0; i < model::kEffectCount; ++i)
    if (effects.has(static_cast<model::Effect>(i))) taken.push_back(static_cast<model::Effect>(i));
  std::vector<std::pair<std::string, scene::Scene>> settings;
  if (!taken.empty()) settings = without_settings(scene);
  rows.resize(taken.size() + settings.size());
  std::vector<Variant> out;
  for (std::size_t k = 0; k < taken.size(); ++k) {
    EffectRow& row = rows[k];
    row.name = model::name(taken[k]);
    try {
      Variant variant{&row, scene::without_effect(scene, taken[k])};
      for (const model::Effect other : taken)
        if (other != taken[k] && !variant.scene.spec.solver.effects.has(other)) row.with.push_back(other);
      out.push_back(std::move(variant));
    } catch (const Error& error) {
      row.fault = error.what();
    }
  }
  for (std::size_t k = 0; k < settings.size(); ++k) {
    EffectRow& row = rows[taken.size() + k];
    row.name = std::move(settings[k].first);
    out.push_back({&row, std::move(settings[k].second)});
  }
  return out;
}

/// Differences of two states of one model, gathered over a run.
class Comparison {
 public:
  Comparison(const model::Model& model, EffectRow& row) : model_(model), row_(row) {}

  void look(const model::State& whole, const model::State& without) {
    for (std::size_t i = 1; i < model_.bodies.size(); ++i)
      book(row_.displacement, (without.bodies[i].p - whole.bodies[i].p).norm(), whole.time,
           model_.bodies[i].name);
    for (const model::Joint& joint : model_.joints) {
      if (joint.kind == model::JointKind::slider) continue;
      const auto first = static_cast<std::size_t>(joint.first_dof);
      const std::span a = std::span(whole.q).subspan(first), b = std::span(without.q).subspan(first);
      if (joint.kind == model::JointKind::ball) {
        const Quat turn = model::joint_transform(joint, a).q.conjugate() * model::joint_transform(joint, b).q;
        book_angle(rotation_vector(turn).norm(), whole.time, joint.name);
      }
      for (std::size_t k = 0; k < joint.axes.size(); ++k)
        book_angle(std::abs(std::remainder(b[k] - a[k], 2 * M_PI)), whole.time,
                   joint.name + "." + joint.axes[k].name);
    }
  }

  void finish() {
    if (count_ > 0) row_.angle_rms = std::sqrt(sum_ / static_cast<double>(count_));
  }

 private:
  static void book(simulation::Peak& peak, double value, double time, const std::string& where) {
    if (value > peak.value) peak = {value, time, where};
  }
  void book_angle(double value, double time, const std::string& where) {
    book(row_.angle, value, time, where);
    sum_ += value * value;
    ++count_;
  }

  const model::Model& model_;
  EffectRow& row_;
  double sum_ = 0;
  long count_ = 0;
};

/// A share of the whole work at a time.
class Work {
 public:
  Work(double steps, const std::function<void(double)>& progress) : steps_(steps), progress_(progress) {}
  void add(double steps) {
    done_ += steps;
    if (progress_) progress_(std::min(1.0, done_ / steps_));
  }

 private:
  double steps_;
  const std::function<void(double)>& progress_;
  double done_ = 0;
};

/// What a variant moves otherwise: all go side by side, each until something goes wrong in it.
void compare_motions(const scene::Scene& scene, std::vector<Variant>& variants, Work& work) {
  struct Runner {
    Variant* variant;
    std::unique_ptr<Simulation> simulation;
    Comparison comparison;
  };
  Simulation whole(scene);
  std::vector<Runner> runners;
  for (Variant& variant : variants) {
    try {
      runners.push_back({&variant, std::make_unique<Simulation>(variant.scene),
                         Comparison(variant.scene.model, *variant.row)});
    } catch (const Error& error) {
      variant.row->fault = error.what();
    }
  }
  for (long i = 0; i < whole.step_count(); ++i) {
    whole.step();
    for (Runner& runner : runners) {
      if (runner.variant->row->fault) continue;
      try {
        runner.simulation->step();
        runner.comparison.look(whole.state(), runner.simulation->state());
      } catch (const Error& error) {
        runner.variant->row->fault = error.what();
      }
    }
    work.add(1 + static_cast<double>(variants.size()));
  }
  for (Runner& runner : runners) runner.comparison.finish();
  std::erase_if(variants, [](const Variant& variant) { return variant.row->fault.has_value(); });
}

/// CPU time of a step [ns], nothing recorded.
double timed(const scene::Scene& scene, Work& work) {
  Simulation simulation(scene);
  const long steps = simulation.step_count();
  const double start = cpu_now();
  for (long i = 0; i < steps; ++i) simulation.step();
  const double taken = cpu_now() - start;
  work.add(static_cast<double>(steps));
  return 1e9 * taken / static_cast<double>(steps);
}

/// Times the scene and its variants in turns, so that a machine that slows down slows all.
void time_all(const scene::Scene& scene, const std::vector<Variant>& variants, EffectsResult& result,
              Work& work) {
  std::vector<double> whole;
  std::vector<std::vector<double>> without(variants.size());
  for (int round = 0; round <= result.repeats; ++round) {
    const double first = timed(scene, work);
    if (round > 0) whole.push_back(first);
    for (std::size_t i = 0; i < variants.size(); ++i) {
      const double other = timed(variants[i].scene, work);
      if (round > 0) without[i].push_back(other);
    }
  }
  result.ns_per_step = median(whole);
  for (std::size_t i = 0; i < variants.size(); ++i) {
    EffectRow& row = *variants[i].row;
    row.ns_per_step = median(without[i]);
    std::vector<double> saved(whole.size());
    for (std::size_t k = 0; k < saved.size(); ++k) saved[k] = whole[k] - without[i][k];
    row.saved_ns = median(saved);
    std::sort(saved.begin(), saved.end());
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
    result.has_angles = result.has_angles || joint.kind != model::JointKind::slider;
  std::vector<Variant> possible = variants(scene, result.rows);
  if (result.rows.empty()) throw input_error("effects", "no effect", "a scene with one effect at least");
  Work work(static_cast<double>(result.steps) * (2 + repeats) * (1 + static_cast<double>(possible.size())),
            progress);
  compare_motions(scene, possible, work);
  time_all(scene, possible, result, work);
  return result;
}

}  // namespace handsim::study
