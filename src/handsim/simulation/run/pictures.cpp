#include "handsim/simulation/run/pictures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "handsim/output/render/renderer.h"
#include "handsim/output/render/skin.h"
#include "handsim/output/video/video.h"

namespace handsim::simulation {

namespace {

/// Gap between the lowest point of all moments and the floor below it [m].
constexpr double kFloorClearance = 0.01;
constexpr double kContactPointRadius = 0.0025;
constexpr double kForceRadius = 0.0012;
constexpr double kLongestForce = 0.1;
constexpr double kShakeRadius = 0.002;
/// Share of skin in a picture that shows what is under it.
constexpr double kGlass = 0.5;
/// A body further than this from every hand is lost [m].
constexpr double kLost = 1;

bool is_hand(model::Part part) { return part <= model::Part::little; }

/// Bodies that move and are far from every hand, by their index.
std::vector<bool> lost_bodies(const model::Model& model, const model::State& state) {
  std::vector<bool> out(model.bodies.size(), false);
  if (model.hands.empty()) return out;
  for (std::size_t i = 1; i < out.size(); ++i)
    out[i] = std::ranges::none_of(model.hands, [&](const model::HandIndex& hand) {
      return (state.bodies[i].p - state.bodies[as_index(hand.palm)].p).norm() < kLost;
    });
  return out;
}

void add_shake(const model::Model& model, const PictureState& moment, output::DrawList& list) {
  if (moment.shaken.isZero() || model.hands.empty()) return;
  const model::HandIndex& hand = model.hands.front();
  const Vec3 wrist = moment.state.bodies[as_index(hand.palm)].pose() * hand.wrist_frame.p;
  list.arrows.push_back({wrist - moment.shaken, wrist, kShakeRadius, {0.05F, 0.06F, 0.08F}, true});
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

/// The side of the first hand from which the pictures show it.
output::Framing framing(const Pictured& of) {
  const model::Model& model = of.model;
  Pose hand;
  model::Side side = model::Side::right;
  if (!model.hands.empty()) {
    const model::HandIndex& first = model.hands.front();
    hand = model.bodies[as_index(first.palm)].zero_pose * first.wrist_frame;
    side = first.side;
  }
  return {of.pictures.view, hand, side, static_cast<double>(of.pictures.size[0]) / of.pictures.size[1]};
}

using Extents = output::Framing::Extents;

/// The mean over neighbours, up to `reach` away, of the largest values about each: no smaller than its own.
void smooth_out(std::vector<Extents>& values, std::size_t reach) {
  const auto windowed = [&](const auto& from, auto start, auto add, auto end) {
    std::vector<Extents> out(from.size());
    for (std::size_t i = 0; i < from.size(); ++i) {
      const std::size_t first = i > reach ? i - reach : 0, last = std::min(from.size() - 1, i + reach);
      for (std::size_t k = 0; k < out[i].size(); ++k) {
        double sum = start;
        for (std::size_t j = first; j <= last; ++j) sum = add(sum, from[j][k]);
        out[i][k] = end(sum, last - first + 1);
      }
    }
    return out;
  };
  if (reach == 0) return;
  const auto largest = windowed(
      values, -std::numeric_limits<double>::infinity(), [](double a, double b) { return std::max(a, b); },
      [](double sum, std::size_t) { return sum; });
  values = windowed(
      largest, 0.0, [](double a, double b) { return a + b; },
      [](double sum, std::size_t count) { return sum / static_cast<double>(count); });
}

bool follows(const Pictured& of) { return of.pictures.follow && !of.model.hands.empty(); }

/// The list with hands as the scene wants them. Skin over shapes is a picture over a picture.
output::Image drawn(output::Renderer& renderer, const Pictured& of, const model::State& state,
                    output::DrawList list, const output::Camera& camera) {
  output::Image shapes;
  const bool glass = of.pictures.hands == scene::HandLook::both || of.pictures.muscles;
  if (of.pictures.hands == scene::HandLook::shapes || glass) shapes = renderer.draw(list, camera);
  if (of.pictures.hands == scene::HandLook::shapes) return shapes;
  for (const auto& skin : output::skins_of(of.model))
    output::put_on(*skin, of.model, state, output::from_srgb(of.pictures.skin_colour),
                   of.pictures.finger_colours, list);
  output::Image out = renderer.draw(list, camera);
  for (std::size_t i = 0; i < shapes.rgb.size(); ++i)
    out.rgb[i] = static_cast<std::uint8_t>(kGlass * out.rgb[i] + (1 - kGlass) * shapes.rgb[i]);
  return out;
}

/// Cameras of the moments, one each, and the height of the lowest point of all [m].
std::pair<std::vector<output::Camera>, double> views(const Pictured& of,
                                                     std::span<const PictureState> moments,
                                                     std::optional<double> scale, std::size_t smooth) {
  double lowest = std::numeric_limits<double>::infinity();
  output::Framing all = framing(of);
  std::vector<Extents> each;
  for (const PictureState& moment : moments) {
    const output::DrawList list = shown(of, moment, scale);
    lowest = std::min(lowest, output::bounds(list).low.z());
    all.add(list);
    output::Framing one = framing(of);
    one.add(followed(of, moment, list));
    each.push_back(one.extents());
  }
  const auto& fixed = of.pictures.camera;
  if (fixed || !follows(of))
    return {std::vector(moments.size(), fixed ? fixed_camera(*fixed) : all.camera()), lowest};
  smooth_out(each, smooth);
  std::vector<output::Camera> out;
  for (const Extents& extents : each) out.push_back(all.camera(extents));
  return {std::move(out), lowest};
}

}  // namespace

PictureState picture_state(const engine::Engine& engine) {
  return {engine.state(), {engine.contacts().begin(), engine.contacts().end()}};
}

Vec3 shown_force(const model::Model& model, const engine::Contact& contact) {
  const model::Shape& a = model.shapes[as_index(contact.shape_a)];
  const model::Shape& b = model.shapes[as_index(contact.shape_b)];
  const bool on_b = b.body != model::kWorld && b.part == model::Part::object && a.part != model::Part::object;
  return on_b || a.body == model::kWorld ? Vec3(-contact.force) : contact.force;
}

std::optional<double> force_scale(const scene::PictureSpec& pictures, std::span<const PictureState> moments) {
  if (!pictures.contact_forces) return std::nullopt;
  double largest = 0;
  for (const PictureState& moment : moments)
    for (const engine::Contact& contact : moment.contacts) largest = std::max(largest, contact.force.norm());
  if (!(largest > 0)) return std::nullopt;
  // 1, 2 or 5 times a power of ten.
  const double most = kLongestForce / largest;
  const double decade = std::pow(10, std::floor(std::log10(most)));
  const double share = most / decade;
  return decade * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
}

output::DrawList shown(const Pictured& of, const PictureState& moment, std::optional<double> force_scale) {
  const model::Model& model = of.model;
  output::DrawList list = output::draw_list(model, moment.state, {of.pictures.joint_axes});
  const std::vector<bool> lost = lost_bodies(model, moment.state);
  std::erase_if(list.shapes, [&](const output::DrawShape& drawn) {
    return lost[as_index(model.shapes[as_index(drawn.shape)].body)];
  });
  if (of.pictures.muscles) output::add_tendons(model, moment.state, list);
  if (force_scale)
    for (const engine::Contact& contact : moment.contacts)
      list.arrows.push_back({contact.position,
                             contact.position + *force_scale * shown_force(model, contact),
                             kForceRadius,
                             {0.75F, 0.0F, 0.35F},
                             true});
  add_shake(model, moment, list);
  if (!of.pictures.contact_points) return list;
  for (const engine::Contact& contact : moment.contacts)
    list.points.push_back({contact.position, kContactPointRadius, {0.9F, 0.05F, 0.05F}});
  return list;
}

output::DrawList followed(const Pictured& of, const PictureState& moment, const output::DrawList& shown) {
  const std::vector<model::Shape>& shapes = of.model.shapes;
  std::vector<bool> in(shapes.size(), false);
  for (std::size_t i = 0; i < shapes.size(); ++i) in[i] = is_hand(shapes[i].part);
  for (const engine::Contact& contact : moment.contacts) {
    const auto a = as_index(contact.shape_a), b = as_index(contact.shape_b);
    if (is_hand(shapes[a].part) == is_hand(shapes[b].part)) continue;
    const std::size_t other = is_hand(shapes[a].part) ? b : a;
    in[other] = true;
    // All shapes of the touched body; of the world, such as a wall, only the touched one.
    for (std::size_t i = 0; i < shapes.size() && shapes[other].body != model::kWorld; ++i)
      if (shapes[i].body == shapes[other].body) in[i] = true;
  }
  output::DrawList out;
  for (const output::DrawShape& drawn : shown.shapes)
    if (in[as_index(drawn.shape)]) out.shapes.push_back(drawn);
  return out;
}

std::vector<output::Camera> cameras(const Pictured& of, std::span<const PictureState> moments,
                                    std::size_t smooth) {
  return views(of, moments, force_scale(of.pictures, moments), smooth).first;
}

Stage stage_of(const Pictured& of, std::span<const PictureState> moments) {
  Stage stage;
  output::Framing all = framing(of);
  double lowest = std::numeric_limits<double>::infinity();
  for (const PictureState& moment : moments) {
    const output::DrawList list = shown(of, moment, {});
    lowest = std::min(lowest, output::bounds(list).low.z());
    stage.ground = list.ground_height;
    all.add(follows(of) ? followed(of, moment, list) : list);
  }
  if (of.pictures.floor && !stage.ground && std::isfinite(lowest)) stage.ground = lowest - kFloorClearance;
  stage.camera = of.pictures.camera ? fixed_camera(*of.pictures.camera) : all.camera();
  return stage;
}

void draw(const Pictured& of, std::span<const PictureState> moments, const Drawing& drawing,
          const std::function<void(std::size_t, const output::Image&)>& store,
          const std::function<void(std::size_t, const Picture&)>& take) {
  const std::optional<double> scale = force_scale(of.pictures, moments);
  const auto found = views(of, moments, scale, drawing.smooth);
  const std::vector<output::Camera>& from = found.first;
  const double floor = found.second - kFloorClearance;
  // Before threads begin: they share the skins.
  if (of.pictures.hands != scene::HandLook::shapes) output::skins_of(of.model);
  const auto maker = [&] {
    const auto renderer =
        std::make_shared<output::Renderer>(of.pictures.size[0], of.pictures.size[1], drawing.gl);
    return [&, renderer](std::size_t i) {
      output::DrawList list = shown(of, moments[i], scale);
      if (of.pictures.floor && !list.ground_height) list.ground_height = floor;
      output::Image image = drawn(*renderer, of, moments[i].state, std::move(list), from[i]);
      if (store) store(i, image);
      return image;
    };
  };
  output::make_in_order(moments.size(), drawing.threads, maker, [&](std::size_t i, output::Image&& image) {
    const output::Camera& camera = from[i];
    const double distance = (camera.position - camera.target).norm();
    take(i, {std::move(image), of.pictures.size[1] / (2 * std::tan(camera.field_of_view / 2) * distance)});
  });
}

output::Image draw(const Pictured& of, const PictureState& moment, std::optional<output::Gl> gl) {
  output::Image out;
  draw(of, std::span(&moment, 1), {gl, 1, 0}, {},
       [&](std::size_t, const Picture& picture) { out = picture.image; });
  return out;
}

}  // namespace handsim::simulation
