#include "handsim/engine/articulated/contact_dynamics.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "handsim/engine/ode/contacts.h"
#include "handsim/engine/ode/handlers.h"
#include "handsim/engine/ode/spring.h"

namespace handsim::engine::articulated {

namespace {

/// Corrections of torque limits all at once, before they are made one by one, and how many of these.
constexpr int kJointCorrections = 8, kSingleCorrections = 50;
/// As the kernels have them for steps without contact.
constexpr double kTight = 1 - 1e-9, kLoose = 1 + 1e-9, kTouch = 1e-12;

/// Softness of rigid contacts, as a share of what their bodies' masses alone would give way: bounds the
/// impulse where joints and stops leave no way out. More of it makes fewer sweeps do, but surfaces not yet as
/// deep as the layer then sink to it: 0.03 um/s under a body's weight at 1 ms.
constexpr double kRigidSoftness = 1e-5;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

using Row = Eigen::Map<Eigen::VectorXd>;
using ConstRow = Eigen::Map<const Eigen::VectorXd>;

/// Makes ODE ready before anything of its is built.
const model::Model& entered(const model::Model& model) {
  ode::enter_ode();
  return model;
}

}  // namespace

ContactDynamics::ContactDynamics(const model::Model& model, const Settings& settings, Mechanism& mechanism)
    : model_(entered(model)),
      mechanism_(mechanism),
      collider_(model, ode::immovable_bodies(model, settings.effects)),
      space_(mechanism),
      friction_(settings.effects.has(model::Effect::friction)),
      with_forces_(settings.contact_forces),
      erp_(settings.erp) {
  const Topology& topology = mechanism.topology();
  for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
    if (rate_count(topology.nodes[i].kind) != 1) continue;
    const NodeView view = mechanism.view(i);
    axes_.push_back({space_.first_dof(static_cast<int>(i)), mechanism.axis_view(i), view.q, view.u, 0, 0});
  }
  free_.resize(at(space_.size()));
  x_.resize(at(space_.size()));
  stops_.reserve(axes_.size());
}

template <class Archive, class T>
void ContactDynamics::carry(Archive& archive, T& remembered) {
  archive(remembered.shape_a);
  archive(remembered.shape_b);
  archive(remembered.index);
  archive(remembered.impulse);
  archive(remembered.moment);
}

void ContactDynamics::save(ArchiveWriter& out) const {
  collider_.save(out);
  out(last_.size());
  for (const Remembered& each : last_) carry(out, each);
}

void ContactDynamics::restore(ArchiveReader& in) {
  collider_.restore(in);
  last_.resize(in.size());
  for (Remembered& each : last_) carry(in, each);
}

int ContactDynamics::collide(const model::State& state) {
  ode::enter_ode();
  collider_.place(state);
  return collider_.collide(state);
}

/// Velocity of a against b at the contact, the bases as they move during the step.
Vec3 ContactDynamics::relative_velocity(const Contact& contact) const {
  const auto of = [&](int shape) -> Vec3 {
    const int body = body_of(shape);
    const int node = mechanism_.topology().node_of_body[at(body)];
    if (node == kNoNode) {
      const BaseMotion& base = mechanism_.base(body);
      return base.v + base.w.cross(contact.position - base.pose.p);
    }
    const Vec3 r = contact.position - mechanism_.origin(mechanism_.topology().nodes[at(node)].island);
    const Spatial v = space_.velocity(node);
    return v.tail<3>() + v.head<3>().cross(r);
  };
  return of(contact.shape_a) - of(contact.shape_b);
}

Vec3 ContactDynamics::relative_spin(const Contact& contact) const {
  const auto of = [&](int shape) -> Vec3 {
    const int body = body_of(shape);
    const int node = mechanism_.topology().node_of_body[at(body)];
    return node == kNoNode ? mechanism_.base(body).w : Vec3(space_.velocity(node).head<3>());
  };
  return of(contact.shape_a) - of(contact.shape_b);
}

