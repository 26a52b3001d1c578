// Files of measurements and the hands of their rows, for python/handsim/_validate.py.
#include "handsim/core/input_file.h"
#include "handsim/environment/draws.h"
#include "handsim/hand/deviations.h"
#include "handsim/model/pulleys.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"
#include "handsim/study/validate/validate.h"

namespace handsim::python {

namespace {

using std::filesystem::path;
using study::Measurements;

/// A scene of a right hand on a wrist that turns, with all that moves and holds its joints, and nothing else.
SceneHandle alone(const Measurements::Model& model, const hand::Person& person) {
  using enum model::Effect;
  scene::SceneSpec spec;
  scene::HandEntry& entry = spec.hands.emplace_back();
  entry.model = model;
  entry.person = person;
  entry.placement.mount = model->wrist.axes.size() == 2 ? hand::Mount::universal : hand::Mount::hinge;
  for (const model::Effect effect : {joint_stops, passive_tissue, muscles, tendon_coupling})
    spec.solver.effects.add(effect);
  return {std::make_shared<const scene::Scene>(scene::compile_scene(std::move(spec)))};
}

/// The first hand of a scene, alone.
SceneHandle first_hand_alone(const SceneHandle& of) {
  if (of.scene->spec.hands.empty()) throw input_error("scene", "a scene without hands", "one with a hand");
  const scene::HandEntry& first = of.scene->spec.hands.front();
  return without_gil([&] { return alone(first.model, first.person); });
}

/// @param variant of the hand; empty: as the file has it
SceneHandle hand_of(const Measurements& of, const std::string& person, const std::string& variant,
                    const std::map<std::string, double>& deviations) {
  hand::Person who = of.people.at(person);
  for (const auto& [name, deviation] : deviations) who.deviations[name] = deviation;
  return without_gil([&] { return alone(variant.empty() ? of.hand : of.variants.at(variant), who); });
}

}  // namespace

void bind_measurements(py::module_& module) {
  module.def("measurements",
             [](const path& file, const path& folder, const std::map<std::string, py::bytes>& files) {
               CarriedFiles carried{folder, {files.begin(), files.end()}};
               auto read = without_gil([&] {
                 const CarriedScope scope(carried, carried.files.empty());
                 return std::make_unique<Measurements>(study::load_measurements(file));
               });
               return std::pair(std::move(read),
                                std::map<std::string, py::bytes>(carried.files.begin(), carried.files.end()));
             });
  bind_class<Measurements>(module, "Measurements")
      .def_property_readonly("text", [](const Measurements& of) { return of.text; })
      .def("hand", &hand_of)
      .def("uncertain", [](const Measurements& of, const std::string& person) {
        return hand::uncertain_of(*of.hand, of.people.at(person), true);
      });
  module.def("hand_alone", &first_hand_alone);
  module.def("normal", [](std::uint64_t seed, std::uint64_t draw, const std::string& name) {
    return environment::Draws(seed, draw, name).normal();
  });
  module.def("pulley_forces", [](double tension, double pip) {
    const model::PulleyForces of = model::pulley_forces({tension, 0}, pip);
    return std::pair(of.a2, of.a4);
  });
  module.def("sheath_gain", &model::sheath_gain);
}

}  // namespace handsim::python
