#include "handsim/engine/articulated/contact_dynamics.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>

#include "handsim/core/index.h"
#include "handsim/engine/contact/ode_library.h"
#include "handsim/engine/spring.h"

namespace handsim::engine::articulated {

namespace {

/// Softness of rigid contacts along the normal and across it, as a share of what their bodies' masses alone
/// would give way. It makes impulses unique where joints, stops and other contacts leave them open. Surfaces
/// not yet as deep as the layer sink to it by the first, what is held by friction creeps by the second: 0.03
/// and 3e-4 um/s under a body's weight at 1 ms.
constexpr double kNormalSoftness = 1e-5, kFrictionSoftness = 1e-6;

/// Joints can keep surfaces from sliding that their bodies' masses alone would not: a finger of milligrams on
/// a rail. Where what the joint-space inertia lets them slide comes to less than a tenth of what the masses
/// would, friction is firmer by as much, down to the second.
constexpr double kFirmBelow = 0.1, kLeastShare = 1e-4;

/// A rigid contact whose bodies are this many times as light as the scene's heaviest may carry it, as a pea
/// carries a box. Where a load presses it in faster than so much [m/s] it is made firmer, to a share of that
/// speed, in so many passes at most.
constexpr double kLightPair = 1e4, kMostYield = 0.01, kFirmShare = 0.1;
constexpr int kMostFirmer = 12;

/// Of the rows of loops, as a share of what the rates that move them give way; the gap is closed after the
/// step.
constexpr double kTieSoftness = 1e-8;

/// Makes ODE ready before anything of its is built.
const model::Model& entered(const model::Model& model) {
  enter_ode();
  return model;
}

}  // namespace

ContactDynamics::ContactDynamics(const model::Model& model, const Settings& settings, Mechanism& mechanism,
                                 Loops* loops)
    : model_(entered(model)),
      mechanism_(mechanism),
      loops_(loops),
      collider_(model, settings.effects, settings.articulated().speculative),
      crossed_(model),
      space_(mechanism),
      friction_(settings.effects.has(model::Effect::friction)),
      with_forces_(settings.contact_forces),
      erp_(settings.erp()) {
  for (const model::Body& body : model.bodies)
    if (!body.kinematic) heaviest_ = std::max(heaviest_, body.mass);
  order();
  frames_.reserve(kUsualContacts);
  light_.reserve(kUsualContacts);
  memory_.points.reserve(kUsualContacts);
  dofs_.reserve(at(space_.size()));
  signs_.reserve(at(space_.size()));
  const Topology& topology = mechanism.topology();
  for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
    if (rate_count(topology.nodes[i].kind) != 1) continue;
    const NodeView view = mechanism.view(i);
    const int dof = space_.first_dof(static_cast<int>(i));
    axes_.push_back({dof, place_[at(dof)], mechanism.axis_view(i), view.q, view.u, 0, false});
  }
}

/// Children before parents, branch by branch, trees that hang on a base before free ones: the solver's
/// matrices fill nowhere but where contacts join branches.
void ContactDynamics::order() {
  const int n = space_.size();
  place_.assign(at(n), kNoDof);
  const auto visit = [&](auto&& self, int dof) -> void {
    for (int child = dof + 1; child < n; ++child)
      if (space_.parent_dof(child) == dof) self(self, child);
    place_[at(dof)] = static_cast<int>(dof_of_.size());
    dof_of_.push_back(dof);
  };
  const Topology& topology = mechanism_.topology();
  for (const bool free : {false, true})
    for (std::size_t i = 0; i < topology.nodes.size(); ++i)
      if (!topology.nodes[i].parent && (topology.nodes[i].kind == NodeKind::free) == free)
        visit(visit, space_.first_dof(static_cast<int>(i)));
  std::vector<int> first(at(n));
  for (int i = 0; i < n; ++i) first[at(i)] = i;
  for (int dof = 0; dof < n; ++dof)
    for (int j = space_.parent_dof(dof); j != kNoDof; j = space_.parent_dof(j))
      first[at(place_[at(j)])] = std::min(first[at(place_[at(j)])], place_[at(dof)]);
  solver_.resize(first);
  S_.resize(at(n));
  for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
    std::vector<int>& carriers = carriers_.emplace_back();
    for (int dof = space_.last_dof(static_cast<int>(i)); dof != kNoDof; dof = space_.parent_dof(dof))
      carriers.push_back(place_[at(dof)]);
  }
}