double ContactDynamics::inverse_mass(int shape) const {
  const model::Body& body = model_.bodies[at(body_of(shape))];
  return body.kinematic || body.mass <= 0 ? 0 : 1 / body.mass;
}

/// The contacts' rows as their materials have them; the same laws as the ODE engine's.
void ContactDynamics::find_points(double step) {
  points_.clear();
  std::size_t row = 0;
  for (const ode::Touch& touch : collider_.touches()) {
    const model::Material& surface = touch.surface;
    for (std::size_t i = touch.first; i < touch.first + at(touch.count); ++i) {
      const Contact& contact = collider_.contacts()[i];
      Point point;
      point.cone.row = row;
      point.cone.friction = friction_ ? surface.friction : 0;
      point.cone.spinning = friction_ ? surface.spinning_friction : 0;
      point.cone.rolling = friction_ ? surface.rolling_friction : 0;
      row += row_count(point.cone);
      point.frame.col(0) = contact.normal;
      point.frame.col(1) = contact.normal.unitOrthogonal();
      point.frame.col(2) = contact.normal.cross(point.frame.col(1));
      const double inside = std::max(contact.depth - ode::kSurfaceLayer, 0.0);
      if (surface.compliance) {
        const ode::SoftRow soft = ode::soft_row(surface.compliance->stiffness / touch.count,
                                                surface.compliance->damping / touch.count, step);
        point.target = soft.erp * inside / step;
        point.softness = soft.cfm / step;
      } else {
        point.target = std::min(erp_ * inside / step, ode::kMaxCorrectingSpeed);
        point.softness = kRigidSoftness * (inverse_mass(contact.shape_a) + inverse_mass(contact.shape_b));
      }
      const double approach = -contact.normal.dot(relative_velocity(contact));
      if (surface.restitution > 0 && approach > surface.restitution_speed)
        point.target = std::max(point.target, surface.restitution * approach);
      points_.push_back(point);
    }
  }
}

/// Starts a contact at the impulses that it had, if the pair had it.
void ContactDynamics::recall(std::size_t contact, int index, std::size_t& from) {
  const Contact& now = collider_.contacts()[contact];
  const auto key = std::tuple(now.shape_a, now.shape_b, index);
  const auto of = [&](std::size_t i) {
    return std::tuple(last_[i].shape_a, last_[i].shape_b, last_[i].index);
  };
  while (from < last_.size() && of(from) < key) ++from;
  if (from == last_.size() || of(from) != key) return;
  const Point& point = points_[contact];
  const Vec3 impulse = point.frame.transpose() * last_[from].impulse;
  const Vec3 moment = point.frame.transpose() * last_[from].moment;
  double* p = start_.data() + point.cone.row;
  *p++ = std::max(impulse.x(), 0.0);
  if (point.cone.friction > 0) {
    *p++ = impulse.y();
    *p++ = impulse.z();
  }
  if (point.cone.spinning > 0) *p++ = moment.x();
  if (point.cone.rolling > 0) {
    *p++ = moment.y();
    *p++ = moment.z();
  }
}

void ContactDynamics::remember(double step) {
  last_.clear();
  for (const ode::Touch& touch : collider_.touches())
    for (int index = 0; index < touch.count; ++index) {
      const std::size_t i = touch.first + at(index);
      const Point& point = points_[i];
      Contact& contact = collider_.contacts()[i];
      const double* p = solver_.p().data() + point.cone.row;
      Vec3 impulse(*p++, 0, 0), moment = Vec3::Zero();
      if (point.cone.friction > 0) {
        impulse.y() = *p++;
        impulse.z() = *p++;
      }
      if (point.cone.spinning > 0) moment.x() = *p++;
      if (point.cone.rolling > 0) {
        moment.y() = *p++;
        moment.z() = *p++;
      }
      last_.push_back({contact.shape_a, contact.shape_b, index, point.frame * impulse, point.frame * moment});
      if (with_forces_) contact.force = last_.back().impulse / step;
    }
}

