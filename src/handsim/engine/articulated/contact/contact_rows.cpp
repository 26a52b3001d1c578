// Rows of the contact solver: contacts with their materials, loops; the warm start from the last step, and
// the impulses and forces of the solution.
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "handsim/engine/articulated/contact/contact_dynamics.h"
#include "handsim/engine/articulated/contact/tuning.h"
#include "handsim/engine/spring.h"

namespace handsim::engine::articulated {

/// Whether the step moves the bodies against each other; contacts of two bases would have no finite impulse.
bool ContactDynamics::has_rows(const Touch& touch) const {
  const Contact& any = collider_.contacts()[touch.first];
  return node_of(any.shape_a) != node_of(any.shape_b);
}

/// The bodies of a pair that touches, and the unknowns that move one against the other.
void ContactDynamics::compute_pair(ContactProblem& p, std::size_t index, int shape_a, int shape_b) {
  pair_.a = velocity_of(shape_a);
  pair_.b = velocity_of(shape_b);
  const Mobility a = mobility_of(shape_a), b = mobility_of(shape_b);
  pair_.mobility = {a.linear + b.linear, a.angular + b.angular};
  const int node_a = node_of(shape_a), node_b = node_of(shape_b);
  if (index == moving_dofs_.size()) moving_dofs_.emplace_back();
  MovingDofs& moving = moving_dofs_[index];
  moving_ = &moving;
  if (moving.node_a != node_a || moving.node_b != node_b) {
    moving.node_a = node_a;
    moving.node_b = node_b;
    collect_moving_dofs(moving);
  }
  const auto last = [&](int node) {
    return node == kNoNode ? kNone : place_[as_index(space_.last_dof(node))];
  };
  p.add_pair(last(node_a), last(node_b), pair_.a.origin - pair_.b.origin, moving.dofs);
}

/// Mobility across a contact's normal by the inertia's diagonal, both directions [1/kg]; or a lower bound.
double ContactDynamics::mobility_across(ContactProblem& p, const Contact& contact, double enough) {
  double sum = 0;
  const Vec3 r_a = contact.position - pair_.a.origin, r_b = contact.position - pair_.b.origin;
  for (std::size_t k = 0; k < moving_->dofs.size(); ++k) {
    const int i = moving_->dofs[k];
    const double* S = p.motion(i);
    const Vec3 v = Vec3(S[4], S[5], S[6]) + Vec3(S[0], S[1], S[2]).cross(moving_->signs[k] > 0 ? r_a : r_b);
    const double along = contact.normal.dot(v);
    sum += (v.squaredNorm() - along * along) * inverse_inertia_[as_index(i)];
    if (sum >= enough) return sum;
  }
  return sum;
}

/// Gives a contact its pad: a law, or a spring and damper with their target, which is returned.
double ContactDynamics::set_compliance(ContactRows& rows, const Contact& contact,
                                       const model::Material& surface, double share, double step) {
  const model::Compliance& pad = *surface.compliance;
  const double depth = depth_in_pad(contact);
  if (!pad.law) {
    const SoftRow spring =
        soft_row(share * pad.stiffness, share * damping_beside(pad.stiffness, pad.damping, step), step);
    rows.regularization = spring.cfm / step;
    return spring.erp * depth / step;
  }
  points_.push_back({&pad, depth, step, share, pad_.gain, pad_.offset});
  rows.pad = &points_.back();
  rows.regularization = 1 / rows.pad->at(0).slope;
  return 0;
}

/// Velocity along the normal that a contact is to have after the step, and its regularization.
double ContactDynamics::compute_target(ContactRows& rows, const Contact& contact,
                                       const model::Material& surface, double share, double crossed,
                                       double approach, double step) {
  double target = 0;
  if (surface.compliance) {
    target = set_compliance(rows, contact, surface, share, step);
  } else {
    const double inside = std::max(contact.depth - kSurfaceLayer, 0.0);
    // A gap may close within the step.
    target = contact.depth < 0 ? contact.depth / step : std::min(erp_ * inside / step, kMaxCorrectingSpeed);
    rows.regularization = std::max(kTuning.normal_regularization * pair_.mobility.linear, crossed);
    if (crossed == 0 && pair_.mobility.linear * heaviest_ > kTuning.light_pair)
      light_.push_back(frames_.size() - 1);
  }
  if (surface.restitution > 0 && approach > surface.restitution_speed) {
    target = std::max(target, surface.restitution * approach);
    // A law bounces by its tangent.
    rows.pad = nullptr;
  }
  return target;
}

/// A contact's rows by its materials; the same laws as the ODE engine's.
void ContactDynamics::add_contact(ContactProblem& p, const Touch& touch, std::size_t index, double step) {
  const Contact& contact = collider_.contacts()[index];
  const model::Material& surface = touch.surface;
  const double share = collider_.shares()[index];
  // No friction between crossed bodies: normals on both sides of a finger would jam it.
  const double crossed = surface.compliance ? 0 : crossed_.inverse_mass(contact);
  const double friction = friction_ && crossed == 0 ? surface.friction : 0;
  const double spinning = friction_ ? collider_.spinning(touch, index) : 0;
  const double rolling = friction_ ? surface.rolling_friction : 0;
  ContactRows& rows =
      p.add_contact(1U + (friction > 0 ? 2U : 0U) + (spinning > 0 ? 1U : 0U) + (rolling > 0 ? 2U : 0U));
  Mat3& frame = frames_.emplace_back();
  frame.col(0) = contact.normal;
  frame.col(1) = contact.normal.unitOrthogonal();
  frame.col(2) = contact.normal.cross(frame.col(1));
  const Vec3 v =
      frame.transpose() * (pair_.a.velocity(contact.position) - pair_.b.velocity(contact.position));
  rows.r0[0] = v.x() - compute_target(rows, contact, surface, share, crossed, -v.x(), step);

  double* G = p.wrenches_of(rows);
  const auto set_wrench = [](double* to, const Vec3& moment, const Vec3& force) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      to[k] = moment[k];
      to[4 + k] = force[k];
    }
  };
  const Vec3 arm = contact.position - pair_.a.origin;
  for (Eigen::Index k = 0; k < (friction > 0 ? 3 : 1); ++k)
    set_wrench(G + kSpatial * as_index(k), arm.cross(frame.col(k)), frame.col(k));
  std::size_t row = 1;
  const auto add = [&](Disc::Kind kind, double coefficient, double regularization) {
    Disc& disc = rows.discs[rows.disc_count++];
    disc.kind = kind;
    disc.row = row;
    disc.size = kind == Disc::Kind::spinning ? 1 : 2;
    disc.coefficient = coefficient;
    disc.regularization = kTuning.friction_regularization * regularization;
  };
  const auto add_turning = [&](int axis) {
    rows.r0[row] = frame.col(axis).dot(pair_.a.w - pair_.b.w);
    set_wrench(G + kSpatial * row++, frame.col(axis), Vec3::Zero());
  };
  if (friction > 0) {
    const double mobility = pair_.mobility.linear;
    const double firm = kTuning.firm_below * mobility;
    add(Disc::Kind::sliding, friction,
        std::clamp(mobility_across(p, contact, firm) / firm, kTuning.least_share, 1.0) * mobility);
    rows.r0[row++] = v.y();
    rows.r0[row++] = v.z();
  }
  if (spinning > 0) {
    add(Disc::Kind::spinning, spinning, pair_.mobility.angular);
    add_turning(0);
  }
  if (rolling > 0) {
    add(Disc::Kind::rolling, rolling, pair_.mobility.angular);
    add_turning(1);
    add_turning(2);
  }
}

