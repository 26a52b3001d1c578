#include "handsim/simulation/run/pictures.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "handsim/output/render/draw_list.h"
#include "handsim/output/render/renderer.h"

namespace handsim::simulation {

namespace {

/// Gap between the lowest point of all moments and the floor below it [m].
constexpr double kFloorClearance = 0.01;
constexpr double kContactPointRadius = 0.0025;
constexpr double kForceRadius = 0.0012;
constexpr double kLongestForce = 0.1;

output::DrawList list_of(const model::Model& model, const scene::PictureSpec& pictures, const Moment& moment,
                         std::optional<double> scale) {
  output::DrawList list = output::draw_list(model, moment.state, {pictures.joint_axes});
  if (scale)
    for (const engine::Contact& contact : moment.contacts)
      list.arrows.push_back({contact.position,
                             contact.position + *scale * shown_force(model, contact),
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

/// All that the lists show, from the side of the first hand that the pictures are to show.
output::Camera framed_camera(const model::Model& model, const scene::PictureSpec& pictures,
                             const std::vector<output::DrawList>& lists) {
  Pose hand;
  model::Side side = model::Side::right;
  if (!model.hands.empty()) {
    const model::HandIndex& first = model.hands.front();
    hand = model.bodies[static_cast<std::size_t>(first.palm)].zero_pose * first.wrist_frame;
    side = first.side;
  }
  output::Framing framing(pictures.view, hand, side,
                          static_cast<double>(pictures.size[0]) / pictures.size[1]);
  for (const output::DrawList& list : lists) framing.add(list);
  return framing.camera();
}

Stage stage_of_lists(const model::Model& model, const scene::PictureSpec& pictures,
                     const std::vector<output::DrawList>& lists) {
  Stage stage;
  double lowest = std::numeric_limits<double>::infinity();
  for (const output::DrawList& list : lists) {
    lowest = std::min(lowest, output::bounds(list).low.z());
    stage.ground = list.ground_height;
  }
  if (pictures.floor && !stage.ground && std::isfinite(lowest)) stage.ground = lowest - kFloorClearance;
  stage.camera = pictures.camera ? fixed_camera(*pictures.camera) : framed_camera(model, pictures, lists);
  return stage;
}

}  // namespace

Stage stage_of(const model::Model& model, const scene::PictureSpec& pictures,
               std::span<const Moment> moments) {
  std::vector<output::DrawList> lists;
  for (const Moment& moment : moments) lists.push_back(list_of(model, pictures, moment, {}));
  return stage_of_lists(model, pictures, lists);
}

Moment moment_of(const engine::Engine& engine) {
  return {engine.state(), {engine.contacts().begin(), engine.contacts().end()}};
}

Vec3 shown_force(const model::Model& model, const engine::Contact& contact) {
  const model::Shape& a = model.shapes[static_cast<std::size_t>(contact.shape_a)];
  const model::Shape& b = model.shapes[static_cast<std::size_t>(contact.shape_b)];
  const bool on_b = b.body != model::kWorld && b.part == model::Part::object && a.part != model::Part::object;
  return on_b || a.body == model::kWorld ? Vec3(-contact.force) : contact.force;
}

std::optional<double> force_scale(const scene::PictureSpec& pictures, std::span<const Moment> moments) {
  if (!pictures.contact_forces) return std::nullopt;
  double largest = 0;
  for (const Moment& moment : moments)
    for (const engine::Contact& contact : moment.contacts) largest = std::max(largest, contact.force.norm());
  if (!(largest > 0)) return std::nullopt;
  // 1, 2 or 5 times a power of ten.
  const double most = kLongestForce / largest;
  const double decade = std::pow(10, std::floor(std::log10(most)));
  const double share = most / decade;
  return decade * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
}

void draw(const model::Model& model, const scene::PictureSpec& pictures, std::span<const Moment> moments,
          const std::function<void(std::size_t, const output::Image&)>& take) {
  if (moments.empty()) return;
  const std::optional<double> scale = force_scale(pictures, moments);
  std::vector<output::DrawList> lists;
  for (const Moment& moment : moments) lists.push_back(list_of(model, pictures, moment, scale));
  const Stage stage = stage_of_lists(model, pictures, lists);
  output::Renderer renderer(pictures.size[0], pictures.size[1]);
  for (std::size_t i = 0; i < lists.size(); ++i) {
    lists[i].ground_height = stage.ground;
    take(i, renderer.draw(lists[i], stage.camera));
  }
}

output::Image draw(const scene::Scene& scene, const Moment& moment) {
  output::Image out;
  draw(scene.model, scene.spec.pictures, std::span(&moment, 1),
       [&](std::size_t, const output::Image& image) { out = image; });
  return out;
}

}  // namespace handsim::simulation
