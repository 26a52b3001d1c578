// Inverse dynamics, for python/handsim/_inverse.py.
#include "handsim/python/inverse.h"

#include "handsim/app/commands.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/output/table/table_files.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"

#include <pybind11/functional.h>

namespace handsim::python {

study::InverseInput inverse_input(const InverseAsked& asked) {
  study::InverseInput out;
  OptionalPath names;
  std::tie(out.motion, names, out.loads, out.options.filter, out.options.clamp, out.least_activation) = asked;
  if (names)
    out.options.names = app::load_kind(*names, scene::FileKind::motion_names, control::read_motion_names);
  out.forward = false;
  return out;
}

namespace {

/// The fields of Result in _inverse.py.
py::dict inverse(const SceneHandle& of, const InverseAsked& asked, bool check, const py::object& progress) {
  study::InverseInput input = inverse_input(asked);
  input.forward = check;
  const study::InverseResult found = run_study(
      progress, [&](StudyHooks& hooks) { return study::run_inverse(*of.scene, input, hooks.told); });
  py::list axes;
  for (const study::InverseAxis& axis : found.axes)
    axes.append(py::make_tuple(axis.name, axis.largest_torque, axis.rms_torque, axis.rms_error,
                               axis.largest_error, axis.largest_reserve, axis.rms_reserve));
  // Rows to the first without such numbers; of the motion's axes, or whole.
  const auto columns = [&](std::vector<double> study::InverseRow::*member, bool whole) {
    std::vector<double> out;
    std::size_t width = whole ? of.scene->model.muscles.size() : found.axes.size();
    for (const study::InverseRow& row : found.rows) {
      if ((row.*member).empty()) break;
      if (whole) out.insert(out.end(), (row.*member).begin(), (row.*member).end());
      for (std::size_t i = 0; i < width && !whole; ++i) out.push_back((row.*member)[found.axes[i].dof]);
    }
    return array_of(out, std::max<std::size_t>(1, width));
  };
  std::vector<double> times;
  for (const study::InverseRow& row : found.rows) times.push_back(row.time);
  using Row = study::InverseRow;
  py::dict out(
      py::arg("axes") = axes, py::arg("times") = array_of(times), py::arg("q") = columns(&Row::q, false),
      py::arg("moment") = columns(&Row::moment, false), py::arg("passive") = columns(&Row::passive, false),
      py::arg("forward") = columns(&Row::forward, false), py::arg("reserve") = columns(&Row::reserve, false),
      py::arg("activation") = columns(&Row::activation, true),
      py::arg("excitation") = columns(&Row::excitation, true), py::arg("cutoff") = found.cutoff,
      py::arg("rms_error") = found.rms_error, py::arg("limit") = study::kLargestCheckError,
      py::arg("window") = study::kCheckWindow, py::arg("agrees") = found.agrees(),
      py::arg("reserve_share") = found.reserve_share, py::arg("fault") = found.fault,
      py::arg("warnings") = found.warnings, py::arg("undone") = py::none());
  if (const auto& undone = found.undone)
    out["undone"] = py::make_tuple(undone->beyond, undone->no_balance, undone->late, undone->other);
  return out;
}

/// A table over time in OpenSim's format. @param most_rows as MotionHead
void write_motion(const std::filesystem::path& path, const output::MotionHead& head,
                  const std::vector<double>& times, const py::object& values) {
  const Numbers rows(values, {static_cast<py::ssize_t>(times.size()), std::ssize(head.names)}, "values");
  without_gil([&] {
    output::MotionTableWriter table(path, head);
    for (std::size_t i = 0; i < times.size(); ++i)
      table.add(times[i], rows.span().subspan(i * head.names.size(), head.names.size()));
    table.finish();
  });
}

/// Panels of a plot as part and commands. @param curve what is drawn of the name with an index, in a colour
py::list hand_panels(const std::vector<std::string>& names,
                     const std::function<std::string(std::size_t, const char*)>& curve) {
  py::list out;
  for (const output::Panel& panel : output::hand_panels(names, curve))
    out.append(py::make_tuple(panel.part, panel.commands));
  return out;
}

}  // namespace

void bind_inverse(py::module_& module) {
  module.def("inverse", &inverse);
  module.def("write_motion", [](const std::filesystem::path& path, const std::string& title,
                                const std::vector<std::string>& names, bool degrees, std::size_t most_rows,
                                const std::vector<double>& times, const py::object& values) {
    write_motion(path, {title, names, most_rows, degrees}, times, values);
  });
  module.def("hand_panels", &hand_panels);
}

}  // namespace handsim::python
