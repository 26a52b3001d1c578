#include "handsim/simulation/run/pictures.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "handsim/output/render/draw_list.h"
#include "handsim/output/render/renderer.h"

namespace handsim::simulation {

namespace {

/// Gap between the lowest point of all snapshots and the floor below it [m].
constexpr double kFloorClearance = 0.01;
constexpr double kContactPointRadius = 0.0025;
constexpr double kForceRadius = 0.0012;
constexpr double kLongestForce = 0.1;

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

/// On the one of the two that is free, or on the object that a hand touches.
Vec3 shown_force(const model::Model& model, const engine::Contact& contact) {
  const model::Shape& a = model.shapes[static_cast<std::size_t>(contact.shape_a)];
  const model::Shape& b = model.shapes[static_cast<std::size_t>(contact.shape_b)];
  const bool on_b = b.body != model::kWorld && b.tint == model::Tint::object && a.tint != model::Tint::object;
  return on_b || a.body == model::kWorld ? Vec3(-contact.force) : contact.force;
}

output::DrawList list_of(const scene::Scene& scene, const Snapshot& moment, std::optional<double> scale) {
  const scene::PictureSpec& pictures = scene.spec.pictures;
  output::DrawList list = output::draw_list(scene.model, moment.state, {pictures.joint_axes});
  if (scale)
    for (const engine::Contact& contact : moment.contacts)
      list.arrows.push_back({contact.position,
                             contact.position + *scale * shown_force(scene.model, contact),
                             kForceRadius,
                             {0.75F, 0.0F, 0.35F},
                             true});
  if (!pictures.contact_points) return list;
  for (const engine::Contact& contact : moment.contacts)
    list.points.push_back({contact.position, kContactPointRadius, {0.9F, 0.05F, 0.05F}});
  return list;
}

output::Camera fixed_camera(const scene::CameraSpec& spec) {
  output::Camera camera;
  camera.position = spec.position;
  camera.target = spec.target;
  camera.field_of_view = spec.field_of_view;
  // Looking straight up or down leaves z no use as the picture's up.
  const Vec3 line = (camera.target - camera.position).normalized();
  if (std::abs(line.z()) > 0.999) camera.up = Vec3::UnitY();
  return camera;
}

output::Framing framing(const scene::Scene& scene) {
  const auto& hands = scene.plans.hands;
  const scene::PictureSpec& pictures = scene.spec.pictures;
  return {view_of(pictures.view), hands.empty() ? Pose{} : hands.front().pose,
          hands.empty() ? model::Side::right : hands.front().side,
          static_cast<double>(pictures.size[0]) / pictures.size[1]};
}

}  // namespace

Snapshot snapshot(const engine::Engine& engine) {
  return {engine.state(), {engine.contacts().begin(), engine.contacts().end()}};
}

std::optional<double> force_scale(const scene::Scene& scene, std::span<const Snapshot> snapshots) {
  if (!scene.spec.pictures.contact_forces) return std::nullopt;
  double largest = 0;
  for (const Snapshot& moment : snapshots)
    for (const engine::Contact& contact : moment.contacts) largest = std::max(largest, contact.force.norm());
  if (!(largest > 0)) return std::nullopt;
  // 1, 2 or 5 times a power of ten.
  const double most = kLongestForce / largest;
  const double decade = std::pow(10, std::floor(std::log10(most)));
  const double share = most / decade;
  return decade * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
}

void draw(const scene::Scene& scene, std::span<const Snapshot> snapshots,
          const std::function<void(std::size_t, const output::Image&)>& take) {
  if (snapshots.empty()) return;
  const scene::PictureSpec& pictures = scene.spec.pictures;
  output::Framing framed = framing(scene);
  const std::optional<double> scale = force_scale(scene, snapshots);
  double lowest = std::numeric_limits<double>::infinity();
  for (const Snapshot& moment : snapshots) {
    const output::DrawList list = list_of(scene, moment, scale);
    framed.see(list);
    lowest = std::min(lowest, output::bounds(list).low.z());
  }
  const output::Camera camera = pictures.camera ? fixed_camera(*pictures.camera) : framed.camera();
  output::Renderer renderer(pictures.size[0], pictures.size[1]);
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    output::DrawList list = list_of(scene, snapshots[i], scale);
    if (!scene.spec.ground && pictures.floor) list.ground_height = lowest - kFloorClearance;
    take(i, renderer.draw(list, camera));
  }
}

output::Image draw(const scene::Scene& scene, const Snapshot& moment) {
  output::Image out;
  draw(scene, std::span(&moment, 1), [&](std::size_t, const output::Image& image) { out = image; });
  return out;
}

}  // namespace handsim::simulation
