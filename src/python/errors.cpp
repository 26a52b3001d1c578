#include "handsim/core/error.h"
#include "handsim/python/bindings.h"

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

}  // namespace

void bind_errors(py::module_& /*module*/) {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& error) {
      raise(error);
    }
  });
}

}  // namespace handsim::python
