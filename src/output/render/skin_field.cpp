#include "handsim/output/render/skin_field.h"

#include <algorithm>
#include <cmath>

#include "handsim/core/error.h"
#include "handsim/core/index.h"
#include "handsim/output/render/draw_list.h"

namespace handsim::output {

namespace {

/// Between neighbouring fingers, beyond their splay: the grid must resolve the gap beside the web [rad].
constexpr double kSpread = 11 * M_PI / 180;
/// Radii of blending over half the palm's thickness: of the palm's shapes, of the wrist, of fingers on the
/// palm, the thumb on the palm, neighbouring fingers at their roots, the thumb's web.
constexpr double kPalmBlend = 0.35, kWristBlend = 0.8, kWebBlend = 0.3;
constexpr float kRootBlend = 0.6F, kThumbBlend = 0.5F, kFingerBlend = 0.4F;
/// Of segments, over the radius.
constexpr double kJointBlend = 0.15;
/// Of the palm into its shapes, over half its thickness: takes away what blending adds to the volume.
constexpr double kInset = 0.04;
/// Of the thumb's web at its ends, over that of thumb and palm.
constexpr double kWebThickness = 0.5;
/// A fingertip is narrower than its segment.
constexpr double kTip = 0.9;
/// Of the wrist over the palm's breadth; of its end over the hand's length.
constexpr double kWristWidth = 0.7, kWristThickness = 0.41, kWristEnd = 0.13;
/// Half width of a hinge over the skin's depth. A finger that bends by theta turns about the joint's centre,
/// and its inner skin turns over where theta times depth exceeds 2 width / 1.25, see ramp().
constexpr double kHingeWidth = 1.25, kRootWidth = 1.4;
/// Half of the gap over which skin between two fingers passes from one to the other, over the radius.
constexpr double kShare = 0.7;
/// Of the distance to the palm less that to the finger, over its radius: where the finger begins to move the
/// skin; and where it alone moves that of the thumb, whose muscles are in the palm.
constexpr double kFree = -1.2, kThumbFree = 1.8;

/// Rises from 0 at `from` to 1 at `to`, with a slope of at most 1.25 / (to - from).
double ramp(double x, double from, double to) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return 0.5 * (t + t * t * (3 - 2 * t));
}

/// The least of both, rounded where they differ by less than k (quadratic; Quilez, "smooth minimum").
Lanes joined(const Lanes& a, const Lanes& b, const Lanes& k) {
  const Lanes h = (1 - (a - b).abs() / k.max(1e-9F)).max(0);
  return a.min(b) - h * h * k / 4;
}
Lanes joined(const Lanes& a, const Lanes& b, double k) {
  return joined(a, b, Lanes::Constant(static_cast<float>(k)).eval());
}

constexpr float kFar = 1e3;

/// Smooth union of flesh; what is further than `limit` is left out.
Lanes united(const std::vector<Flesh>& flesh, const Points& x, double k, float limit = kFar) {
  Lanes out = Lanes::Constant(kFar);
  for (const Flesh& each : flesh)
    if (each.may_be_within(std::min(out.maxCoeff() + static_cast<float>(k), limit), x))
      out = joined(out, each.distance(x), k);
  return out;
}

/// For each point, of the flesh nearest to it.
std::array<int, kLanes> nearest(const std::vector<Flesh>& flesh, const Points& x, int Flesh::*what) {
  std::array<int, kLanes> out{};
  Lanes least = Lanes::Constant(kFar);
  for (const Flesh& each : flesh) {
    if (!each.may_be_within(least.maxCoeff(), x)) continue;
    const Lanes distance = each.distance(x);
    for (int i = 0; i < kLanes; ++i)
      if (distance[i] < least[i]) out[at(i)] = each.*what;
    least = least.min(distance);
  }
  return out;
}

/// A shape at pose X_HB of its body; a box is as round as it can be.
Flesh flesh_of(const model::Model& model, int shape, int body, const Pose& x_HB) {
  const Solid exact = solid(model.shapes[at(shape)], x_HB * model.shapes[at(shape)].pose);
  const double round = is_capsule(exact) ? 0 : exact.half.minCoeff();
  return {exact.pose, exact.half - Vec3::Constant(round), exact.round + round, exact.round + round, shape,
          body};
}

}  // namespace

Points points_about(const Vec3& centre, double reach, const std::array<Vec3, kLanes>& offsets) {
  Points out;
  double spread = 0;
  for (std::size_t i = 0; i < kLanes; ++i) {
    out.rows.row(static_cast<long>(i)) = (centre + reach * offsets[i]).transpose().array().cast<float>();
    spread = std::max(spread, (offsets[i] - offsets[0]).squaredNorm());
  }
  out.spread = static_cast<float>(reach * std::sqrt(spread));
  return out;
}