template <class Archive, class T>
void ContactDynamics::carry(Archive& archive, T& point) {
  archive(point.shape_a);
  archive(point.shape_b);
  archive(point.index);
  archive(point.impulse);
  archive(point.moment);
  archive(point.open);
  for (auto& lateral : point.lateral) archive(lateral);
}

void ContactDynamics::save(ArchiveWriter& out) const {
  collider_.save(out);
  out(memory_.points.size());
  for (const ContactMemory::Point& each : memory_.points) carry(out, each);
}

void ContactDynamics::restore(ArchiveReader& in) {
  collider_.restore(in);
  memory_.points.resize(in.size());
  for (ContactMemory::Point& each : memory_.points) {
    carry(in, each);
    for (const double lateral : each.lateral)
      if (!(lateral >= 0)) in.refuse(fmt::format("a friction of {:g} over its speed", lateral), "0 or more");
  }
}

int ContactDynamics::collide(const model::State& state, const Prospect& prospect) {
  enter_ode();
  collider_.place(state);
  return collider_.collide(state, prospect);
}

/// How a body moves at a point, the bases as they do during the step.
ContactDynamics::Side ContactDynamics::side(int shape, const Vec3& position) const {
  Side out;
  out.node = node_of(shape);
  if (out.node == kNoNode) {
    const BaseMotion& base = mechanism_.base(body_of(shape));
    out.v = base.v + base.w.cross(position - base.pose.p);
    out.w = base.w;
    return out;
  }
  out.r = position - mechanism_.origin(mechanism_.topology().nodes[at(out.node)].island);
  const Spatial v = space_.velocity(out.node);
  out.w = v.head<3>();
  out.v = v.tail<3>() + out.w.cross(out.r);
  return out;
}

ContactDynamics::Giving ContactDynamics::giving_of(int shape) const {
  const model::Body& body = model_.bodies[at(body_of(shape))];
  if (body.kinematic || body.mass <= 0) return {};
  return {1 / body.mass, 3 / body.inertia.trace()};
}

/// The dofs that move one of two nodes and not the other.
void ContactDynamics::join(int node_a, int node_b) {
  dofs_.clear();
  signs_.clear();
  const std::span<const int> a = node_a == kNoNode ? std::span<const int>() : carriers_[at(node_a)];
  const std::span<const int> b = node_b == kNoNode ? std::span<const int>() : carriers_[at(node_b)];
  for (std::size_t i = 0, j = 0; i < a.size() || j < b.size();) {
    if (i < a.size() && j < b.size() && a[i] == b[j]) {
      ++i;
      ++j;
    } else if (j == b.size() || (i < a.size() && a[i] < b[j])) {
      dofs_.push_back(a[i++]);
      signs_.push_back(1);
    } else {
      dofs_.push_back(b[j++]);
      signs_.push_back(-1);
    }
  }
}