void ContactDynamics::add_contacts(ContactProblem& p, double step) {
  frames_.clear();
  light_.clear();
  warm_started_ = 0;
  crossed_.find(collider_);
  // Room for all: rows refer to them.
  points_.clear();
  if (pads_) {
    points_.reserve(collider_.contacts().size());
    pads_->recall(collider_, step);
  }
  std::size_t pairs = 0;
  std::pair<int, int> bodies;
  for (const Touch& touch : collider_.touches()) {
    if (!has_rows(touch)) continue;
    const Contact& any = collider_.contacts()[touch.first];
    // Shapes of the same two bodies often follow each other.
    const std::pair<int, int> these(body_of(any.shape_a), body_of(any.shape_b));
    if (const auto last = std::exchange(bodies, these); pairs == 0 || last != these)
      compute_pair(p, pairs++, any.shape_a, any.shape_b);
    if (pads_) pad_ = pads_->of(as_index(&touch - collider_.touches().data()));
    for (int index = 0; index < touch.count; ++index) {
      const std::size_t i = touch.first + as_index(index);
      add_contact(p, touch, i, step);
      warm_start(p.contacts.back(), collider_.contacts()[i], frames_.back(), index);
    }
  }
}

void ContactDynamics::add_loop_rows(ContactProblem& p) {
  if (!loops_) return;
  const std::size_t n = as_index(space_.size());
  const std::span<const double> rates = loops_->rates(), J = loops_->jacobian();
  std::vector<double>& entries = loop_entries_;
  for (std::size_t i = 0; i < rates.size(); ++i) {
    loop_dofs_.clear();
    entries.clear();
    double mobility = 0;
    for (int place = 0; place < space_.size(); ++place) {
      const double entry = J[i * n + as_index(dof_of_[as_index(place)])];
      if (entry == 0) continue;
      loop_dofs_.push_back(place);
      entries.push_back(entry);
      mobility += entry * entry / p.inertia(place);
    }
    // No rate changes this row.
    if (loop_dofs_.empty()) continue;
    ContactRows& row = p.add(loop_dofs_, 1);
    row.bilateral = true;
    row.open = false;
    row.r0[0] = rates[i];
    std::ranges::copy(entries, p.jacobian(row).begin());
    row.regularization = kTuning.loop_regularization * mobility;
  }
}

