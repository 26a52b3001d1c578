// Studies of grasps and climbs, for python/handsim/_grasps.py.
#include "handsim/output/output_folder.h"
#include "handsim/python/bindings.h"
#include "handsim/python/frame.h"
#include "handsim/python/signals.h"
#include "handsim/study/grasp/grasp_study.h"

namespace handsim::python {

namespace {

using Paths = std::vector<std::filesystem::path>;

/// Scenes, sides, persons, overrides and the folder: what is meant.
using GraspsAsked =
    std::tuple<Paths, std::vector<std::string>, Paths, std::vector<std::string>, std::filesystem::path>;

study::GraspStudy study_of(const GraspsAsked& asked) {
  study::GraspStudy out;
  std::tie(out.scenes, out.sides, out.persons, out.overrides, out.out) = asked;
  return out;
}

/// @param more each grasp again: friction_search, margin, confirm. @param video of each run
/// @param egl draws by EGL, else by OSMesa; None: the default. @param apart draws in child processes
/// @return rows_text(), and the study's folder, which nothing else writes to until it goes
py::tuple grasps(const GraspsAsked& asked, std::optional<double> friction, const std::array<bool, 3>& more,
                 bool pictures, const std::optional<VideoChoice>& video, std::optional<bool> egl, bool apart,
                 const py::object& progress) {
  study::GraspStudy study = study_of(asked);
  study.friction = friction;
  study.friction_search = more[0], study.margin = more[1], study.confirm = more[2];
  study.pictures = pictures;
  if (video) study.video = video_of(*video);
  if (egl) study.gl = *egl ? output::Gl::egl : output::Gl::osmesa;
  study.draw_apart = apart;
  study::GraspTables tables = run_study(progress, [&](StudyHooks& hooks) {
    study.progress = hooks.told;
    return study::run_grasps(study);
  });
  return py::make_tuple(study::rows_text(tables), std::move(tables.folder));
}

/// Studies of uncertain hands as name, side, file, overrides and folder; grasps that their hands refuse.
py::tuple uncertain_grasps(const GraspsAsked& asked) {
  std::vector<study::RefusedGrasp> refused;
  const auto found = without_gil([&] { return study::uncertain_grasps(study_of(asked), refused); });
  py::list drawn, not_for;
  for (const study::UncertainGrasp& each : found)
    drawn.append(py::make_tuple(each.name, each.side, each.file, each.overrides, each.out));
  for (const study::RefusedGrasp& each : refused)
    not_for.append(py::make_tuple(each.scene, each.side, each.why));
  return py::make_tuple(drawn, not_for);
}

}  // namespace

void bind_grasps(py::module_& module) {
  module.def("grasps", &grasps);
  module.def("uncertain_grasps", &uncertain_grasps);
}

}  // namespace handsim::python
