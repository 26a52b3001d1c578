// What the page of a run needs beside the run's files, and the page itself: _run_page.py makes its data.
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/functional.h>

#include "handsim/app/commands.h"
#include "handsim/core/input_file.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/render/mesh.h"
#include "handsim/output/report/page.h"
#include "handsim/output/report/thinning.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/output/table/table_files.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"
#include "handsim/simulation/run/output_size.h"
#include "handsim/study/report.h"

namespace handsim::python {

namespace {

using Path = std::filesystem::path;
template <class T>
using Values = py::array_t<T, py::array::c_style | py::array::forcecast>;

py::array_t<double> camera_array(std::span<const output::Camera> cameras) {
  std::vector<double> out;
  for (const output::Camera& camera : cameras) {
    for (const Vec3& v : {camera.position, camera.target, camera.up}) append(out, v);
    out.push_back(camera.field_of_view);
  }
  return array_of(out, 10);
}

py::tuple read_numbers(const Path& path, bool finite) {
  const output::NumberTable table = without_gil([&] { return output::read_numbers(path, finite); });
  return py::make_tuple(table.columns, array_of(table.values, table.columns.size()));
}

/// Rows of contacts.csv, the names of shapes as their indices.
py::array_t<double> read_contacts(const SceneHandle& of, const Path& path) {
  std::map<std::string, std::size_t, std::less<>> shapes;
  for (const model::Shape& shape : of.scene->model.shapes) shapes.emplace(shape.name, shapes.size());
  constexpr std::size_t kColumns = 14;
  std::vector<double> out;
  const std::vector<std::string> columns =
      output::read_rows(path, [&](std::size_t line, std::span<const std::string_view> fields) {
        if (fields.size() != kColumns)
          throw output::row_error(path, line, fmt::format("{} columns", fields.size()),
                                  "contacts.csv of a run");
        for (std::size_t i = 0; i < kColumns; ++i) {
          if (i == 1 || i == 2) {
            const auto shape = shapes.find(fields[i]);
            if (shape == shapes.end())
              throw output::row_error(path, line, "the name of an unknown shape",
                                      "shapes of the scene beside it");
            out.push_back(static_cast<double>(shape->second));
            continue;
          }
          out.push_back(output::field_number(fields[i], path, line));
          if (!std::isfinite(static_cast<float>(out.back())))
            throw output::row_error(path, line, std::string(fields[i]), "a finite number");
        }
      });
  if (columns.size() != kColumns || output::contact_head() != fmt::format("{}\n", fmt::join(columns, ",")))
    throw input_error(path.string(), "other columns", "contacts.csv of a run");
  return array_of(out, columns.size());
}

py::tuple thinned(const Values<double>& times, const Values<float>& values,
                  const std::vector<double>& tolerances, std::size_t most) {
  const output::Thinned out =
      output::thinned({times.data(), static_cast<std::size_t>(times.size())},
                      {values.data(), static_cast<std::size_t>(values.size())}, tolerances, most);
  return py::make_tuple(out.rows, out.factor);
}

/// Columns of the tables that a run of the scene writes, by file.
py::dict table_columns(const SceneHandle& of) {
  const auto after_time = [](std::vector<std::string> columns) {
    columns.insert(columns.begin(), "time");
    return columns;
  };
  using py::arg;
  return py::dict(arg("trajectory") = output::trajectory_columns(of.scene->model),
                  arg("control") = after_time(simulation::control_columns(*of.scene)),
                  arg("muscles") = after_time(simulation::muscle_columns(*of.scene)),
                  arg("monitor") = std::string("time[s]") + simulation::kMonitorColumns);
}

/// Moments of a run. @param poses of all bodies but the world, x y z w x y z. @param contacts rows of
/// read_contacts(). @param first of each moment's contacts, and the end; empty: none
std::vector<simulation::PictureState> moments_of(const model::Model& model, const Values<double>& poses,
                                                 const Values<double>& contacts,
                                                 const std::vector<std::size_t>& first) {
  std::vector<simulation::PictureState> out(static_cast<std::size_t>(poses.shape(0)),
                                            {model::initial_state(model), {}});
  const double* x = poses.data();
  for (std::size_t i = 0; i < out.size(); ++i) {
    for (std::size_t b = 1; b < out[i].state.bodies.size(); ++b, x += 7) {
      out[i].state.bodies[b].p = {x[0], x[1], x[2]};
      out[i].state.bodies[b].q = {x[3], x[4], x[5], x[6]};
    }
    for (std::size_t row = first.empty() ? 0 : first[i]; !first.empty() && row < first[i + 1]; ++row) {
      const double* c = contacts.data(static_cast<long>(row), 0);
      const Vec3 normal(c[6], c[7], c[8]);
      out[i].contacts.push_back({static_cast<int>(c[1]), static_cast<int>(c[2]), Vec3(c[3], c[4], c[5]),
                                 normal, c[9], c[10] * normal + Vec3(c[11], c[12], c[13])});
    }
  }
  return out;
}

/// Height of the ground or floor, and the camera that shows all moments.
py::tuple stage(const SceneHandle& of, const Values<double>& poses) {
  const scene::Scene& scene = *of.scene;
  const simulation::Stage out =
      simulation::stage_of({scene.model, scene.spec.pictures}, moments_of(scene.model, poses, {}, {}));
  return py::make_tuple(out.ground, camera_array(std::span(&out.camera, 1)));
}

py::array_t<double> cameras(const SceneHandle& of, const Values<double>& poses,
                            const Values<double>& contacts, const std::vector<std::size_t>& first,
                            std::size_t smooth) {
  const scene::Scene& scene = *of.scene;
  return camera_array(simulation::cameras({scene.model, scene.spec.pictures},
                                          moments_of(scene.model, poses, contacts, first), smooth));
}

/// Points of the core and normals in turn, and triangles.
py::tuple mesh_tuple(const output::Mesh& mesh) {
  std::vector<double> out;
  for (const output::Vertex& vertex : mesh.vertices)
    for (const auto& v : {vertex.core, vertex.normal}) append(out, v.cast<double>());
  return py::make_tuple(array_of(out, 6), mesh.indices);
}

/// What pictures show of the model at the start. Shapes and arrows are in the frames of their bodies.
py::dict drawn(const SceneHandle& of) {
  const scene::Scene& scene = *of.scene;
  const model::Model& model = scene.model;
  const model::State start = model::initial_state(model);
  const output::DrawList list = output::draw_list(model, start, {true});
  const auto frame = [&](int body) { return start.bodies[as_index(body)].pose().inverse(); };
  const auto array = [](const auto& of_pose) {
    std::vector<double> out;
    append(out, of_pose);
    return out;
  };
  const auto colour = [](const output::Colour& c) { return std::array{c.r, c.g, c.b}; };
  py::list shapes, reaches, arrows, phases;
  for (const output::DrawShape& draw : list.shapes) {
    if (!draw.mark) reaches.append(py::make_tuple(draw.shape, draw.solid.reach()));
    const output::Solid solid = output::bevelled(draw.solid);
    const char* core = solid.core == output::Core::hull       ? "hull"
                       : solid.core == output::Core::cylinder ? "cylinder"
                                                              : "box";
    const Pose place = frame(model.shapes[as_index(draw.shape)].body) * draw.solid.pose;
    shapes.append(py::make_tuple(draw.shape, core, array(solid.half), solid.round, array(place),
                                 colour(draw.colour), draw.mark));
  }
  // Each arrow moves with the body in which its axis is fixed and whose place it has.
  auto arrow = list.arrows.begin();
  for (const model::Joint& joint : model.joints)
    for (std::size_t axis = 0; axis < joint.axes.size(); ++axis, ++arrow) {
      const bool before_another = !joint.slides(axis) && axis + 1 < joint.axes.size();
      const int body = before_another ? joint.parent : joint.child;
      arrows.append(py::make_tuple(
          joint.name + "." + joint.axes[axis].name, body, array(Vec3(frame(body) * arrow->from)),
          array(Vec3(frame(body) * arrow->to)), arrow->radius, colour(arrow->colour)));
    }
  const auto add_phases = [&](const auto& plans) {
    for (const auto& plan : plans)
      for (const scene::TaskPhase& phase : plan.phases)
        phases.append(py::make_tuple(phase.name, phase.start, phase.end));
  };
  add_phases(scene.plans.grasps);
  add_phases(scene.plans.climbs);
  constexpr const char* kLooks[] = {"skin", "shapes", "both"};
  constexpr int kSides = 24;
  using py::arg;
  return py::dict(
      arg("shapes") = shapes, arg("reaches") = reaches, arg("arrows") = arrows, arg("phases") = phases,
      arg("look") = kLooks[static_cast<std::size_t>(scene.spec.pictures.hands)],
      arg("finger_colours") = scene.spec.pictures.finger_colours, arg("size") = scene.spec.pictures.size,
      arg("ground") = scene.spec.ground.has_value(),
      arg("capsule") = mesh_tuple(output::capsule_mesh(kSides)), arg("box") = mesh_tuple(output::box_mesh()),
      arg("cylinder") = mesh_tuple(output::cylinder_mesh(kSides)));
}

/// `handsim run` of a scene whose folder is removed afterwards. @param page writes the page of the folder
int run_for_page(const Path& scene, const std::vector<std::string>& overrides, const Path& folder,
                 const app::WritePage& page) {
  app::RunArguments run;
  run.scene = scene;
  run.overrides = overrides;
  run.out = folder;
  run.report = run.passing = true;
  run.page = page;
  return without_gil([&] { return app::finish_output(app::run_scene_command(run)); });
}

}  // namespace

void bind_page(py::module_& module) {
  module.attr("has_reports") = output::has_three();
  module.def("require_three", &output::require_three);
  module.def("page", [](bool of_run, const std::string& title, const std::string& json) {
    return output::report_page(of_run ? output::PageKind::run : output::PageKind::study, title, json);
  });
  module.def("study_page", &study::study_page);
  module.def("read_file", [](const Path& path, const std::string& need, std::size_t most) {
    return py::bytes(read_input_file(path, need, most));
  });
  module.def("read_numbers", &read_numbers);
  module.def("read_contacts", &read_contacts);
  module.def("thinned", &thinned);
  module.def("table_columns", &table_columns);
  module.def("stage", &stage);
  module.def("cameras", &cameras);
  module.def("drawn", &drawn);
  module.def("run_for_page", &run_for_page);
}

}  // namespace handsim::python
