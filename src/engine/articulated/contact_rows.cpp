// Rows of the contact solver: contacts with their materials, loops, and the warm start from the last step.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact_dynamics.h"
#include "handsim/engine/spring.h"

namespace handsim::engine::articulated {

namespace {

/// Regularisation R of rigid contacts along the normal and across it, as a share of the inverse masses of the
/// two bodies (Todorov 2014 scales R in the same way). It makes impulses unique where joints, stops and other
/// contacts leave them undetermined. Chosen as small as rounding allows: what friction holds creeps by
/// 3e-4 um/s under a body's weight at 1 ms, and surfaces sink to the contact layer by 0.03 um/s.
constexpr double kNormalRegularization = 1e-5, kFrictionRegularization = 1e-6;

/// Joints can make two bodies harder to slide than their masses say: a finger of milligrams on a rail. Where
/// the joint-space inertia lets them slide by less than kFirmBelow of what the masses do, R_t is reduced in
/// proportion, down to kLeastShare. Both are chosen.
constexpr double kFirmBelow = 0.1, kLeastShare = 1e-4;

/// A rigid contact whose bodies are this many times as light as the scene's heaviest may have to carry it, as
/// a pea carries a box.
constexpr double kLightPair = 1e4;

/// Regularisation of the rows of loops, as a share of the inverse inertia along them. What it lets open is
/// closed after the step.
constexpr double kBilateralRegularization = 1e-8;

}  // namespace

/// A contact's rows by its materials; the same laws as the ODE engine's.
void ContactDynamics::add_contact(const Contact& contact, const model::Material& surface, double share,
                                  double step) {
  // Normals on both sides of a finger would jam it with the friction of a circular cone.
  const double crossed = surface.compliance ? 0 : crossed_.giving(contact);
  const double friction = friction_ && crossed == 0 ? surface.friction : 0;
  const double spinning = friction_ ? surface.spinning_friction : 0;
  const double rolling = friction_ ? surface.rolling_friction : 0;
  ContactRows& rows =
      solver_.add(dofs_, 1U + (friction > 0 ? 2U : 0U) + (spinning > 0 ? 1U : 0U) + (rolling > 0 ? 2U : 0U));
  Mat3& frame = frames_.emplace_back();
  frame.col(0) = contact.normal;
  frame.col(1) = contact.normal.unitOrthogonal();
  frame.col(2) = contact.normal.cross(frame.col(1));

  const Mobility mobility_a = mobility_of(contact.shape_a), mobility_b = mobility_of(contact.shape_b);
  const double mobility = mobility_a.linear + mobility_b.linear,
               angular = mobility_a.angular + mobility_b.angular;
  const double inside = std::max(contact.depth - kSurfaceLayer, 0.0);
  double target = 0;
  if (surface.compliance) {
    const SoftRow spring =
        soft_row(share * surface.compliance->stiffness, share * surface.compliance->damping, step);
    target = spring.erp * (contact.depth < 0 ? contact.depth : inside) / step;
    rows.regularization = spring.cfm / step;
  } else {
    // A gap may close within the step.
    target = contact.depth < 0 ? contact.depth / step : std::min(erp_ * inside / step, kMaxCorrectingSpeed);
    rows.regularization = std::max(kNormalRegularization * mobility, crossed);
    if (crossed == 0 && mobility * heaviest_ > kLightPair) light_.push_back(frames_.size() - 1);
  }
  const Side a = side(contact.shape_a, contact.position), b = side(contact.shape_b, contact.position);
  const Vec3 v = frame.transpose() * (a.v - b.v), w = frame.transpose() * (a.w - b.w);
  if (surface.restitution > 0 && -v.x() > surface.restitution_speed)
    target = std::max(target, surface.restitution * -v.x());

  const std::span<double> J = solver_.jacobian(rows);
  const std::size_t m = dofs_.size();
  for (std::size_t k = 0; k < m; ++k) {
    const Spatial& S = S_[at(dofs_[k])];
    const Vec3 along = signs_[k] * (S.tail<3>() + S.head<3>().cross(signs_[k] > 0 ? a.r : b.r));
    J[k] = frame.col(0).dot(along);
    if (!(friction > 0)) continue;
    J[m + k] = frame.col(1).dot(along);
    J[2 * m + k] = frame.col(2).dot(along);
  }
  rows.start[0] = v.x() - target;
  std::size_t row = 1;
  const auto add = [&](Disc::Kind kind, double coefficient, double alone, double firm = 1) {
    Disc& disc = rows.discs[rows.disc_count++];
    disc.kind = kind;
    disc.row = row;
    disc.size = kind == Disc::Kind::spinning ? 1 : 2;
    disc.coefficient = coefficient;
    disc.regularization = kFrictionRegularization * firm * alone;
  };
  const auto add_turning = [&](int axis) {
    rows.start[row] = w[axis];
    for (std::size_t k = 0; k < m; ++k)
      J[row * m + k] = signs_[k] * frame.col(axis).dot(S_[at(dofs_[k])].head<3>());
    ++row;
  };
  if (friction > 0) {
    double across = 0;
    for (std::size_t k = 0; k < m; ++k)
      across += (J[m + k] * J[m + k] + J[2 * m + k] * J[2 * m + k]) / solver_.inertia(dofs_[k], dofs_[k]);
    add(Disc::Kind::sliding, friction, mobility,
        std::clamp(across / (kFirmBelow * mobility), kLeastShare, 1.0));
    rows.start[row++] = v.y();
    rows.start[row++] = v.z();
  }
  if (spinning > 0) {
    add(Disc::Kind::spinning, spinning, angular);
    add_turning(0);
  }
  if (rolling > 0) {
    add(Disc::Kind::rolling, rolling, angular);
    add_turning(1);
    add_turning(2);
  }
}

void ContactDynamics::add_contacts(double step) {
  frames_.clear();
  light_.clear();
  warm_started_ = 0;
  crossed_.find(collider_);
  for (const Touch& touch : collider_.touches()) {
    const Contact& any = collider_.contacts()[touch.first];
    find_moving_dofs(node_of(any.shape_a), node_of(any.shape_b));
    for (int index = 0; index < touch.count; ++index) {
      const std::size_t i = touch.first + at(index);
      const Contact& contact = collider_.contacts()[i];
      add_contact(contact, touch.surface, collider_.shares()[i], step);
      warm_start(solver_.contact(frames_.size() - 1), contact, frames_.back(), index);
    }
  }
}

/// Rows of closed loops.
void ContactDynamics::add_loop_rows() {
  if (!loops_) return;
  const std::size_t n = at(space_.size());
  const std::span<const double> rates = loops_->rates(), J = loops_->jacobian();
  for (std::size_t i = 0; i < rates.size(); ++i) {
    dofs_.clear();
    signs_.clear();
    for (int place = 0; place < space_.size(); ++place) {
      const double entry = J[i * n + at(dof_of_[at(place)])];
      if (entry == 0) continue;
      dofs_.push_back(place);
      signs_.push_back(entry);
    }
    // No rate changes this row.
    if (dofs_.empty()) continue;
    ContactRows& row = solver_.add(dofs_, 1);
    row.bilateral = true;
    row.open = false;
    row.start[0] = rates[i];
    double mobility = 0;
    for (std::size_t k = 0; k < dofs_.size(); ++k) {
      solver_.jacobian(row)[k] = signs_[k];
      mobility += signs_[k] * signs_[k] / solver_.inertia(dofs_[k], dofs_[k]);
    }
    row.regularization = kBilateralRegularization * mobility;
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
    const Vec3 p = frame.transpose() * (disc.kind == Disc::Kind::sliding ? last.impulse : last.moment);
    const double x = disc.size > 1 ? p.y() : p.x(), y = disc.size > 1 ? p.z() : 0;
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

void ContactDynamics::store_warm_start(double step) {
  memory_.points.clear();
  std::size_t i = 0;
  for (const Touch& touch : collider_.touches())
    for (int index = 0; index < touch.count; ++index, ++i) {
      Contact& contact = collider_.contacts()[touch.first + at(index)];
      const ContactRows& rows = solver_.contacts()[i];
      ContactMemory::Point& point = memory_.points.emplace_back();
      point.shape_a = contact.shape_a;
      point.shape_b = contact.shape_b;
      point.index = index;
      point.open = rows.open;
      Vec3 impulse(rows.impulse[0], 0, 0), moment = Vec3::Zero();
      for (std::size_t k = 0; k < rows.disc_count; ++k) {
        const Disc& disc = rows.discs[k];
        const double* p = rows.impulse.data() + disc.row;
        point.tangent_stiffness[static_cast<std::size_t>(disc.kind)] =
            disc.slides ? disc.tangent_stiffness : 0;
        if (disc.kind == Disc::Kind::spinning)
          moment.x() = p[0];
        else
          (disc.kind == Disc::Kind::sliding ? impulse : moment).tail<2>() << p[0], p[1];
      }
      point.impulse = frames_[i] * impulse;
      point.moment = frames_[i] * moment;
      if (with_forces_) contact.force = point.impulse / step;
    }
}

}  // namespace handsim::engine::articulated