Lanes Flesh::distance(const Points& points) const {
  const Eigen::Vector3f p = pose.p.cast<float>();
  Lanes x = points.rows.col(0) - p.x(), y = points.rows.col(1) - p.y(), z = points.rows.col(2) - p.z();
  Lanes radius = Lanes::Constant(static_cast<float>(near));
  for (int k = 0; k < 3; ++k)
    if (const auto most = static_cast<float>(half[k]); most > 0) {
      const Eigen::Vector3f axis = axes.col(k);
      const Lanes within = (x * axis.x() + y * axis.y() + z * axis.z()).max(-most).min(most);
      x -= within * axis.x();
      y -= within * axis.y();
      z -= within * axis.z();
      if (k == 2) radius += (0.5F + 0.5F / most * within) * static_cast<float>(far - near);
    }
  return (x * x + y * y + z * z).sqrt() - radius;
}

bool Flesh::may_be_within(float d, const Points& x) const {
  const float reach = d + x.spread + size;
  const Eigen::Vector3f p = pose.p.cast<float>();
  return reach > 0 && (x.rows.row(0).matrix().transpose() - p).squaredNorm() < reach * reach;
}

SkinField::SkinField(const model::Model& model, const model::HandIndex& hand)
    : x_HW_((model.bodies[at(hand.palm)].zero_pose * hand.wrist_frame).inverse()) {
  add_palm(model, hand);
  add_rays(model, hand);
  spread();
  shape_rays();
  for (const Ray& ray : rays_)
    for (const Flesh& each : ray.flesh) length = std::max(length, each.end().norm() + each.far);
  add_wrist(hand.forearm.has_value());
  add_web();
  const auto set_axes = [](std::vector<Flesh>& flesh) {
    for (Flesh& each : flesh) {
      each.axes = each.pose.q.toRotationMatrix().cast<float>();
      each.size = static_cast<float>(each.half.norm() + std::max(each.near, each.far));
    }
  };
  palm_.push_back(stump_);
  for (std::vector<Flesh>* flesh : {&palm_, &web_}) set_axes(*flesh);
  all_ = palm_;
  stump_ = palm_.back();
  palm_.pop_back();
  for (Ray& ray : rays_) {
    set_axes(ray.flesh);
    all_.insert(all_.end(), ray.flesh.begin(), ray.flesh.end());
  }
  set_hinges();
  for (const Flesh& each : all_) {
    low = low.cwiseMin(each.pose.p - each.reach());
    high = high.cwiseMax(each.pose.p + each.reach());
  }
  low.y() = std::max(low.y(), cut_);
}

void SkinField::add_palm(const model::Model& model, const model::HandIndex& hand) {
  bodies = {hand.palm};
  bodies.insert(bodies.end(), hand.palm_parts.begin(), hand.palm_parts.end());
  for (const int body : bodies) rest.push_back(x_HW_ * model.bodies[at(body)].zero_pose);
  for (std::size_t i = 0; i < model.shapes.size(); ++i) {
    const auto found = std::ranges::find(bodies, model.shapes[i].body);
    if (found == bodies.end()) continue;
    const auto body = static_cast<int>(found - bodies.begin());
    palm_.push_back(flesh_of(model, static_cast<int>(i), body, rest[at(body)]));
    scale_ += palm_.back().near;
  }
  if (palm_.empty()) throw input_error(hand.name, "a palm without shapes", "one or more, for a skin");
  scale_ /= static_cast<double>(palm_.size());
}

/// Joints come after those of their parents.
void SkinField::add_rays(const model::Model& model, const model::HandIndex& hand) {
  const std::size_t roots = bodies.size();
  std::vector<std::pair<int, std::size_t>> ray_of;  // bodies of rays, with those that have no shape
  for (const int index : hand.joints) {
    const model::Joint& joint = model.joints[at(index)];
    if (joint.closes_loop || joint.child == hand.forearm ||
        std::find(bodies.begin(), bodies.begin() + static_cast<long>(roots), joint.child) !=
            bodies.begin() + static_cast<long>(roots))
      continue;
    const auto parent = std::ranges::find(ray_of, joint.parent, &std::pair<int, std::size_t>::first);
    const std::size_t ray = parent == ray_of.end() ? rays_.size() : parent->second;
    if (ray == rays_.size()) rays_.emplace_back();
    ray_of.emplace_back(joint.child, ray);
    const Pose x_HB = x_HW_ * model.bodies[at(joint.child)].zero_pose;
    const auto body = static_cast<int>(bodies.size());
    std::vector<Flesh>& flesh = rays_[ray].flesh;
    const std::size_t before = flesh.size();
    for (std::size_t i = 0; i < model.shapes.size(); ++i) {
      if (model.shapes[i].body != joint.child) continue;
      flesh.push_back(flesh_of(model, static_cast<int>(i), body, x_HB));
      rays_[ray].thumb = model.shapes[i].part == model::Part::thumb;
    }
    if (flesh.size() == before) continue;
    bodies.push_back(joint.child);
    rest.push_back(x_HB);
    rays_[ray].hinges.push_back({body, x_HB * joint.child_frame.p, Vec3::UnitY(), 0});
  }
  std::erase_if(rays_, [](const Ray& ray) { return ray.flesh.empty(); });
}

