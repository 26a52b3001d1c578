#include "handsim/output/render/skin_field.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "handsim/core/error.h"
#include "handsim/output/render/draw_list.h"

namespace handsim::output {

namespace {

/// Between neighbouring fingers, beyond their splay: the grid must resolve the gap beside the web [rad].
constexpr double kSpread = 11 * M_PI / 180;
/// Radii of blending over half the palm's thickness: of the palm's shapes, of the wrist, of fingers on the
/// palm, the thumb on the palm, neighbouring fingers at their roots, the thumb's web.
constexpr double kPalmBlend = 0.35, kWristBlend = 0.8, kRootBlend = 0.6, kThumbBlend = 0.5,
                 kFingerBlend = 0.4, kWebBlend = 0.3;
/// Radius of blending between segments of a finger, over its radius.
constexpr double kJointBlend = 0.15;
/// The palm's skin is moved inwards by this share of half its thickness: blending adds as much volume.
constexpr double kInset = 0.04;
/// Radii of the thumb's web at its ends over those of thumb and palm; radius of a fingertip over that of its
/// segment; share of its breadth that a palm that is a box lacks at the wrist.
constexpr double kWebThickness = 0.5, kTip = 0.9, kPalmTaper = 0.3;
/// Width and thickness of the wrist over the palm's breadth; its length over the hand's length.
constexpr double kWristWidth = 0.7, kWristThickness = 0.41, kWristEnd = 0.13;
/// Half width of a hinge over the skin's depth. A finger that bends by theta turns about the joint's centre,
/// and its inner skin turns over where theta times depth exceeds 2 width / 1.25, see ramp().
constexpr double kHingeWidth = 1.25, kRootWidth = 1.4;
/// Half of the gap over which skin between two fingers passes from one to the other, over the radius.
constexpr double kShare = 0.7;
/// Distance to the palm less distance to the finger, over the finger's radius: where a finger begins to move
/// the skin; and where the thumb, whose muscles are in the palm, moves it alone.
constexpr double kFree = -1.2, kThumbFree = 1.2;

/// By how much farther the rest of the palm is than a pad that a finger moves, over the pad's radius, where
/// the pad moves the skin alone.
constexpr double kPadFree = 1.5;

/// Rises from 0 at `from` to 1 at `to`, with a slope of at most 1.25 / (to - from).
double ramp(double x, double from, double to) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return 0.5 * (t + t * t * (3 - 2 * t));
}

constexpr double kFar = 1e3;

/// The least of both, rounded where they differ by less than k (quadratic; Quilez, "smooth minimum").
double joined(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0);
  return std::min(a, b) - (k > 0 ? h * h / (4 * k) : 0);
}

/// Smooth union of flesh; what is further than `limit` is left out.
double united(const std::vector<Flesh>& flesh, const Vec3& x, double k, double limit = kFar) {
  double out = kFar;
  for (const Flesh& each : flesh)
    if (each.may_be_within(std::min(out + k, limit), x)) out = joined(out, each.distance(x), k);
  return out;
}

const Flesh& nearest(const std::vector<Flesh>& flesh, const Vec3& x) {
  const Flesh* out = &flesh[0];
  for (double least = kFar; const Flesh& each : flesh)
    if (each.may_be_within(least, x))
      if (const double d = each.distance(x); d < least) std::tie(out, least) = std::tuple(&each, d);
  return *out;
}

/// A shape at pose X_HB of its body; a box is as round as it can be.
Flesh flesh_of(const model::Model& model, int shape, int body, const Pose& x_HB) {
  const Solid exact = solid(model.shapes[as_index(shape)], x_HB * model.shapes[as_index(shape)].pose);
  const double round = is_capsule(exact) ? 0 : exact.half.minCoeff();
  return {exact.pose, exact.half - Vec3::Constant(round), exact.round + round, exact.round + round, shape,
          body};
}

}  // namespace

double Flesh::distance(const Vec3& x) const {
  Vec3 away = x - pose.p;
  double radius = near, breadth = 1;
  for (const int k : {2, 1, 0})
    if (half[k] > 0) {
      const double within = std::clamp(axes.col(k).dot(away), -breadth * half[k], breadth * half[k]);
      const double rise = 0.5 + 0.5 * within / half[k];
      away -= within * axes.col(k);
      if (k == 2) radius += rise * (far - near);
      if (k == 1) breadth -= taper * (1 - rise);
    }
  return away.norm() - radius;
}

