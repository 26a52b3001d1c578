#include "handsim/simulation/watch/grasp_figures.h"

#include <algorithm>
#include <cmath>
#include <concepts>

namespace handsim::simulation {

namespace {

/// Parts that bear less than this share of the grip say nothing of its friction.
constexpr double kBearing = 1e-3;

template <class Archive, class T>
void carry_grip(Archive& archive, T& grip) {
  archive(grip.time);
  archive.list(grip.parts, [](auto& each, auto& part) { carry_part(each, part); });
  archive(grip.contacts);
  archive(grip.others);
  archive(grip.normal);
  archive(grip.friction_used);
  archive(grip.wrenches.force_closure);
  archive(grip.wrenches.epsilon);
  archive(grip.wrenches.volume);
}

template <class Archive, class T>
void carry_figures(Archive& archive, T& figures) {
  archive(figures.complete);
  carry_grip(archive, figures.hold);
  carry_grip(archive, figures.after);
  for (auto* value : {&figures.slip, &figures.spin, &figures.shaken_shift, &figures.shaken_time,
                      &figures.shift, &figures.turn})
    archive(*value);
  archive(figures.held);
}

template <class Archive, class T>
void carry_pose(Archive& archive, T& pose) {
  bool there = pose.has_value();
  archive(there);
  if constexpr (std::same_as<Archive, ArchiveReader>)
    pose = there ? std::optional<Pose>(Pose()) : std::nullopt;
  if (!pose) return;
  archive(pose->p);
  archive(pose->q);
}

/// Distance of a shape's farthest point from the origin of its body [m].
double reach(const model::Shape& shape) {
  const Vec3& p = shape.pose.p;
  const Vec3 axis = shape.pose.q * Vec3::UnitZ();
  switch (shape.kind) {
    case model::ShapeKind::sphere:
      return p.norm() + shape.radius;
    case model::ShapeKind::capsule:
      return std::max((p + 0.5 * shape.length * axis).norm(), (p - 0.5 * shape.length * axis).norm()) +
             shape.radius;
    case model::ShapeKind::cylinder: {
      const Vec3 across = p - p.dot(axis) * axis;
      return std::hypot(across.norm() + shape.radius, std::abs(p.dot(axis)) + 0.5 * shape.length);
    }
    case model::ShapeKind::box: {
      const Vec3 inside = shape.pose.q.conjugate() * p;
      return (inside.cwiseAbs() + 0.5 * shape.edges).norm();
    }
    case model::ShapeKind::convex_mesh: {
      double most = 0;
      for (const Vec3& vertex : shape.mesh->vertices) most = std::max(most, (shape.pose * vertex).norm());
      return most;
    }
    case model::ShapeKind::plane:
      return 0;
  }
  return 0;
}

double friction_of(const model::Model& model, const engine::Contact& contact, double* spinning) {
  const model::Shape& a = model.shapes[static_cast<std::size_t>(contact.shape_a)];
  const model::Shape& b = model.shapes[static_cast<std::size_t>(contact.shape_b)];
  model::Material between = model::combined(model.materials[static_cast<std::size_t>(a.material)],
                                            model.materials[static_cast<std::size_t>(b.material)]);
  for (const model::ContactRule& rule : model.contact_rules) {
    const bool of_pair = (rule.group_a == a.group && rule.group_b == b.group) ||
                         (rule.group_a == b.group && rule.group_b == a.group);
    if (of_pair && rule.material != model::kCombined)
      between = model.materials[static_cast<std::size_t>(rule.material)];
  }
  *spinning = between.spinning_friction;
  return between.friction;
}

}  // namespace

GraspWatch::GraspWatch(const model::Model& model, const scene::GraspPlan& plan, double step)
    : model_(model), half_step_(step / 2), part_of_body_(model.bodies.size(), -1) {
  const model::HandIndex& hand = model.hands[plan.hand];
  palm_ = static_cast<std::size_t>(hand.palm);
  for (std::size_t i = 0; i < model.bodies.size(); ++i)
    if (model.bodies[i].name == plan.object) object_ = i;
  for (const model::Shape& shape : model.shapes) {
    if (std::find(hand.bodies.begin(), hand.bodies.end(), shape.body) != hand.bodies.end())
      part_of_body_[static_cast<std::size_t>(shape.body)] = hand_part(shape.part);
    if (static_cast<std::size_t>(shape.body) == object_) length_ = std::max(length_, reach(shape));
  }
  hold_end_ = plan.phase("hold")->end;
  slip_start_ = std::max(plan.phase("hold")->start, hold_end_ - kSlipSpan);
  end_ = plan.end();
  figures_.name = hand.name + "." + plan.object;
}

Pose GraspWatch::object_in_palm(const model::State& state) const {
  return state.bodies[palm_].pose().inverse() * state.bodies[object_].pose();
}

Grip GraspWatch::grip(const engine::Engine& engine) const {
  Grip out;
  out.time = engine.state().time;
  std::array<PartForce, kHandParts.size()> parts;
  std::array<double, kHandParts.size()> limits{};
  std::vector<WrenchContact> wrenches;
  const Vec3 centre = engine.state().bodies[object_].p;
  for (const engine::Contact& contact : engine.contacts()) {
    const auto a = static_cast<std::size_t>(model_.shapes[static_cast<std::size_t>(contact.shape_a)].body);
    const auto b = static_cast<std::size_t>(model_.shapes[static_cast<std::size_t>(contact.shape_b)].body);
    if (a != object_ && b != object_) continue;
    const int part = part_of_body_[a == object_ ? b : a];
    const double normal = contact.normal_force();
    if (normal <= 0) continue;
    if (part < 0) {
      ++out.others;
      continue;
    }
    const double friction = contact.friction_force().norm();
    PartForce& sum = parts[static_cast<std::size_t>(part)];
    ++sum.contacts;
    sum.normal += normal;
    sum.friction += friction;
    out.normal += normal;
    ++out.contacts;
    WrenchContact wrench;
    wrench.friction = friction_of(model_, contact, &wrench.spinning);
    wrench.position = contact.position - centre;
    wrench.normal = a == object_ ? contact.normal : Vec3(-contact.normal);
    wrenches.push_back(wrench);
    limits[static_cast<std::size_t>(part)] += wrench.friction * normal;
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].contacts == 0) continue;
    parts[i].part = kHandParts[i];
    if (parts[i].normal > kBearing * out.normal && limits[i] > 0)
      out.friction_used = std::max(out.friction_used, parts[i].friction / limits[i]);
    out.parts.push_back(parts[i]);
  }
  out.wrenches = wrench_space(wrenches, length_);
  return out;
}