/// The contact's rows as its materials have them; the same laws as the ODE engine's.
void ContactDynamics::add_contact(const Contact& contact, const model::Material& surface, int sharing,
                                  double step) {
  // Normals that look to both sides of a finger would jam it with the friction of a true cone.
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

  const Giving gives_a = giving_of(contact.shape_a), gives_b = giving_of(contact.shape_b);
  const double giving = gives_a.shift + gives_b.shift, turning = gives_a.turn + gives_b.turn;
  const double inside = std::max(contact.depth - kSurfaceLayer, 0.0);
  double target = 0;
  if (surface.compliance) {
    const SoftRow soft =
        soft_row(surface.compliance->stiffness / sharing, surface.compliance->damping / sharing, step);
    target = soft.erp * (contact.depth < 0 ? contact.depth : inside) / step;
    rows.softness = soft.cfm / step;
  } else {
    // What is about to touch comes nearer by the gap.
    target = contact.depth < 0 ? contact.depth / step : std::min(erp_ * inside / step, kMaxCorrectingSpeed);
    rows.softness = std::max(kNormalSoftness * giving, crossed);
    if (crossed == 0 && giving * heaviest_ > kLightPair) light_.push_back(frames_.size() - 1);
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
  const auto add = [&](Disc::Kind kind, double coefficient, double gives, double share = 1) {
    Disc& disc = rows.discs[rows.disc_count++];
    disc.kind = kind;
    disc.row = row;
    disc.size = kind == Disc::Kind::spinning ? 1 : 2;
    disc.coefficient = coefficient;
    disc.softness = kFrictionSoftness * share * gives;
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
    add(Disc::Kind::sliding, friction, giving, std::clamp(across / (kFirmBelow * giving), kLeastShare, 1.0));
    rows.start[row++] = v.y();
    rows.start[row++] = v.z();
  }
  if (spinning > 0) {
    add(Disc::Kind::spinning, spinning, turning);
    add_turning(0);
  }
  if (rolling > 0) {
    add(Disc::Kind::rolling, rolling, turning);
    add_turning(1);
    add_turning(2);
  }
}

void ContactDynamics::add_contacts(double step) {
  frames_.clear();
  light_.clear();
  recalled_ = 0;
  crossed_.find(collider_);
  for (const Touch& touch : collider_.touches()) {
    const Contact& any = collider_.contacts()[touch.first];
    join(node_of(any.shape_a), node_of(any.shape_b));
    for (int index = 0; index < touch.count; ++index) {
      const Contact& contact = collider_.contacts()[touch.first + at(index)];
      add_contact(contact, touch.surface, touch.count, step);
      recall(solver_.contact(frames_.size() - 1), contact, frames_.back(), index);
    }
  }
}

/// Rows of closed loops.
void ContactDynamics::add_ties() {
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
    // A row that nothing moves.
    if (dofs_.empty()) continue;
    ContactRows& row = solver_.add(dofs_, 1);
    row.tie = true;
    row.open = false;
    row.start[0] = rates[i];
    double giving = 0;
    for (std::size_t k = 0; k < dofs_.size(); ++k) {
      solver_.jacobian(row)[k] = signs_[k];
      giving += signs_[k] * signs_[k] / solver_.inertia(dofs_[k], dofs_[k]);
    }
    row.softness = kTieSoftness * giving;
  }
}

/// Starts a contact as it was in the last step, if the pair had it; else closed and without sliding.
void ContactDynamics::recall(ContactRows& rows, const Contact& contact, const Mat3& frame, int index) {
  rows.open = false;
  const auto key = std::tuple(contact.shape_a, contact.shape_b, index);
  const auto of = [&](const ContactMemory::Point& point) {
    return std::tuple(point.shape_a, point.shape_b, point.index);
  };
  const std::vector<ContactMemory::Point>& points = memory_.points;
  while (recalled_ < points.size() && of(points[recalled_]) < key) ++recalled_;
  if (recalled_ == points.size() || of(points[recalled_]) != key) return;
  const ContactMemory::Point& last = points[recalled_];
  rows.open = last.open;
  rows.impulse[0] = frame.col(0).dot(last.impulse);
  for (std::size_t k = 0; k < rows.disc_count; ++k) {
    Disc& disc = rows.discs[k];
    const Vec3 p = frame.transpose() * (disc.kind == Disc::Kind::sliding ? last.impulse : last.moment);
    const double x = disc.size > 1 ? p.y() : p.x(), y = disc.size > 1 ? p.z() : 0;
    rows.impulse[disc.row] = x;
    if (disc.size > 1) rows.impulse[disc.row + 1] = y;
    const double size = std::sqrt(x * x + y * y);
    disc.lateral = last.lateral[static_cast<std::size_t>(disc.kind)];
    disc.slides = disc.lateral > 0 && size > 0;
    if (!disc.slides) continue;
    disc.x = disc.px = -x / size;
    disc.y = disc.py = -y / size;
  }
}

