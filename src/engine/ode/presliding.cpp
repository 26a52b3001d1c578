#include "handsim/engine/ode/presliding.h"

#include <algorithm>
#include <utility>

namespace handsim::engine::ode {

namespace {

std::pair<int, int> shapes_of(const Presliding& pair) { return {pair.shape_a, pair.shape_b}; }

Patch patch_of(std::span<const Contact> points, std::size_t first) {
  Patch patch;
  patch.first = first;
  patch.count = points.size();
  for (const Contact& point : points) {
    patch.centre += point.position / static_cast<double>(points.size());
    patch.normal += point.normal;
  }
  const double length = patch.normal.norm();
  // Normals that cancel each other have no common tangent: the pair is left to speed alone.
  patch.normal = length > 0.5 ? Vec3(patch.normal / length) : Vec3(Vec3::Zero());
  for (const Contact& point : points)
    patch.reach = std::max(patch.reach, (point.position - patch.centre).norm());
  return patch;
}

Vec3 tangential(const Vec3& v, const Vec3& normal) { return v - v.dot(normal) * normal; }

template <class Archive, class Pair>
void carry_pair(Archive& archive, Pair& pair) {
  archive(pair.shape_a);
  archive(pair.shape_b);
  archive(pair.shift);
  archive(pair.turn);
}

}  // namespace

void PreslidingMemory::save(ArchiveWriter& out) const {
  out(pairs_.size());
  for (const Presliding& pair : pairs_) carry_pair(out, pair);
}

void PreslidingMemory::restore(ArchiveReader& in) {
  pairs_.resize(in.size());
  const auto shapes = static_cast<int>(model_.shapes.size());
  for (Presliding& pair : pairs_) {
    carry_pair(in, pair);
    if (pair.shape_a >= shapes || pair.shape_b >= shapes)
      in.refuse("a pair of shapes that are not there", "pairs of this scene's shapes");
  }
}

void PreslidingMemory::recall(const Collider& collider, const model::State& state) {
  patches_.clear();
  const std::vector<Contact>& contacts = collider.contacts();
  auto known = pairs_.begin();
  for (const Touch& touch : collider.touches()) {
    const Contact& head = contacts[touch.first];
    const std::pair<int, int> shapes = {head.shape_a, head.shape_b};
    Patch patch = patch_of({&head, static_cast<std::size_t>(touch.count)}, touch.first);
    patch.body_a = model_.shapes[static_cast<std::size_t>(head.shape_a)].body;
    patch.body_b = model_.shapes[static_cast<std::size_t>(head.shape_b)].body;
    patch.reach = std::max(patch.reach, touch.surface.spinning_friction);
    patch.longest = touch.surface.compliance ? kLongestPadShift : kLongestRigidShift;
    while (known != pairs_.end() && shapes_of(*known) < shapes) ++known;
    // Surfaces that do not touch yet have not stuck.
    if (head.depth < 0) patch.normal = Vec3::Zero();
    if (known != pairs_.end() && shapes_of(*known) == shapes && patch.normal != Vec3::Zero()) {
      patch.shift =
          tangential(state.bodies[static_cast<std::size_t>(patch.body_b)].q * known->shift, patch.normal);
      patch.turn = known->turn;
    }
    patches_.push_back(patch);
  }
  pairs_.clear();
  for (const Patch& patch : patches_)
    pairs_.push_back({contacts[patch.first].shape_a, contacts[patch.first].shape_b, Vec3::Zero(), 0});
}

void PreslidingMemory::take_in(const model::State& before, double step) {
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    const Patch& patch = patches_[i];
    if (patch.normal == Vec3::Zero()) continue;
    const Vec3 slip =
        velocity(patch.body_a, patch.centre, before) - velocity(patch.body_b, patch.centre, before);
    Vec3 shift = patch.shift + step * tangential(slip, patch.normal);
    const double length = shift.norm();
    if (length > patch.longest) shift *= patch.longest / length;
    double turn = 0;
    if (patch.reach > 0) {
      const double most = patch.longest / std::max(patch.reach, patch.longest);
      turn = patch.turn + step * (spin(patch.body_a) - spin(patch.body_b)).dot(patch.normal);
      turn = std::clamp(turn, -most, most);
    }
    pairs_[i].shift = before.bodies[static_cast<std::size_t>(patch.body_b)].q.conjugate() * shift;
    pairs_[i].turn = turn;
  }
}

/// Velocity after the step of the material point that was at a place before it.
Vec3 PreslidingMemory::velocity(int body, const Vec3& at, const model::State& before) const {
  const OdeBody& moved = bodies_[static_cast<std::size_t>(body)];
  if (moved.id == nullptr) return Vec3::Zero();
  return Vec3(moved.v[0], moved.v[1], moved.v[2]) +
         spin(body).cross(at - before.bodies[static_cast<std::size_t>(body)].p);
}

Vec3 PreslidingMemory::spin(int body) const {
  const OdeBody& moved = bodies_[static_cast<std::size_t>(body)];
  return moved.id == nullptr ? Vec3(Vec3::Zero()) : Vec3(moved.w[0], moved.w[1], moved.w[2]);
}

}  // namespace handsim::engine::ode
