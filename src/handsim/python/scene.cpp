#include <map>

#include "handsim/core/data_folder.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/core/yaml.h"
#include "handsim/engine/checks.h"
#include "handsim/engine/muscles.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"
#include "handsim/scene/compile/overruled.h"
#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::python {

namespace {

SceneHandle load(const std::filesystem::path& path, const std::vector<std::string>& overrides) {
  return without_gil(
      [&] { return SceneHandle{std::make_shared<const scene::Scene>(scene::load_scene(path, overrides))}; });
}

/// @param name of the text in messages; references in it start from its folder.
SceneHandle parse(const std::string& text, const std::string& name,
                  const std::vector<std::string>& overrides) {
  return without_gil([&] {
    return SceneHandle{
        std::make_shared<const scene::Scene>(scene::load_scene(parse_yaml(text, name), overrides))};
  });
}

std::vector<std::string> effects(const SceneHandle& of) {
  std::vector<std::string> out;
  for (int i = 0; i < model::kEffectCount; ++i)
    if (const auto effect = static_cast<model::Effect>(i); of.scene->spec.solver.effects.has(effect))
      out.emplace_back(name(effect));
  return out;
}

std::vector<std::string> driven_axes(const SceneHandle& of) {
  return of.scene->control ? names(of.scene->control->axes) : std::vector<std::string>();
}

std::vector<std::size_t> driven_coordinates(const SceneHandle& of) {
  std::vector<std::size_t> out;
  if (of.scene->control)
    for (const control::DrivenAxis& axis : of.scene->control->axes) out.push_back(axis.dof);
  return out;
}

std::vector<std::string> driven_wrists(const SceneHandle& of) {
  std::vector<std::string> out;
  for (const auto& drive : of.scene->model.drives)
    out.push_back(of.scene->model.bodies[as_index(drive.body)].name);
  return out;
}

/// Angles of the joints of each named pose of the scene's control [rad].
std::map<std::string, std::map<std::string, std::vector<double>>> named_poses(const SceneHandle& of) {
  std::map<std::string, std::map<std::string, std::vector<double>>> out;
  if (of.scene->spec.control && of.scene->spec.control->poses)
    for (const auto& [name, pose] : of.scene->spec.control->poses->poses)
      for (const auto& [joint, angles] : pose.joints) out[name][joint] = angles.angles;
  return out;
}

/// Names of the objects that can move.
std::vector<std::string> objects(const SceneHandle& of) {
  std::vector<std::string> out;
  for (const scene::ObjectSpec& object : of.scene->plans.objects)
    if (!object.is_static) out.push_back(object.name);
  return out;
}

/// Names of all objects, in the order of the scene's file, and whether each can move.
std::vector<std::pair<std::string, bool>> all_objects(const SceneHandle& of) {
  std::vector<std::pair<std::string, bool>> out;
  for (const scene::ObjectSpec& object : of.scene->plans.objects)
    out.emplace_back(object.name, !object.is_static);
  return out;
}

/// The numbers that a step takes from outside: bodies on which forces act, poses of driven wrists,
/// excitations.
py::tuple takes(const SceneHandle& of) {
  const model::Model& model = of.scene->model;
  const engine::Settings& settings = of.scene->spec.solver;
  const auto fits = [&](const engine::StepInput& input) {
    try {
      return !engine::input_fault(model, settings, 0, input);
    } catch (const Error&) {
      return false;
    }
  };
  std::vector<std::string> bodies;
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    engine::BodyForce force;
    force.body = static_cast<int>(i);
    if (fits({.forces = std::span(&force, 1)})) bodies.push_back(model.bodies[i].name);
  }
  const std::vector<Pose> wrists(model.drives.size());
  const std::vector<double> excitations(model.muscles.size());
  return py::make_tuple(bodies, fits({.drive_targets = wrists}), fits({.excitations = excitations}));
}

/// SI of a number with any unit, as in files; None for another text.
std::optional<double> parse_any_quantity(const std::string& text) {
  for (int i = 0; i <= static_cast<int>(Dimension::force); ++i)
    if (const auto value = parse_quantity(text, static_cast<Dimension>(i))) return value;
  return std::nullopt;
}

/// The fields of Muscle in _scene.py.
py::list muscles(const SceneHandle& of) {
  py::list out;
  const model::Model& model = of.scene->model;
  for (const model::Muscle& each : model.muscles)
    out.append(py::make_tuple(each.name, simulation::moved_by(each, model), each.nerve, each.extrinsic,
                              each.force, each.fibre_length, each.slack_length, each.pennation));
  return out;
}

/// The files that make the same scene anywhere, by their paths relative to resolved.yaml.
py::dict standalone(const SceneHandle& of) {
  py::dict out;
  out["resolved.yaml"] = py::bytes(scene::standalone_text(of.scene->resolved, of.scene->inputs));
  for (const scene::ReferencedFile& input : of.scene->inputs)
    out[py::str(input.copy)] = py::bytes(*input.bytes);
  return out;
}

}  // namespace

void bind_scene(py::module_& module) {
  module.def("parse_quantity", &parse_any_quantity);
  module.def("parse_time", [](const std::string& text) { return parse_quantity(text, Dimension::time); });
  module.def("need_word", &need_word);
  module.def("find_input", &find_input);
  auto bound = bind_class<SceneHandle>(module, "Scene");
  bound.def_static("load", &load)
      .def_static("parse", &parse)
      .def("effects", &effects)
      .def("driven_axes", &driven_axes)
      .def("driven_coordinates", &driven_coordinates)
      .def("driven_wrists", &driven_wrists)
      .def("poses", &named_poses)
      .def("objects", &objects)
      .def("all_objects", &all_objects)
      .def("takes", &takes)
      .def("muscles", &muscles)
      .def("standalone", &standalone)
      .def("bodies", [](const SceneHandle& of) { return names(of.scene->model.bodies); })
      .def("hands", [](const SceneHandle& of) { return names(of.scene->model.hands); })
      .def("coordinates", [](const SceneHandle& of) { return output::coordinate_names(of.scene->model); });
  const auto property = [&](const char* name, auto find) {
    bound.def_property_readonly(name, [find](const SceneHandle& of) { return find(*of.scene); });
  };
  property("title", [](const scene::Scene& of) { return of.spec.title; });
  property("duration", [](const scene::Scene& of) { return of.spec.duration; });
  property("step", [](const scene::Scene& of) { return of.spec.solver.step; });
  property("engine", [](const scene::Scene& of) { return name(of.spec.solver.engine()); });
  property("method", [](const scene::Scene& of) { return name(of.spec.solver.method()); });
  property("engine_choice", [](const scene::Scene& of) { return of.spec.engine_choice; });
  property("record_every", [](const scene::Scene& of) { return of.spec.record_every; });
  property("has_contact", [](const scene::Scene& of) { return of.spec.solver.effects.any_contact(); });
  property("warnings", [](const scene::Scene& of) { return of.warnings; });
}

}  // namespace handsim::python
