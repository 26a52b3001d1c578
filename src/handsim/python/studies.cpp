#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"
#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/rollouts/population.h"

namespace handsim::python {

namespace {

using std::filesystem::path;

// Each study writes its command's files into a folder; returns the command's text. Python reads the files.

/// The scene without each of its effects in turn, then without settings of its solver, by name; where it
/// needs the effect, why.
py::list variants(const SceneHandle& of) {
  py::list out;
  const auto add = [&](const std::string& name, scene::Scene scene) {
    out.append(py::make_tuple(name, SceneHandle{std::make_shared<const scene::Scene>(std::move(scene))}));
  };
  const engine::Settings& solver = of.scene->spec.solver;
  for (int i = 0; i < model::kEffectCount; ++i) {
    const auto effect = static_cast<model::Effect>(i);
    if (!solver.effects.has(effect)) continue;
    const std::string name(model::name(effect));
    try {
      add(name, scene::without_effect(*of.scene, effect));
    } catch (const Error& error) {
      out.append(py::make_tuple(name, error.what()));
    }
  }
  if (solver.engine() == engine::EngineKind::ode && solver.ode().projection) {
    scene::Scene scene = *of.scene;
    scene.spec.solver.ode().projection = false;
    add("solver.projection", std::move(scene));
  }
  scene::Scene scene = *of.scene;
  if (bool* on = engine::speculative(scene.spec.solver); on && *on && solver.effects.any_contact()) {
    *on = false;
    add("solver.speculative", std::move(scene));
  }
  return out;
}

/// Stature [m], mass [kg] and sex.
using PersonNumbers = std::tuple<double, double, std::string>;
/// @param male absent: women and men with equal chances
std::vector<PersonNumbers> draw_persons(const std::string& population, int count, std::uint64_t seed,
                                        std::optional<bool> male) {
  const study::Population* of = study::population(population);
  if (!of) throw input_error("population", population, std::string(study::populations().front().name));
  std::optional<hand::Sex> sex;
  if (male) sex = *male ? hand::Sex::male : hand::Sex::female;
  std::vector<PersonNumbers> out;
  for (int i = 0; i < count; ++i) {
    environment::Draws draws(seed, static_cast<std::uint64_t>(i), "person");
    const hand::Person each = study::draw_person(*of, sex, draws);
    out.emplace_back(each.stature, each.mass, each.sex == hand::Sex::male ? "male" : "female");
  }
  return out;
}

}  // namespace

void bind_studies(py::module_& module) {
  module.def("draw_persons", &draw_persons);
  bind_class<study::AccuracySpec>(module, "Accuracy")
      .def_property_readonly("scenes",
                             [](const study::AccuracySpec& of) {
                               std::vector<path> out = {of.scene};
                               for (const study::AccuracyMethod& method : of.methods)
                                 if (method.scene) out.push_back(*method.scene);
                               return out;
                             })
      .def("run", [](const study::AccuracySpec& of, const py::object& progress) {
        return run_study(progress, [&](StudyHooks& hooks) {
          return study::rows_text(of, study::run_accuracy(of, hooks.told));
        });
      });
  module.def("accuracy", [](const path& file) {
    return std::make_unique<study::AccuracySpec>(study::load_accuracy(file));
  });
  module.def("variants", &variants);
  module.def("cpu_seconds", [](const SceneHandle& of, long warm_up, long steps) {
    return without_gil([&] { return study::cpu_seconds(*of.scene, warm_up, steps); });
  });
}

}  // namespace handsim::python