void SkinField::spread() {
  std::vector<Ray*> fingers;
  for (Ray& ray : rays_)
    if (!ray.thumb) fingers.push_back(&ray);
  std::ranges::sort(fingers, {}, [](const Ray* ray) { return ray->hinges[0].centre.x(); });
  for (std::size_t i = 0; i < fingers.size(); ++i) {
    const double angle = kSpread * (0.5 * static_cast<double>(fingers.size() - 1) - static_cast<double>(i));
    const Quat turn(Eigen::AngleAxisd(angle, Vec3::UnitZ()));
    const Vec3 centre = fingers[i]->hinges[0].centre;
    const Pose turned = {centre - turn * centre, turn};
    for (Flesh& each : fingers[i]->flesh) each.pose = turned * each.pose;
    for (Hinge& hinge : fingers[i]->hinges) {
      hinge.centre = turned * hinge.centre;
      rest[at(hinge.body)] = turned * rest[at(hinge.body)];
    }
  }
}

/// Segments become cones that meet without a step, and their axes distal.
void SkinField::shape_rays() {
  for (Ray& ray : rays_) {
    ray.radius = ray.flesh[0].near;
    Flesh* before = nullptr;
    for (Flesh& each : ray.flesh) {
      const Vec3 joint = std::ranges::find(ray.hinges, each.body, &Hinge::body)->centre;
      if ((each.end() - joint).norm() < (each.pose * Vec3(0, 0, -each.half.z()) - joint).norm())
        each.pose.q = each.pose.q * Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
      if (before && before->body != each.body && (before->end() - joint).norm() < each.near)
        before->far = each.near = 0.5 * (before->far + each.near);
      before = &each;
    }
    // The fingertip stays where it is.
    const double less = (1 - kTip) * before->far;
    before->half.z() += less / 2;
    before->pose.p += before->pose.q * Vec3(0, 0, less / 2);
    before->far -= less;
  }
}

/// From the carpus to where the arm is cut off.
void SkinField::add_wrist(bool on_forearm) {
  Vec3 from = Vec3::Constant(1e9), to = -from;
  for (const Flesh& each : palm_) {
    from = from.cwiseMin(each.pose.p - each.reach());
    to = to.cwiseMax(each.pose.p + each.reach());
  }
  const double breadth = to.x() - from.x(), round = kWristThickness * breadth / 2;
  // A forearm's cap hides the end.
  cut_ = -(on_forearm ? 0.4 : 1) * kWristEnd * length;
  const Vec3 half = {std::max(kWristWidth * breadth / 2 - round, 0.0), 0.5 * (round - cut_), 0};
  const Vec3 centre = {(from.x() + to.x()) / 2, -half.y(), (from.z() + to.z()) / 2};
  stump_ = {{centre, Quat::Identity()}, half, round, round, palm_[0].shape, palm_[0].body};
}

/// Strands from the thumb's first segment to its neighbour's metacarpal.
void SkinField::add_web() {
  const auto thumb = std::ranges::find(rays_, true, &Ray::thumb);
  if (thumb == rays_.end()) return;
  const Flesh& first = thumb->flesh[0];
  const Vec3 base = thumb->hinges[0].centre;
  const Ray* beside = nullptr;
  const auto distance = [&](const Ray& ray) { return (ray.hinges[0].centre - first.end()).norm(); };
  for (const Ray& ray : rays_)
    if (!ray.thumb && (!beside || distance(ray) < distance(*beside))) beside = &ray;
  if (!beside) return;
  for (const double share : {0.5, 0.75, 1.0}) {
    const Vec3 from = base + share * (first.end() - base);
    const Vec3 to = base + 0.8 * share * (beside->hinges[0].centre - base);
    Flesh strand = first;
    strand.pose = {0.5 * (from + to), Quat::FromTwoVectors(Vec3::UnitZ(), to - from)};
    strand.half = {0, 0, 0.5 * (to - from).norm()};
    strand.near = kWebThickness * first.near;
    strand.far = kWebThickness * scale_;
    web_.push_back(strand);
  }
}

