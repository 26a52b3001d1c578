#include "handsim/engine/collision/overlap.h"

#include <algorithm>
#include <array>

#include "handsim/engine/checks.h"
#include "handsim/engine/collision/narrow_phase.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/engine/collision/pair_table.h"

namespace handsim::engine {

namespace {

constexpr double kTouch = 1e-9;
constexpr int kMaxPoints = 16;

double penetration(const Manifold& found) {
  double depth = 0;
  for (int i = 0; i < found.count; ++i)
    depth = std::max(depth, found.points[static_cast<std::size_t>(i)].depth);
  return depth;
}

double penetration(dGeomID a, dGeomID b) {
  std::array<dContactGeom, kMaxPoints> points;
  const int count = dCollide(a, b, kMaxPoints, points.data(), sizeof(dContactGeom));
  double depth = 0;
  for (int i = 0; i < count; ++i) depth = std::max(depth, points[static_cast<std::size_t>(i)].depth);
  return depth;
}

std::vector<Overlap> overlaps(const model::Model& model, const model::State& state) {
  const std::unique_ptr<dxSpace, Destroyer<dSpaceDestroy>> space(dSimpleSpaceCreate(nullptr));
  std::vector<dGeomID> geoms;
  for (std::size_t i = 0; i < model.shapes.size(); ++i) {
    geoms.push_back(make_geom(space.get(), model.shapes[i], i));
    place_geom(geoms[i], model.shapes[i], state.bodies[as_index(model.shapes[i].body)].pose());
  }
  const NarrowPhase narrow(model);
  const UntestedPairs untested(model, immovable_bodies(model, {}));
  const auto pose_of = [&](std::size_t shape) {
    const model::Shape& of = model.shapes[shape];
    return state.bodies[as_index(of.body)].pose() * of.pose;
  };
  std::vector<Overlap> found;
  for (std::size_t a = 0; a < geoms.size(); ++a)
    for (std::size_t b = a + 1; b < geoms.size(); ++b) {
      if (untested(model.shapes[a].body, model.shapes[b].body)) continue;
      // Only meshes: a deep capsule's own manifold knows one way out of several, ODE's the nearest.
      const bool mesh = model.shapes[a].kind == model::ShapeKind::convex_mesh ||
                        model.shapes[b].kind == model::ShapeKind::convex_mesh;
      const auto own = mesh ? narrow.manifold(a, pose_of(a), b, pose_of(b)) : std::nullopt;
      const double depth = own ? penetration(*own) : penetration(geoms[a], geoms[b]);
      if (depth > kTouch) found.push_back({static_cast<int>(a), static_cast<int>(b), depth});
    }
  return found;
}

}  // namespace

std::vector<Overlap> initial_overlaps(const model::Model& model, const model::State& state) {
  enter_ode();
  try {
    return overlaps(model, state);
  } catch (const OdeFault& fault) {
    throw input_error("shapes", fault.message, "shapes that ODE can test against each other");
  }
}

}  // namespace handsim::engine