/// The step without contacts and stops, and the inertia that goes with it.
void ContactDynamics::find_free(double step) {
  const Kernel& kernel = mechanism_.kernel();
  kernel.prepare(mechanism_.tree(), step);
  kernel.solve(mechanism_.tree());
  const std::span<const double> du = mechanism_.du();
  for (int dof = 0; dof < space_.size(); ++dof) free_[at(dof)] = du[space_.rate_index(dof)];
  space_.find_inertia();
  for (const Coordinate& each : axes_) space_.add_to_diagonal(each.dof, *each.axis.weight);
  space_.factor();
}

void ContactDynamics::add_row(const Contact& contact, const Vec3& direction, bool angular, std::size_t row) {
  const std::size_t n = at(space_.size());
  const std::span<double> out(J_.data() + row * n, n);
  const auto add = [&](int shape, double sign) {
    const int node = mechanism_.topology().node_of_body[at(body_of(shape))];
    if (node == kNoNode) return;
    const Vec3 r = contact.position - mechanism_.origin(mechanism_.topology().nodes[at(node)].island);
    Spatial wrench;
    if (angular)
      wrench << direction, Vec3::Zero();
    else
      wrench << r.cross(direction), direction;
    space_.add_row(node, wrench, sign, out);
  };
  add(contact.shape_a, 1);
  add(contact.shape_b, -1);
}

/// W and b of the contacts and of the stops among the rows.
void ContactDynamics::build(double step) {
  const std::size_t n = at(space_.size());
  cones_.clear();
  std::size_t rows = 0;
  for (const Point& point : points_) {
    cones_.push_back(point.cone);
    rows = point.cone.row + row_count(point.cone);
  }
  const std::size_t contact_rows = rows;
  for (std::size_t i = 0; i < stops_.size(); ++i) cones_.push_back({rows++, 0, 0, 0});
  solver_.reset(rows);
  const std::span<double> b = solver_.b();
  J_.assign(rows * n, 0.0);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& point = points_[i];
    const Contact& contact = collider_.contacts()[i];
    const Vec3 v = point.frame.transpose() * relative_velocity(contact);
    std::size_t row = point.cone.row;
    const auto add = [&](int axis, bool angular, double now) {
      add_row(contact, point.frame.col(axis), angular, row);
      b[row++] = now;
    };
    add(0, false, v.x() - point.target);
    if (point.cone.friction > 0) {
      add(1, false, v.y());
      add(2, false, v.z());
    }
    if (!(point.cone.spinning > 0 || point.cone.rolling > 0)) continue;
    const Vec3 w = point.frame.transpose() * relative_spin(contact);
    if (point.cone.spinning > 0) add(0, true, w.x());
    if (point.cone.rolling > 0) {
      add(1, true, w.y());
      add(2, true, w.z());
    }
  }
  for (std::size_t i = 0; i < stops_.size(); ++i) {
    const Coordinate& each = axes_[stops_[i].axis];
    J_[(contact_rows + i) * n + at(each.dof)] = -stops_[i].side;
    b[contact_rows + i] = stops_[i].target - stops_[i].side * *each.u;
    solver_.p()[contact_rows + i] = each.held;
  }
  std::copy(start_.begin(), start_.end(), solver_.p().begin());
  const ConstRow free(free_.data(), static_cast<Eigen::Index>(n));
  Y_ = J_;
  for (std::size_t i = 0; i < rows; ++i) {
    b[i] += step * ConstRow(J_.data() + i * n, static_cast<Eigen::Index>(n)).dot(free);
    space_.solve_transposed({Y_.data() + i * n, n});
    const ConstRow y(Y_.data() + i * n, static_cast<Eigen::Index>(n));
    for (std::size_t j = 0; j <= i; ++j)
      solver_.entry(i, j) = solver_.entry(j, i) =
          y.dot(ConstRow(Y_.data() + j * n, static_cast<Eigen::Index>(n)));
  }
  for (const Point& point : points_) solver_.entry(point.cone.row, point.cone.row) += point.softness;
}

