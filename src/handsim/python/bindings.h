// The module handsim._core: thin bindings. Public classes and their documentation are in python/handsim/.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/watch/watcher.h"

namespace handsim::python {

namespace py = pybind11;

using ScenePtr = std::shared_ptr<const scene::Scene>;

/// A scene that Python holds; simulations and batches share it.
struct SceneHandle {
  ScenePtr scene;
};

/// What a picture shows, in place of the scene's own `pictures`.
struct PictureChoice {
  std::optional<std::array<int, 2>> size;  ///< width, height [pixels]
  std::optional<std::string> view;
  /// Position [m], target [m] and vertical field of view [rad].
  std::optional<std::tuple<std::array<double, 3>, std::array<double, 3>, double>> camera;
};

/// A class whose objects come from functions of the module alone. pybind11's own `__new__` would make one
/// without its C++ object, and every use of it would read memory that nobody has written.
template <class T>
py::class_<T> bind_class(py::module_& module, const char* name) {
  py::class_<T> out(module, name);
  reinterpret_cast<PyTypeObject*>(out.ptr())->tp_new = [](PyTypeObject* type, PyObject*,
                                                          PyObject*) -> PyObject* {
    PyErr_Format(PyExc_TypeError, "%s: a function of handsim makes these", type->tp_name);
    return nullptr;
  };
  return out;
}

/// Pictures of moments with one common camera, as arrays [height, width, 3] of bytes; without the GIL.
py::list draw_all(const scene::Scene& scene, std::vector<simulation::PictureState> moments,
                  const PictureChoice& choice);

/// A tuple of each, as handsim.Verdict.
py::list verdict_list(const std::vector<simulation::Verdict>& verdicts);

template <class List>
std::vector<std::string> names(const List& list) {
  std::vector<std::string> out;
  for (const auto& each : list) out.push_back(each.name);
  return out;
}

void bind_description(py::module_& module);
void bind_grasps(py::module_& module);
void bind_inverse(py::module_& module);
void bind_scene(py::module_& module);
void bind_hand(py::module_& module);
void bind_measurements(py::module_& module);
void bind_page(py::module_& module);
void bind_pictures(py::module_& module);
void bind_run(py::module_& module);
void bind_files(py::module_& module);
void bind_fit(py::module_& module);
void bind_simulation(py::module_& module);
void bind_batch(py::module_& module);
void bind_studies(py::module_& module);
void bind_track(py::module_& module);
void bind_rollouts(py::module_& module);

}  // namespace handsim::python