void ContactDynamics::memorise(double step) {
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
        point.lateral[static_cast<std::size_t>(disc.kind)] = disc.slides ? disc.lateral : 0;
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

/// The step without contacts and stops, as what drives the solver's equation, and the inertia.
void ContactDynamics::find_free(double step) {
  const Kernel& kernel = mechanism_.kernel();
  kernel.prepare(mechanism_.tree(), step);
  kernel.solve(mechanism_.tree());
  space_.find_inertia();
  solver_.begin();
  const int n = space_.size();
  const std::span<const double> du = mechanism_.du();
  for (int dof = 0; dof < n; ++dof) {
    S_[at(place_[at(dof)])] = space_.axis(dof);
    for (int j = dof; j != kNoDof; j = space_.parent_dof(j))
      solver_.inertia(place_[at(dof)], place_[at(j)]) = space_.inertia(dof, j);
  }
  for (const Coordinate& each : axes_) solver_.inertia(each.place, each.place) += *each.axis.weight;
  // g = A x of the free step.
  const std::span<double> g = solver_.drive();
  for (int dof = 0; dof < n; ++dof) {
    const int i = place_[at(dof)];
    const double change = step * du[space_.rate_index(dof)];
    g[at(i)] += solver_.inertia(i, i) * change;
    for (int j = space_.parent_dof(dof); j != kNoDof; j = space_.parent_dof(j)) {
      const int k = place_[at(j)];
      g[at(k)] += solver_.inertia(i, k) * change;
      g[at(i)] += solver_.inertia(i, k) * step * du[space_.rate_index(j)];
    }
  }
}

/// Servos with their limits, and stops as bounds of the rates. What the free step had of the servos goes.
void ContactDynamics::bound_axes(double step) {
  for (Coordinate& each : axes_) {
    const AxisView& a = each.axis;
    const double u = *each.u, q = *each.q;
    each.bounced = false;
    if (*a.servo_limit > 0) {
      const double slope = step * *a.servo_stiffness + *a.servo_damping;
      const double pull = step * (*a.servo_stiffness * *a.servo_error + *a.servo_feed - slope * u);
      const double limit = step * *a.servo_limit;
      solver_.servo(each.place, pull, step * slope, limit, *a.saturated);
      double& g = solver_.drive()[at(each.place)];
      if (*a.saturated == 0) {
        g -= pull;
        solver_.inertia(each.place, each.place) -= step * slope;
      } else {
        g -= *a.saturated * limit;
      }
    }
    if (*a.low == -HUGE_VAL && *a.high == HUGE_VAL) continue;
    // As the kernels aim at stops without contact.
    const auto target = [&](double room) { return (room < 0 ? erp_ * room : room) / step; };
    solver_.bound(each.place, -target(q - *a.low) - u, target(*a.high - q) - u, each.side);
  }
}

/// Stops that are hit and bounce: true where one has to.
bool ContactDynamics::bounce() {
  bool any = false;
  for (Coordinate& each : axes_) {
    const double side = solver_.side(each.place), speed = side * *each.u;
    if (each.bounced || side == 0 || !(speed > 0) || !(*each.axis.bounce > 0)) continue;
    // From landing on the stop to leaving it, along the way out.
    const double now = side * solver_.x()[at(each.place)] + speed, bounced = -*each.axis.bounce * speed;
    if (!(bounced < now)) continue;
    each.bounced = any = true;
    const double x = side * (bounced - speed);
    if (side < 0)
      solver_.bound(each.place, x, HUGE_VAL, side);
    else
      solver_.bound(each.place, -HUGE_VAL, x, side);
  }
  return any;
}

/// Makes contacts of light pairs firmer that give way too fast: true where one does.
bool ContactDynamics::stiffen() {
  bool any = false;
  for (const std::size_t i : light_) {
    ContactRows& rows = solver_.contact(i);
    const double yield = rows.softness * rows.impulse[0];
    if (!(yield > kMostYield)) continue;
    const double share = kFirmShare * kMostYield / yield;
    rows.softness *= share;
    for (std::size_t k = 0; k < rows.disc_count; ++k) rows.discs[k].softness *= share;
    any = true;
  }
  return any;
}

NewtonReport ContactDynamics::solve(double step) {
  // Stops are bounds here, and not locks.
  for (Coordinate& each : axes_) {
    each.side = *each.axis.side;
    *each.axis.side = 0;
  }
  find_free(step);
  bound_axes(step);
  add_contacts(step);
  add_ties();
  NewtonReport report = solver_.solve(kContactTolerance * step);
  int firmer = 0;
  while (bounce() || (firmer < kMostFirmer && stiffen() && ++firmer > 0)) {
    const NewtonReport again = solver_.solve(kContactTolerance * step);
    report = {report.iterations + again.iterations, report.limit_updates + again.limit_updates,
              again.residual, again.solved, again.iterative};
  }
  const std::span<double> du = mechanism_.du();
  for (int dof = 0; dof < space_.size(); ++dof)
    du[space_.rate_index(dof)] = solver_.x()[at(place_[at(dof)])] / step;
  for (const Coordinate& each : axes_) {
    *each.axis.side = solver_.side(each.place);
    *each.axis.saturated = solver_.saturated(each.place);
  }
  memorise(step);
  return report;
}

}  // namespace handsim::engine::articulated
