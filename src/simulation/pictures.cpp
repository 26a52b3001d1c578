#include "handsim/simulation/pictures.h"

#include <algorithm>

#include "handsim/output/draw_list.h"
#include "handsim/output/renderer.h"

namespace handsim::simulation {

namespace {

/// Gap between the lowest point of all snapshots and the floor below it [m].
constexpr double kFloorClearance = 0.01;
constexpr double kContactPointRadius = 0.0025;

output::View view_of(scene::View view) {
  switch (view) {
    case scene::View::dorsal:
      return output::View::dorsal;
    case scene::View::palmar:
      return output::View::palmar;
    case scene::View::radial:
      return output::View::radial;
    case scene::View::three_quarter:
      return output::View::three_quarter;
  }
  return output::View::three_quarter;
}

std::vector<output::DrawList> draw_lists(const scene::Scene& scene, const std::vector<Snapshot>& snapshots) {
  const scene::PictureSpec& pictures = scene.spec.pictures;
  std::vector<output::DrawList> lists;
  for (const Snapshot& moment : snapshots) {
    lists.push_back(output::draw_list(scene.model, moment.state, {pictures.joint_axes}));
    if (!pictures.contact_points) continue;
    for (const engine::Contact& contact : moment.contacts)
      lists.back().points.push_back({contact.position, kContactPointRadius, {0.9F, 0.05F, 0.05F}});
  }
  if (scene.spec.ground || !pictures.floor || lists.empty()) return lists;
  double floor = output::bounds(lists.front()).low.z();
  for (const output::DrawList& list : lists) floor = std::min(floor, output::bounds(list).low.z());
  for (output::DrawList& list : lists) list.ground_height = floor - kFloorClearance;
  return lists;
}

output::Camera camera_for(const scene::Scene& scene, const std::vector<output::DrawList>& lists,
                          double aspect) {
  const scene::PictureSpec& pictures = scene.spec.pictures;
  if (pictures.camera) {
    output::Camera camera;
    camera.position = pictures.camera->position;
    camera.target = pictures.camera->target;
    camera.field_of_view = pictures.camera->field_of_view;
    // Looking straight up or down leaves z no use as the picture's up.
    const Vec3 line = (camera.target - camera.position).normalized();
    if (std::abs(line.z()) > 0.999) camera.up = Vec3::UnitY();
    return camera;
  }
  const auto& hands = scene.spec.hands;
  const Pose frame = hands.empty() ? Pose{} : hands.front().placement.pose;
  const model::Side side = hands.empty() ? model::Side::right : hands.front().placement.side;
  return output::framed_camera(view_of(pictures.view), frame, side, lists, aspect);
}

}  // namespace

Snapshot snapshot(const engine::Engine& engine) {
  return {engine.state(), {engine.contacts().begin(), engine.contacts().end()}};
}

std::vector<output::Image> draw(const scene::Scene& scene, const std::vector<Snapshot>& snapshots) {
  const auto [width, height] = scene.spec.pictures.size;
  const std::vector<output::DrawList> lists = draw_lists(scene, snapshots);
  const output::Camera camera = camera_for(scene, lists, static_cast<double>(width) / height);
  output::Renderer renderer(width, height);
  std::vector<output::Image> images;
  for (const output::DrawList& list : lists) images.push_back(renderer.draw(list, camera));
  return images;
}

}  // namespace handsim::simulation
