// Rows of rollout studies, for python/handsim/_rollouts.py, and how all studies of the package write.
#include "handsim/study/rollouts/rollouts.h"

#include "handsim/core/archive.h"
#include "handsim/core/input_file.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/inverse.h"
#include "handsim/python/signals.h"
#include "handsim/simulation/run/output_size.h"
#include "handsim/study/report.h"

namespace handsim::python {

namespace {

using std::filesystem::path;

/// Ends the work of all threads that have it.
struct Stop {
  std::atomic<bool> asked = false;
};

study::RolloutsSpec spec_of(const study::RolloutsAsked& asked, const std::optional<InverseAsked>& inverse) {
  if (!inverse) return study::asked_rollouts(asked);
  return study::uncertain_inverse(asked.file, asked.overrides, inverse_input(*inverse), *asked.count);
}

/// A study with what it has read: any machine can compute its rows.
class Rollouts {
 public:
  /// @param folder from which the study's path goes. @param files that are carried; none: those of the disk
  Rollouts(const study::RolloutsAsked& asked, const std::optional<InverseAsked>& inverse, const path& folder,
           std::map<std::string, std::string> files)
      : carried_{folder, std::move(files)}, study_(read(asked, inverse)) {}

  const study::RolloutStudy& study() const { return study_; }
  const std::map<std::string, std::string>& files() const { return carried_.files; }
  study::RolloutRows rows(long from, long to, const Stop& stop) {
    const CarriedScope scope(carried_, false);
    return study::rollout_rows(study_, from, to, stop.asked);
  }

 private:
  study::RolloutStudy read(const study::RolloutsAsked& asked, const std::optional<InverseAsked>& inverse) {
    const CarriedScope scope(carried_, carried_.files.empty());
    return study::RolloutStudy(spec_of(asked, inverse));
  }

  CarriedFiles carried_;
  study::RolloutStudy study_;
};

std::unique_ptr<Rollouts> rollouts(const path& file, bool uncertain, std::vector<std::string> overrides,
                                   std::optional<int> count, std::optional<int> seed, bool bands,
                                   const std::optional<InverseAsked>& inverse, const path& folder,
                                   std::map<std::string, py::bytes> files) {
  std::map<std::string, std::string> carried(files.begin(), files.end());
  return without_gil([&] {
    return std::make_unique<Rollouts>(
        study::RolloutsAsked{file, uncertain, std::move(overrides), count, seed, bands}, inverse, folder,
        std::move(carried));
  });
}

/// Columns as name, role and whether they are texts.
py::dict head_of(const Rollouts& of) {
  constexpr std::array kRoles = {"index", "drawn", "outcome", "figure", "asked"};
  const study::TableHead& head = of.study().head();
  py::list columns;
  for (const study::Column& column : head.columns)
    columns.append(py::make_tuple(column.name, kRoles[static_cast<std::size_t>(column.role)], column.text));
  py::dict out;
  out["title"] = head.title, out["size"] = head.size, out["seed"] = head.seed, out["columns"] = columns;
  out["origin"] = head.origin, out["csv"] = study::csv_head(head);
  return out;
}

/// Sizes of a rollout that is written whole: rows and numbers in a row, at most; how many are written.
std::tuple<double, std::size_t, int> recorded(const Rollouts& of) {
  const scene::Scene& scene = of.study().sample();
  return {1 + scene.spec.duration / scene.spec.solver.step /
                  static_cast<double>(simulation::record_steps(scene.spec)),
          output::trajectory_columns(scene.model).size(), of.study().spec().trajectories};
}

py::tuple series(const study::TimeSeries& of) {
  return py::make_tuple(of.columns, array_of(of.values, of.columns.size()));
}

/// The end of the range that is there, the lines of CSV, trajectories by rollout, and curves.
py::tuple rows(Rollouts& of, long from, long to, const Stop& stop) {
  const study::RolloutRows found = without_gil([&] { return of.rows(from, to, stop); });
  py::dict trajectories;
  for (const auto& [rollout, each] : found.trajectories) trajectories[py::int_(rollout)] = series(each);
  py::list curves;
  for (const study::TimeSeries& each : found.curves) curves.append(series(each));
  return py::make_tuple(found.to, py::bytes(found.csv), trajectories, curves);
}

/// Plots as name, terminal and commands. @return false: gnuplot is missing or failed
bool write_plots(const path& out, const std::string& name, const std::string& data,
                 const std::vector<std::tuple<std::string, std::string, std::string>>& plots) {
  study::Report report;
  report.data = data;
  for (const auto& [plot, terminal, commands] : plots) report.plots.push_back({plot, terminal, commands});
  return without_gil([&] { return study::write_report(out, name, report); });
}

}  // namespace

void bind_rollouts(py::module_& module) {
  bind_class<Stop>(module, "Stop").def("set", [](Stop& of) { of.asked = true; });
  module.def("stop", [] { return std::make_unique<Stop>(); });
  bind_class<Rollouts>(module, "Rollouts")
      .def_property_readonly("head", &head_of)
      .def_property_readonly("recorded", &recorded)
      .def_property_readonly("warnings", [](const Rollouts& of) { return of.study().warnings(); })
      .def_property_readonly("read", [](const Rollouts& of) { return of.study().files(); })
      .def_property_readonly("carried",
                             [](const Rollouts& of) {
                               std::map<std::string, py::bytes> out(of.files().begin(), of.files().end());
                               return out;
                             })
      .def("rows", &rows)
      .def("crashed", [](const Rollouts& of, long rollout, const std::string& error) {
        return py::bytes(study::crashed_row(of.study(), rollout, error));
      });
  module.def("rollouts", &rollouts);
  module.def("check_free", &simulation::check_free);
  module.def("write_plots", &write_plots);
  module.def("json_text", [](const std::string& text) { return study::Json::parse(text).dump(2) + "\n"; });
  module.def("bytes_hash", [](const py::buffer& of) {
    const py::buffer_info bytes = of.request();
    return hash_bytes({static_cast<const char*>(bytes.ptr), static_cast<std::size_t>(bytes.size)});
  });
  module.def("origin", [] {
    study::Json out;
    study::add_origin(out);
    return out.dump();
  });
  module.def("finish_study", [](const path& out, const std::string& command,
                                const std::map<std::string, std::vector<std::string>>& rows,
                                const std::map<std::string, std::string>& templates, bool report) {
    study::finish_study(out, {command, rows, templates}, report);
  });
  module.def("command_text", &study::command_text);
}

}  // namespace handsim::python