SkinField::SkinField(const model::Model& model, const model::HandIndex& hand)
    : x_HW_((model.bodies[as_index(hand.palm)].zero_pose * hand.wrist_frame).inverse()) {
  add_palm(model, hand);
  const std::size_t roots = bodies.size();
  add_rays(model, hand);
  for (const Flesh& each : palm_) scale_ += each.near;
  scale_ /= static_cast<double>(palm_.size());
  spread();
  shape_rays();
  for (const Ray& ray : rays_)
    for (const Flesh& each : ray.flesh) length = std::max(length, each.end().norm() + each.far);
  add_wrist(hand.forearm.has_value());
  add_web();
  const auto finish = [](Flesh& each) {
    each.axes = each.pose.q.toRotationMatrix();
    each.size = each.half.norm() + std::max(each.near, each.far);
  };
  for (std::vector<Flesh>* flesh : {&palm_, &web_}) std::ranges::for_each(*flesh, finish);
  for (const Flesh& each : palm_) (as_index(each.body) < roots ? rigid_ : pads_).push_back(each);
  finish(stump_);
  all_ = palm_;
  all_.push_back(stump_);
  for (Ray& ray : rays_) {
    std::ranges::for_each(ray.flesh, finish);
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
  for (const int body : bodies) rest.push_back(x_HW_ * model.bodies[as_index(body)].zero_pose);
  for (std::size_t i = 0; i < model.shapes.size(); ++i) {
    const auto found = std::ranges::find(bodies, model.shapes[i].body);
    if (found == bodies.end()) continue;
    const auto body = static_cast<int>(found - bodies.begin());
    palm_.push_back(flesh_of(model, static_cast<int>(i), body, rest[as_index(body)]));
    if (palm_.back().half.x() > 0) palm_.back().taper = kPalmTaper;
  }
  if (palm_.empty()) throw input_error(hand.name, "a palm without shapes", "one or more, for a skin");
}

/// Joints come after those of their parents. A pad of the palm that a finger moves gives skin the form that
/// it has where it is rigid.
void SkinField::add_rays(const model::Model& model, const model::HandIndex& hand) {
  const std::size_t roots = bodies.size();
  std::vector<std::pair<int, std::size_t>> ray_of;  // bodies of rays, with those that have no shape
  for (const int index : hand.joints) {
    const model::Joint& joint = model.joints[as_index(index)];
    if (joint.closes_loop || joint.child == hand.forearm ||
        std::find(bodies.begin(), bodies.begin() + static_cast<long>(roots), joint.child) !=
            bodies.begin() + static_cast<long>(roots))
      continue;
    const auto parent = std::ranges::find(ray_of, joint.parent, &std::pair<int, std::size_t>::first);
    const std::size_t ray = parent == ray_of.end() ? rays_.size() : parent->second;
    if (ray == rays_.size()) rays_.emplace_back();
    ray_of.emplace_back(joint.child, ray);
    const Pose x_HB = x_HW_ * model.bodies[as_index(joint.child)].zero_pose;
    const auto body = static_cast<int>(bodies.size());
    std::vector<Flesh>& flesh = rays_[ray].flesh;
    const std::size_t before = flesh.size();
    for (std::size_t i = 0; i < model.shapes.size(); ++i) {
      if (model.shapes[i].body != joint.child) continue;
      const bool pad = model.shapes[i].part == model::Part::palm;
      (pad ? palm_ : flesh).push_back(flesh_of(model, static_cast<int>(i), body, x_HB));
      if (pad) continue;
      rays_[ray].thumb |= model.shapes[i].part == model::Part::thumb;
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
      for (Flesh& pad : palm_)
        if (pad.body == hinge.body) pad.pose = turned * pad.pose;
      hinge.centre = turned * hinge.centre;
      rest[as_index(hinge.body)] = turned * rest[as_index(hinge.body)];
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
    strand.pose = {0.5 * (from + to), rotation_between(Vec3::UnitZ(), to - from)};
    strand.half = {0, 0, 0.5 * (to - from).norm()};
    strand.near = kWebThickness * first.near;
    strand.far = kWebThickness * scale_;
    web_.push_back(strand);
  }
}

void SkinField::set_hinges() {
  for (Ray& ray : rays_) {
    ray.embedded = -palm(ray.hinges[0].centre, kFar) - ray.radius;
    const auto distal = [&](const Hinge& hinge) {
      return Vec3(std::ranges::find(ray.flesh, hinge.body, &Flesh::body)->pose.q * Vec3::UnitZ());
    };
    for (std::size_t i = 0; i < ray.hinges.size(); ++i) {
      Hinge& hinge = ray.hinges[i];
      hinge.along = (distal(hinge) + distal(ray.hinges[i > 0 ? i - 1 : 0])).normalized();
      hinge.width = (i > 0 ? kHingeWidth : kRootWidth) * std::max(-(*this)(hinge.centre), 0.5 * ray.radius);
    }
  }
}

std::vector<std::int64_t> SkinField::key(bool of_left) const {
  std::vector<std::int64_t> out;
  const auto add = [&](const auto& values) {
    for (const double x : values) out.push_back(std::llround(1e9 * x));
  };
  const auto add_pose = [&](const Pose& given) {
    const Pose x = of_left ? mirrored(given) : given;
    add(x.p);
    add(x.q.toRotationMatrix().reshaped());
  };
  for (const Flesh& each : all_) {
    add_pose(each.pose);
    add(each.half);
    add(std::array{each.near, each.far, 1.0 * each.body});
  }
  for (const Pose& pose : rest) add_pose(pose);
  for (const Ray& ray : rays_)
    for (const Hinge& hinge : ray.hinges) add_pose({hinge.centre, Quat::Identity()});
  return out;
}

std::vector<int> SkinField::shapes() const {
  std::vector<int> out;
  for (const Flesh& each : all_) out.push_back(each.shape);
  return out;
}

double SkinField::palm(const Vec3& x, double limit) const {
  return joined(united(palm_, x, kPalmBlend * scale_, limit), stump_.distance(x), kWristBlend * scale_) +
         kInset * scale_;
}

double SkinField::operator()(const Vec3& x) const {
  const double limit = 2 * scale_, of_palm = palm(x, limit);
  // Beyond their roots fingers do not melt, nor the thumb with the hand.
  const double at_root = std::clamp(1.5 - of_palm / scale_, 0.0, 1.0) * scale_;
  double fingers = kFar, thumb = kFar;
  for (const Ray& ray : rays_) {
    double& group = ray.thumb ? thumb : fingers;
    const double near = std::min(limit, group + scale_);
    group = joined(group, united(ray.flesh, x, kJointBlend * ray.radius, near), at_root * kFingerBlend);
  }
  thumb = joined(thumb, united(web_, x, kWebBlend * scale_, limit), kWebBlend * scale_);
  const double out = joined(joined(of_palm, fingers, at_root * kRootBlend), thumb, at_root * kThumbBlend);
  return -joined(-out, x.y() - cut_, 0.3 * scale_);
}

Eigen::VectorXd SkinField::distances(const Vec3& x) const {
  Eigen::VectorXd out(static_cast<long>(rays_.size()) + 1);
  out[0] = palm(x, kFar);
  for (std::size_t i = 0; i < rays_.size(); ++i)
    out[static_cast<long>(i) + 1] = united(rays_[i].flesh, x, kJointBlend * rays_[i].radius);
  return out;
}

Eigen::RowVectorXf SkinField::shares(const Eigen::VectorXd& distances) const {
  const double* to_ray = distances.data() + 1;
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
  const int palm_body = nearest(rigid_, x).body;
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
  const double to_rigid = pads_.empty() ? 0 : nearest(rigid_, x).distance(x);
  for (const Flesh& pad : pads_) {
    const double share = out[palm_body] * ramp(to_rigid - pad.distance(x), 0, kPadFree * pad.near);
    out[pad.body] += share;
    out[palm_body] -= share;
  }
  return (out.cwiseMax(0) / out.cwiseMax(0).sum()).cast<float>();
}

double SkinField::beyond_palm(const Eigen::VectorXd& distances) const {
  const auto fingers = distances.tail(distances.size() - 1);
  return std::clamp((distances[0] - (fingers.size() > 0 ? fingers.minCoeff() : kFar)) / scale_, -9.0, 9.0);
}

int SkinField::nearest_shape(const Vec3& x) const { return nearest(all_, x).shape; }

}  // namespace handsim::output