/// Warm start with the impulse and active set of the last step; a new contact starts closed and sticking.
void ContactDynamics::warm_start(ContactRows& rows, const Contact& contact, const Mat3& frame, int index) {
  rows.open = false;
  const auto key = std::tuple(contact.shape_a, contact.shape_b, index);
  const auto of = [&](const ContactMemory::Point& point) {
    return std::tuple(point.shape_a, point.shape_b, point.index);
  };
  const std::vector<ContactMemory::Point>& points = memory_.points;
  while (warm_started_ < points.size() && of(points[warm_started_]) < key) ++warm_started_;
  if (warm_started_ == points.size() || of(points[warm_started_]) != key) return;
  const ContactMemory::Point& last = points[warm_started_];
  rows.open = last.open;
  rows.impulse[0] = frame.col(0).dot(last.impulse);
  for (std::size_t k = 0; k < rows.disc_count; ++k) {
    Disc& disc = rows.discs[k];
    const Vec3& p = disc.kind == Disc::Kind::sliding ? last.impulse : last.moment;
    const double x = frame.col(disc.size > 1 ? 1 : 0).dot(p), y = disc.size > 1 ? frame.col(2).dot(p) : 0;
    rows.impulse[disc.row] = x;
    if (disc.size > 1) rows.impulse[disc.row + 1] = y;
    const double size = std::sqrt(x * x + y * y);
    disc.tangent_stiffness = last.tangent_stiffness[static_cast<std::size_t>(disc.kind)];
    disc.slides = disc.tangent_stiffness > 0 && size > 0;
    if (!disc.slides) continue;
    disc.slip_x = disc.force_x = -x / size;
    disc.slip_y = disc.force_y = -y / size;
  }
}

void ContactDynamics::store_impulses(const ContactProblem& p, double step) {
  memory_.points.resize(collider_.contacts().size());
  std::size_t i = 0;
  for (const Touch& touch : collider_.touches()) {
    if (!has_rows(touch)) continue;
    for (int index = 0; index < touch.count; ++index, ++i) {
      Contact& contact = collider_.contacts()[touch.first + as_index(index)];
      const ContactRows& rows = p.contacts[i];
      ContactMemory::Point& point = memory_.points[i];
      point.shape_a = contact.shape_a;
      point.shape_b = contact.shape_b;
      point.index = index;
      point.open = rows.open;
      point.tangent_stiffness = {};
      point.moment = Vec3::Zero();
      Vec3 impulse(rows.impulse[0], 0, 0), moment = Vec3::Zero();
      bool turns = false;
      for (std::size_t k = 0; k < rows.disc_count; ++k) {
        const Disc& disc = rows.discs[k];
        const double* first = rows.impulse.data() + disc.row;
        point.tangent_stiffness[static_cast<std::size_t>(disc.kind)] =
            disc.slides ? disc.tangent_stiffness : 0;
        turns = turns || disc.kind != Disc::Kind::sliding;
        if (disc.kind == Disc::Kind::spinning)
          moment.x() = *first;
        else
          (disc.kind == Disc::Kind::sliding ? impulse : moment).tail<2>() << first[0], first[1];
      }
      point.impulse = frames_[i] * impulse;
      if (turns) point.moment = frames_[i] * moment;
      if (with_forces_) contact.force = point.impulse / step;
    }
  }
  memory_.points.resize(i);
}

/// What pads remember of the solution: depths at the step's end by the rates there.
void ContactDynamics::store_pads(ContactProblem& p, double step) {
  Workspace& w = workspace();
  w.s.resize(kMostRows * p.contacts.size());
  multiply_rows(p, w, p.x.data(), w.s.data());
  depths_.assign(collider_.contacts().size(), 0.0);
  std::size_t row = 0;
  for (const Touch& touch : collider_.touches()) {
    if (!has_rows(touch)) continue;
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i, ++row) {
      const ContactRows& rows = p.contacts[row];
      const double rate = rows.r0[0] + w.s[kMostRows * row];
      // What bounces parts.
      if (rows.pad) depths_[i] = rows.pad->depth - step * rate;
    }
  }
  pads_->store(collider_, step, [&](std::size_t i) { return depths_[i]; });
}

}  // namespace handsim::engine::articulated