void SkinField::set_hinges() {
  for (Ray& ray : rays_) {
    ray.embedded = -palm(points_about(ray.hinges[0].centre, 0, {}))[0] - ray.radius;
    const auto distal = [&](const Hinge& hinge) {
      return Vec3(std::ranges::find(ray.flesh, hinge.body, &Flesh::body)->pose.q * Vec3::UnitZ());
    };
    for (std::size_t i = 0; i < ray.hinges.size(); ++i) {
      Hinge& hinge = ray.hinges[i];
      hinge.along = (distal(hinge) + distal(ray.hinges[i > 0 ? i - 1 : 0])).normalized();
      const double depth = -(*this)(points_about(hinge.centre, 0, {}))[0];
      hinge.width = (i > 0 ? kHingeWidth : kRootWidth) * std::max(depth, 0.5 * ray.radius);
    }
  }
}

Lanes SkinField::palm(const Points& x) const {
  const Lanes out = united(palm_, x, kPalmBlend * scale_);
  return joined(out, stump_.distance(x), kWristBlend * scale_) + static_cast<float>(kInset * scale_);
}

Lanes SkinField::operator()(const Points& x) const {
  const Lanes of_palm = palm(x);
  const auto scale = static_cast<float>(scale_);
  // Beyond their roots fingers do not melt, nor the thumb with the hand.
  const Lanes at_root = (1.5F - of_palm / scale).max(0).min(1) * scale;
  const float limit = std::max(of_palm.maxCoeff(), 0.0F) + 2 * scale;
  Lanes fingers = Lanes::Constant(kFar), thumb = fingers;
  for (const Ray& ray : rays_) {
    Lanes& group = ray.thumb ? thumb : fingers;
    const Lanes each =
        united(ray.flesh, x, kJointBlend * ray.radius, std::min(limit, group.maxCoeff() + scale));
    group = joined(group, each, (at_root * kFingerBlend).eval());
  }
  if (!web_.empty()) thumb = joined(thumb, united(web_, x, kWebBlend * scale_, limit), kWebBlend * scale_);
  const Lanes of_hand =
      joined(joined(of_palm, fingers, (at_root * kRootBlend).eval()), thumb, (at_root * kThumbBlend).eval());
  return -joined(-of_hand, x.rows.col(1) - static_cast<float>(cut_), 0.3 * scale_);
}

Eigen::Array<float, kLanes, Eigen::Dynamic> SkinField::distances(const Points& x) const {
  Eigen::Array<float, kLanes, Eigen::Dynamic> out(kLanes, static_cast<long>(rays_.size()) + 1);
  out.col(0) = palm(x);
  for (std::size_t i = 0; i < rays_.size(); ++i)
    out.col(static_cast<long>(i) + 1) = united(rays_[i].flesh, x, kJointBlend * rays_[i].radius);
  return out;
}

Eigen::RowVectorXf SkinField::shares(const Eigen::RowVectorXf& distances) const {
  const float* to_ray = distances.data() + 1;
  Eigen::RowVectorXf out(static_cast<long>(rays_.size()));
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    const Ray& ray = rays_[i];
    double share = ramp(distances[0] - to_ray[i] + ray.embedded, kFree * ray.radius,
                        (ray.thumb ? kThumbFree : 0) * ray.radius);
    for (std::size_t k = 0; k < rays_.size(); ++k) {
      const double width = kShare * (ray.radius + rays_[k].radius) / 2;
      if (k != i) share *= ramp(to_ray[k] - to_ray[i], -width, width);
    }
    out[static_cast<long>(i)] = static_cast<float>(share);
  }
  return out;
}

Eigen::RowVectorXf SkinField::weights(const Vec3& x, const Eigen::RowVectorXf& shares) const {
  Eigen::RowVectorXd out = Eigen::RowVectorXd::Zero(static_cast<long>(bodies.size()));
  const bool one = rays_.empty() || rays_[0].hinges[0].body == 1;
  const int palm_body = one ? 0 : nearest(palm_, points_about(x, 0, {}), &Flesh::body)[0];
  out[palm_body] = 1;
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    auto share = static_cast<double>(shares[static_cast<long>(i)]);
    int from = palm_body;
    for (const Hinge& hinge : rays_[i].hinges) {
      share *= ramp(hinge.along.dot(x - hinge.centre), -hinge.width, hinge.width);
      out[hinge.body] += share;
      out[from] -= share;
      from = hinge.body;
    }
  }
  return (out.cwiseMax(0) / out.cwiseMax(0).sum()).cast<float>();
}

double SkinField::beyond_palm(const Eigen::RowVectorXf& distances) const {
  const auto fingers = distances.tail(distances.size() - 1);
  return std::clamp((distances[0] - (fingers.size() > 0 ? fingers.minCoeff() : kFar)) / scale_, -9.0, 9.0);
}

std::array<int, kLanes> SkinField::nearest_shapes(const Points& x) const {
  return nearest(all_, x, &Flesh::shape);
}

}  // namespace handsim::output