void GraspWatch::save(ArchiveWriter& out) const {
  carry_pose(out, at_slip_start_);
  carry_pose(out, at_hold_end_);
  carry_figures(out, figures_);
}

void GraspWatch::restore(ArchiveReader& in) {
  carry_pose(in, at_slip_start_);
  carry_pose(in, at_hold_end_);
  carry_figures(in, figures_);
}

void GraspWatch::look(const engine::Engine& engine) {
  if (figures_.complete) return;
  const double time = engine.state().time;
  if (time < slip_start_ - half_step_) return;
  const Pose now = object_in_palm(engine.state());
  if (!at_slip_start_) at_slip_start_ = now;
  if (!at_hold_end_) {
    if (time < hold_end_ - half_step_) return;
    at_hold_end_ = now;
    figures_.hold = grip(engine);
    const double span = std::max(hold_end_ - slip_start_, 2 * half_step_);
    figures_.slip = (now.p - at_slip_start_->p).norm() / span;
    figures_.spin = rotation_vector(now.q * at_slip_start_->q.conjugate()).norm() / span;
  }
  const double shift = (now.p - at_hold_end_->p).norm();
  if (shift > figures_.shaken_shift) {
    figures_.shaken_shift = shift;
    figures_.shaken_time = time;
  }
  if (time >= end_ - half_step_) finish(engine, now);
}

void GraspWatch::finish(const engine::Engine& engine, const Pose& now) {
  figures_.complete = true;
  figures_.after = grip(engine);
  figures_.shift = (now.p - at_hold_end_->p).norm();
  figures_.turn = rotation_vector(now.q * at_hold_end_->q.conjugate()).norm();
  figures_.held = figures_.shift <= kHeldShift && figures_.turn <= kHeldTurn &&
                  figures_.shaken_shift <= kShakenShift && figures_.after.contacts > 0 &&
                  figures_.after.others == 0 && figures_.hold.others == 0;
}

}  // namespace handsim::simulation
