#include "handsim/python/bindings.h"

#include <algorithm>
#include <array>
#include <string_view>

#include <pybind11/functional.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/core/data_folder.h"
#include "handsim/core/error.h"
#include "handsim/core/version.h"
#include "handsim/output/render/image.h"
#include "handsim/python/signals.h"
#include "handsim/simulation/fingerprint.h"

namespace handsim::python {

namespace {

py::tuple problem_tuple(const Problem& problem) {
  if (!problem.place || problem.place->file.empty())
    return py::make_tuple(py::none(), py::none(), py::none(), problem.key, problem.got, problem.need);
  return py::make_tuple(problem.place->file, problem.place->line, problem.place->column, problem.key,
                        problem.got, problem.need);
}

void raise(const Error& error) {
  const char* kind = error.kind() == ErrorKind::input     ? "input"
                     : error.kind() == ErrorKind::physics ? "physics"
                                                          : "output";
  py::list problems;
  for (const Problem& problem : error.problems()) problems.append(problem_tuple(problem));
  py::object fault = py::none();
  if (error.fault())
    fault = py::make_tuple(error.fault()->time, error.fault()->where, error.fault()->quantity,
                           error.fault()->detail);
  const py::object make = py::module_::import("handsim._errors").attr("from_core");
  const py::object raised = make(error.what(), kind, problems, fault);
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(raised.ptr())), raised.ptr());
}

void translate_errors() {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& error) {
      raise(error);
    }
  });
}

bool has_pictures() {
  try {
    output::require_pictures();
    return true;
  } catch (const Error&) {
    return false;
  }
}

/// `handsim COMMAND ...` in this process. @param page of a run
/// @return its exit status
int command_line(const std::vector<std::string>& words, const app::WritePage& page) {
  std::vector<const char*> argv = {"handsim"};
  for (const std::string& word : words) argv.push_back(word.c_str());
  // A part of run is the package's, whose process this is.
  const auto more = !words.empty() && words[0] == "run" ? &app::add_other_commands : nullptr;
  return without_gil([&] {
    return app::finish_output(app::run_command_line(static_cast<int>(argv.size()), argv.data(), more, page));
  });
}

}  // namespace

}  // namespace handsim::python

PYBIND11_MODULE(_core, module) {
  using namespace handsim::python;
  module.attr("version") = handsim::kVersion;
  module.attr("commit") = handsim::kCommit;
  module.attr("mathematics") = handsim::simulation::mathematics();
  module.def("has_pictures", &has_pictures);
  module.def("data_folder", [] { return handsim::data_folder().string(); });
  module.def("command_line", &command_line, py::arg("words"), py::arg("page") = handsim::app::WritePage());
  bind_description(module);
  translate_errors();
  bind_scene(module);
  bind_hand(module);
  bind_measurements(module);
  bind_page(module);
  bind_pictures(module);
  bind_run(module);
  bind_files(module);
  bind_fit(module);
  bind_simulation(module);
  bind_batch(module);
  bind_studies(module);
  bind_track(module);
  bind_rollouts(module);
  bind_grasps(module);
  bind_inverse(module);
}