bool ContactDynamics::apply(double step) {
  const std::size_t n = at(space_.size()), rows = solver_.rows();
  Row x(x_.data(), static_cast<Eigen::Index>(n));
  x.setZero();
  for (std::size_t i = 0; i < rows; ++i)
    if (solver_.p()[i] != 0) x += solver_.p()[i] * ConstRow(Y_.data() + i * n, static_cast<Eigen::Index>(n));
  space_.solve_factor(x_);
  const std::span<double> du = mechanism_.du();
  for (int dof = 0; dof < space_.size(); ++dof)
    du[space_.rate_index(dof)] = free_[at(dof)] + x_[at(dof)] / step;
  bool sound = true;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    Coordinate& each = axes_[i];
    if (each.row_side != 0) continue;
    const double u = *each.u, end = *each.q + step * (u + step * du[space_.rate_index(each.dof)]);
    if (end < *each.axis.low - kTouch)
      each.row_side = -1;
    else if (end > *each.axis.high + kTouch)
      each.row_side = 1;
    else
      continue;
    sound = false;
    // As the kernels aim at stops without contact.
    const double room = each.row_side < 0 ? *each.q - *each.axis.low : *each.axis.high - *each.q;
    const double speed = each.row_side * u, bounced = -*each.axis.bounce * speed;
    StopRow stop{i, each.row_side, (room < 0 ? erp_ * room : room) / step};
    if (speed > 0 && *each.axis.bounce > 0) stop.target = std::min(stop.target, bounced);
    stops_.push_back(stop);
    each.held = 0;
  }
  return sound;
}

/// As the kernels do it for steps without contact.
bool ContactDynamics::revise_limits(double step, bool only_first) {
  const std::span<const double> du = mechanism_.du();
  bool sound = true;
  for (Coordinate& each : axes_) {
    const AxisView& a = each.axis;
    const double u = *each.u + step * du[space_.rate_index(each.dof)];
    const double pull =
        *a.servo_stiffness * (*a.servo_error - step * u) - *a.servo_damping * u + *a.servo_feed;
    const double bound = *a.servo_limit * (*a.saturated != 0 ? kTight : kLoose);
    const double now = pull > bound ? 1 : (pull < -bound ? -1 : 0);
    if (now == *a.saturated) continue;
    *a.saturated = now;
    sound = false;
    if (only_first) return false;
  }
  return sound;
}

ConeReport ContactDynamics::solve(double step) {
  find_points(step);
  const std::size_t rows = points_.empty() ? 0 : points_.back().cone.row + row_count(points_.back().cone);
  start_.assign(rows, 0.0);
  std::size_t from = 0;
  for (const ode::Touch& touch : collider_.touches())
    for (int index = 0; index < touch.count; ++index) recall(touch.first + at(index), index, from);
  // Stops are rows here, and not locks.
  stops_.clear();
  for (Coordinate& each : axes_) *each.axis.side = each.row_side = 0;
  ConeReport report;
  const auto keep = [&](const ConeReport& one) {
    report.sweeps += one.sweeps;
    report.residual = one.residual;
    report.solved = one.solved;
  };
  for (int i = 0; i < kJointCorrections + kSingleCorrections; ++i) {
    find_free(step);
    do {
      build(step);
      keep(solver_.solve(cones_, kContactTolerance * step, kMostSweeps));
      std::copy_n(solver_.p().begin(), rows, start_.begin());
      for (std::size_t k = 0; k < stops_.size(); ++k) axes_[stops_[k].axis].held = solver_.p()[rows + k];
    } while (!apply(step));
    if (revise_limits(step, i >= kJointCorrections)) {
      for (const StopRow& stop : stops_)
        if (axes_[stop.axis].held > 0) *axes_[stop.axis].axis.side = stop.side;
      remember(step);
      return report;
    }
  }
  remember(step);
  report.solved = false;
  return report;
}

}  // namespace handsim::engine::articulated
