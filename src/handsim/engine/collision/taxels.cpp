#include "handsim/engine/collision/taxels.h"

#include <algorithm>
#include <cmath>

namespace handsim::engine {

namespace {

/// Points that lie within this share of the disc's square radius of a line do not fix a centre of pressure.
constexpr double kFlat = 1e-3;

std::size_t steps(double length, double spacing) {
  return std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(length / spacing)));
}

}  // namespace

Taxels::Taxels(const model::Model& model, double spacing) : model_(model), rules_(model) {
  for (const model::HandIndex& hand : model.hands)
    for (const model::Fingertip& tip : hand.fingertips)
      for (std::size_t i = 0; i < model.shapes.size(); ++i)
        if (model.shapes[i].body == tip.body && model.shapes[i].kind == model::ShapeKind::capsule)
          add_pad(hand, tip, static_cast<int>(i), spacing);
}

/// Rows along the capsule, and around its free end, each over the palmar half turn.
void Taxels::add_pad(const model::HandIndex& hand, const model::Fingertip& tip, int shape, double spacing) {
  const model::Shape& capsule = model_.shapes[as_index(shape)];
  Pad pad{tip.name, tip.body, shape, points_.size(), 0};
  const auto of_body = [&](int body) { return model_.bodies[as_index(body)].zero_pose; };
  // Palmar, with the joints at zero: against the hand's z.
  const Vec3 dorsal = (of_body(hand.palm) * hand.wrist_frame).q * Vec3::UnitZ();
  const Quat to_shape = (of_body(tip.body) * capsule.pose).q.conjugate();
  const Vec3 towards_tip = capsule.pose.inverse() * tip.point;
  const double end = towards_tip.z() < 0 ? -1 : 1, R = capsule.radius;
  Vec3 palmar = -(to_shape * dorsal);
  palmar.z() = 0;
  palmar.normalize();
  const Vec3 across = palmar.cross(Vec3::UnitZ());
  const auto add_row = [&](double z, double radius, double width) {
    const std::size_t count = steps(M_PI * radius, spacing);
    for (std::size_t k = 0; k < count; ++k) {
      const double angle = M_PI * ((static_cast<double>(k) + 0.5) / static_cast<double>(count) - 0.5);
      const Vec3 point = radius * (std::cos(angle) * palmar + std::sin(angle) * across) + Vec3(0, 0, end * z);
      points_.push_back(capsule.pose * point);
      areas_.push_back(width * M_PI * radius / static_cast<double>(count));
    }
  };
  const std::size_t along = steps(capsule.length, spacing), rings = steps(0.5 * M_PI * R, spacing);
  for (std::size_t i = 0; i < along; ++i)
    add_row(capsule.length * ((static_cast<double>(i) + 0.5) / static_cast<double>(along) - 0.5), R,
            capsule.length / static_cast<double>(along));
  for (std::size_t i = 0; i < rings; ++i) {
    const double angle = 0.5 * M_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(rings);
    add_row(0.5 * capsule.length + R * std::sin(angle), R * std::cos(angle),
            0.5 * M_PI * R / static_cast<double>(rings));
  }
  pad.count = points_.size() - pad.first;
  pads_.push_back(std::move(pad));
}

std::vector<double> Taxels::read(std::span<const Contact> contacts, const model::State& state) const {
  std::vector<double> forces(points_.size());
  for (const Contact& contact : contacts)
    for (const Pad& pad : pads_)
      if (contact.shape_a == pad.shape || contact.shape_b == pad.shape) spread(pad, contact, state, forces);
  return forces;
}

void Taxels::spread(const Pad& pad, const Contact& contact, const model::State& state,
                    std::span<double> forces) const {
  const double force = contact.normal_force();
  if (!(force > 0)) return;
  const model::Material surface =
      rules_.between(model_.shapes[as_index(contact.shape_a)], model_.shapes[as_index(contact.shape_b)]);
  const double radius = model_.shapes[as_index(pad.shape)].radius;
  const double flat2 =
      2 * (surface.compliance && surface.compliance->radius > 0 ? surface.compliance->radius : radius) *
      std::max(contact.depth, 0.0);
  const Pose to_body = state.bodies[as_index(pad.body)].pose().inverse();
  const Vec3 place = to_body * contact.position, normal = to_body.q * contact.normal;
  const Vec3 e = normal.unitOrthogonal(), f = normal.cross(e);
  // Which way out of the pad the contact's normal points.
  const double out = contact.shape_a == pad.shape ? -1 : 1;
  struct Share {
    std::size_t taxel = 0;
    double weight = 0, x = 0, y = 0;
  };
  std::vector<Share> shares;
  double sum = 0, x = 0, y = 0, nearest = HUGE_VAL;
  std::size_t closest = pad.first;
  for (std::size_t i = pad.first; i < pad.first + pad.count; ++i) {
    const Vec3 away = points_[i] - place;
    const double u = e.dot(away), v = f.dot(away), r2 = u * u + v * v;
    if (const double distance = away.squaredNorm(); distance < nearest) {
      nearest = distance;
      closest = i;
    }
    // Not the far side of the pad.
    if (r2 >= flat2 || out * normal.dot(away) < -radius) continue;
    const double weight = 1 - r2 / flat2;
    shares.push_back({i, weight, u, v});
    sum += weight;
    x += weight * u;
    y += weight * v;
  }
  // Weights tilt by (1 + a u + b v) so that their centre is the contact's place.
  double xx = 0, xy = 0, yy = 0;
  for (const Share& each : shares) {
    xx += each.weight * each.x * each.x;
    xy += each.weight * each.x * each.y;
    yy += each.weight * each.y * each.y;
  }
  const double determinant = xx * yy - xy * xy;
  if (shares.size() < 3 || !(determinant > kFlat * kFlat * sum * sum * flat2 * flat2)) {
    forces[closest] += force;
    return;
  }
  const double a = (xy * y - yy * x) / determinant, b = (xy * x - xx * y) / determinant;
  const auto tilt = [&](const Share& each) { return 1 + a * each.x + b * each.y; };
  // At the edge of the pad the disc has no such weights that push: the paraboloid stays as it is.
  const bool pushes = std::ranges::all_of(shares, [&](const Share& each) { return tilt(each) >= 0; });
  double tilted = 0;
  for (Share& each : shares) tilted += each.weight *= pushes ? tilt(each) : 1;
  for (const Share& each : shares) forces[each.taxel] += force * each.weight / tilted;
}

}  // namespace handsim::engine
