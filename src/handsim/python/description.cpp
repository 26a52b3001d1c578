// What a scene's model is made of, as JSON, and the skins of its hands, as tuples and arrays: _model.py names
// their fields.
#include "handsim/output/description/description.h"
#include "handsim/output/render/skin.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"

namespace handsim::python {

namespace {

/// Numbers by row.
template <class Rows>
py::array_t<double> rows_of(const Rows& rows, std::size_t columns = 0) {
  std::vector<double> out;
  for (const auto& row : rows)
    for (const auto x : row) out.push_back(static_cast<double>(x));
  return array_of(out, columns);
}

std::array<double, 7> numbers(const Pose& x) {
  return {x.p.x(), x.p.y(), x.p.z(), x.q.w(), x.q.x(), x.q.y(), x.q.z()};
}

py::array_t<double> array(const Eigen::MatrixXd& m) { return rows_of(m.rowwise(), as_index(m.cols())); }

std::string description(const SceneHandle& of) {
  const scene::Scene& scene = *of.scene;
  return output::description(scene.model, scene.spec.solver, scene.control ? &*scene.control : nullptr);
}

/// The skin of each hand: bodies, their rest poses, points, faces, shares of the bodies, colour.
py::list skins(const SceneHandle& of) {
  py::list out;
  const output::Colour tone = output::from_srgb(of.scene->spec.pictures.skin_colour);
  for (const auto& skin : output::skins_of(of.scene->model)) {
    std::vector<std::array<double, 7>> rest;
    for (const Pose& x : skin->rest) rest.push_back(numbers(x));
    out.append(py::make_tuple(skin->bodies, rows_of(rest, 7), rows_of(skin->points, 3),
                              rows_of(skin->faces, 3), array(skin->weights.cast<double>()),
                              std::array{tone.r, tone.g, tone.b}));
  }
  return out;
}

}  // namespace

void bind_description(py::module_& module) {
  module.def("description", &description);
  module.def("skins", &skins);
}

}  // namespace handsim::python
