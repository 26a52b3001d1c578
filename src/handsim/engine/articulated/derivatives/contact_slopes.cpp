#include "handsim/engine/articulated/derivatives/contact_slopes.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/engine/spring.h"

namespace handsim::engine::articulated {

namespace {

constexpr int kRefinements = 12;
/// Newton steps that only rounding leaves: where they are below the first, or do not shrink below the second
/// [rad/s or m/s].
constexpr double kRefined = 1e-16, kAccepted = 1e-10;
constexpr double kNear = 1e-8;  ///< After larger steps the next has a factor of its own.
/// A contact that carries less of the largest impulse is about to open; one that gives way slower [m/s] and
/// carries none is about to close; friction this near to its limit is about to stick or slide.
constexpr double kLeastImpulse = 1e-6, kLeastSpeed = 1e-8, kLimitMargin = 1e-6;

/// A wrench about a point, as it is about another one that r leads away from.
Spatial shifted(Spatial wrench, const Vec3& r) {
  wrench.head<3>() += r.cross(Vec3(wrench.tail<3>()));
  return wrench;
}

/// Moment and force of impulses in a contact's frame, there.
Spatial wrench_of(const ContactRows& rows, const double* p, const Mat3& E) {
  Spatial out;
  out << Vec3::Zero(), p[0] * E.col(0);
  for (std::size_t k = 0; k < rows.disc_count; ++k) {
    const Disc& disc = rows.discs[k];
    const double* own = p + disc.row;
    if (disc.kind == Disc::Kind::spinning)
      out.head<3>() += own[0] * E.col(0);
    else
      out.segment<3>(disc.kind == Disc::Kind::sliding ? 3 : 0) += own[0] * E.col(1) + own[1] * E.col(2);
  }
  return out;
}

}  // namespace

ContactSlopes::ContactSlopes(const model::Model& model, Mechanism& mechanism, ContactDynamics& contact,
                             const DynamicsSlopes& tree)
    : model_(model), mechanism_(mechanism), contact_(contact), tree_(tree) {}

ContactSlopes::Law6 ContactSlopes::law_of(const ContactRows& rows) {
  Law6 D = Law6::Zero();
  if (rows.open) return D;
  D(0, 0) = 1 / rows.regularization;
  for (std::size_t k = 0; k < rows.disc_count; ++k) {
    const Disc& disc = rows.discs[k];
    const auto first = static_cast<Eigen::Index>(disc.row), size = static_cast<Eigen::Index>(disc.size);
    const double slip[] = {disc.slip_x, disc.slip_y};
    for (Eigen::Index i = 0; i < size; ++i) {
      if (!disc.slides) {
        D(first + i, first + i) = 1 / disc.regularization;
        continue;
      }
      D(first + i, 0) = -disc.coefficient * slip[i] * D(0, 0);
      for (Eigen::Index j = 0; j < size && size > 1; ++j)
        D(first + i, first + j) = disc.tangent_stiffness * ((i == j ? 1 : 0) - slip[i] * slip[j]);
    }
  }
  return D;
}

void ContactSlopes::add_stiffness(Eigen::MatrixXd& K) {
  Workspace& w = ContactDynamics::workspace();
  ContactProblem& p = w.problem;
  p.compute_jacobians(w.kernel);
  for (const ContactRows& rows : p.contacts) {
    if (rows.open) continue;
    const auto size = static_cast<Eigen::Index>(rows.rows), width = static_cast<Eigen::Index>(rows.dof_count);
    const double* J = p.entries_of(rows);
    const Law6 law = law_of(rows);
    const std::span<const int> dofs = p.dofs_of(rows);
    for (Eigen::Index j = 0; j < width; ++j) {
      std::array<double, kMostRows> DJ{};
      for (Eigen::Index a = 0; a < size; ++a)
        for (Eigen::Index b = 0; b < size; ++b) DJ[as_index(a)] += law(a, b) * J[b * width + j];
      double* column = &K(0, contact_.dof_of_[as_index(dofs[as_index(j)])]);
      for (Eigen::Index i = 0; i < width; ++i) {
        double sum = 0;
        for (Eigen::Index a = 0; a < size; ++a) sum += J[a * width + i] * DJ[as_index(a)];
        column[contact_.dof_of_[as_index(dofs[as_index(i)])]] += sum;
      }
    }
  }
}

/// The factor of K at x, without what bounds hold.
void ContactSlopes::factor(const Eigen::MatrixXd& inertia) {
  const ContactProblem& p = ContactDynamics::workspace().problem;
  K_ = inertia;
  add_stiffness(K_);
  Eigen::MatrixXd K = K_(contact_.dof_of_, contact_.dof_of_);
  for (Eigen::Index k = 0; k < K.rows(); ++k) {
    const Limits& servo = p.limits[as_index(k)];
    if (servo.limit > 0 && servo.saturated == LimitSide::within) K(k, k) += servo.slope;
    if (p.limits[as_index(k)].side == LimitSide::within) continue;
    K.row(k).setZero();
    K.col(k).setZero();
    K(k, k) = 1;
  }
  factor_.compute(K);
}

bool ContactSlopes::refine(const Eigen::MatrixXd& inertia, double step) {
  Workspace& w = ContactDynamics::workspace();
  ContactProblem& p = w.problem;
  w.resize(p);
  Eigen::VectorXd d(p.size());
  double last = 0;
  bool done = false;
  for (int i = 0; i < kRefinements && !done; ++i) {
    evaluate(p, w, Law::coulomb);
    // Near the solution one factor serves for all steps.
    for (Eigen::Index k = 0; k < d.size(); ++k)
      d[k] = p.limits[as_index(k)].side == LimitSide::within ? -w.F[as_index(k)] : 0;
    if (i == 0 || last > kNear) factor(inertia);
    d = factor_.solve(d);
    const double change = d.lpNorm<Eigen::Infinity>();
    if (!std::isfinite(change)) return false;
    // Rounding does not get smaller from step to step.
    done = change <= kRefined || (i > 0 && change <= kAccepted && change >= 0.5 * last);
    last = change;
    for (Eigen::Index k = 0; k < d.size(); ++k) p.x[as_index(k)] += d[k];
  }
  evaluate(p, w, Law::coulomb);
  contact_.store_solution(p, step);
  return done;
}

void ContactSlopes::compute_velocities() {
  Workspace& w = ContactDynamics::workspace();
  end_.assign(mechanism_.views().size(), Spatial::Zero());
  std::vector<double> x(as_index(tree_.size()), 0.0);
  for (std::size_t i = 0; i < contact_.dof_of_.size(); ++i) x[as_index(contact_.dof_of_[i])] = w.problem.x[i];
  for (int i = 0; i < static_cast<int>(end_.size()); ++i) {
    if (tree_.parent_node(i) != kNoNode) end_[as_index(i)] = end_[as_index(tree_.parent_node(i))];
    for (int dof = tree_.first_dof(i); dof <= tree_.last_dof(i); ++dof)
      end_[as_index(i)] += x[as_index(dof)] * tree_.axis(dof);
  }
  for (std::size_t i = 0; i < end_.size(); ++i) end_[i] += read6(mechanism_.view(i).v, mechanism_.stride());
}

ContactSlopes::Partner ContactSlopes::partner_of(int shape) const {
  Partner out;
  out.node = contact_.node_of(shape);
  const ContactDynamics::BodyVelocity motion = contact_.velocity_of(shape);
  out.origin = motion.origin;
  out.start << motion.w, motion.v;
  out.end = out.node == kNoNode ? out.start : end_[as_index(out.node)];
  return out;
}

void ContactSlopes::begin_pair(int shape_a, int shape_b) {
  a_ = partner_of(shape_a);
  b_ = partner_of(shape_b);
  columns_.clear();
  total_.setZero();
  bounces_ = false;
  const auto add = [&](int node, bool Column::*which) {
    if (node == kNoNode) return;
    for (int dof = tree_.last_dof(node); dof != kNoDof; dof = tree_.parent_dof(dof)) {
      auto found = std::ranges::find(columns_, dof, &Column::dof);
      if (found == columns_.end()) found = columns_.insert(columns_.end(), Column{.dof = dof});
      (*found).*which = true;
    }
  };
  add(a_.node, &Column::of_a);
  add(b_.node, &Column::of_b);
  for (Column& column : columns_) {
    const int node = tree_.node(column.dof);
    const bool shift = tree_.is_shift(column.dof);
    const Spatial none = Spatial::Zero(), end = shift ? none : end_[as_index(node)],
                  start = shift ? none : read6(mechanism_.view(as_index(node)).v, mechanism_.stride()),
                  &S = tree_.axis(column.dof);
    if (column.of_a) column.end_a = cross_motion(S, a_.end - end);
    if (column.of_b) column.end_b = cross_motion(S, b_.end - end);
    if (column.of_a) column.start_a = cross_motion(S, a_.start - start);
    if (column.of_b) column.start_b = cross_motion(S, b_.start - start);
  }
}

/// Generalised forces S . W of the pair's wrench W, for rates that move one body and not the other.
void ContactSlopes::end_pair(Eigen::MatrixXd& by_q, Eigen::MatrixXd& by_u) {
  const Vec3 apart = a_.origin - b_.origin;
  for (const bool a : {true, false}) {
    // On b at its origin: the opposite wrench.
    if (!a) {
      total_ = shifted(-total_, apart);
      for (Column& column : columns_) {
        column.by_q = shifted(-column.by_q, apart);
        column.by_u = shifted(-column.by_u, apart);
      }
    }
    for (const Column& row : columns_) {
      if (row.of_a == row.of_b || row.of_a != a) continue;
      const Spatial& S = tree_.axis(row.dof);
      // The wrench on what a position moves: (S_j x S) . W = S_j . (S x* W).
      const Spatial turned = cross_force(S, total_);
      for (const Column& column : columns_) {
        double change = S.dot(column.by_q);
        // What carries the same body is on its branch.
        if ((a ? column.of_a : column.of_b) && tree_.moves_axis(column.dof, row.dof))
          change += tree_.axis(column.dof).dot(turned);
        by_q(row.dof, column.dof) -= change;
        if (bounces_) by_u(row.dof, column.dof) -= S.dot(column.by_u);
      }
    }
  }
}

Spatial ContactSlopes::twist(const Partner& side, int dof, const Vec3& place) const {
  return at_point(tree_.axis(dof), place - side.origin);
}

ContactSlopes::Change ContactSlopes::moved(const Point& point, const Column& column,
                                           const ContactResponse& response) const {
  Change out;
  const Vec3& c = point.contact->position;
  const Spatial none = Spatial::Zero();
  const Spatial of_a = column.of_a ? twist(a_, column.dof, c) : none,
                of_b = column.of_b ? twist(b_, column.dof, c) : none;
  const Spatial apart = at_point(of_a - of_b, about_ - c);
  out.place = of_b.tail<3>() + response.place * apart;
  out.normal = Vec3(of_b.head<3>()).cross(point.contact->normal) + response.normal * apart;
  out.depth = response.depth * apart;
  out.share = response.share * apart;
  out.spin = response.spin * apart;
  out.end = at_point(column.end_a, c - a_.origin) - at_point(column.end_b, c - b_.origin);
  out.end.tail<3>() += Vec3(a_.end.head<3>() - b_.end.head<3>()).cross(out.place);
  if (point.by_approach == 0) return out;
  out.start = at_point(column.start_a, c - a_.origin) - at_point(column.start_b, c - b_.origin);
  out.start.tail<3>() += Vec3(a_.start.head<3>() - b_.start.head<3>()).cross(out.place);
  return out;
}

/// The change of a contact's wrench on a, at the contact's place.
Spatial ContactSlopes::wrench(const Point& point, const Change& change) const {
  const ContactRows& rows = *point.rows;
  const Mat3& E = point.frame;
  const Vec3 n = E.col(0), turn = n.cross(change.normal);
  // Rows of a velocity in a frame that turns with the normal.
  const auto in_frame = [&](const Vec3& dv, const Vec3& v) {
    return Vec3(E.transpose() * (dv + v.cross(turn)));
  };
  const Vec3 v = in_frame(change.end.tail<3>(), point.end.tail<3>()),
             w = in_frame(change.end.head<3>(), point.end.head<3>());
  const double approach = -(change.start.tail<3>().dot(n) + point.start.tail<3>().dot(change.normal));
  Eigen::Matrix<double, 6, 1> r = Eigen::Matrix<double, 6, 1>::Zero();
  const double by_share =
      rows.pad ? -rows.regularization * rows.impulse[0] : point.r[0];  // The impulse grows with its share.
  r[0] = v[0] - point.by_depth * change.depth - point.by_approach * approach + by_share * change.share;
  for (std::size_t k = 0; k < rows.disc_count; ++k) {
    const Disc& disc = rows.discs[k];
    const auto first = static_cast<Eigen::Index>(disc.row);
    if (disc.kind == Disc::Kind::spinning)
      r[first] = w[0];
    else
      r.segment<2>(first) = (disc.kind == Disc::Kind::sliding ? v : w).tail<2>();
  }
  Eigen::Matrix<double, 6, 1> p = -(point.law * r);
  for (std::size_t k = 0; k < rows.disc_count && change.spin != 0; ++k)
    if (const Disc& disc = rows.discs[k]; disc.kind == Disc::Kind::spinning && disc.slides)
      p[static_cast<Eigen::Index>(disc.row)] -=
          change.spin * disc.coefficient * rows.impulse[0] * disc.slip_x;
  Spatial out = wrench_of(rows, p.data(), E);
  const Vec3 moment = point.push.head<3>(), force = point.push.tail<3>();
  out.head<3>() += turn.cross(moment) + change.place.cross(force);
  out.tail<3>() += turn.cross(force);
  return out;
}

void ContactSlopes::compute_target(Point& point, const Touch& touch, double step) const {
  const model::Material& surface = touch.surface;
  const double depth = point.contact->depth, erp = contact_.erp_;
  const double inside = std::max(depth - kSurfaceLayer, 0.0);
  double target = 0;
  if (const PadPoint* pad = point.rows->pad) {
    const double slope =
        pad->share * step * pad->gain * pad->pad->elastic(pad->depth - step * point.r[0]).slope;
    point.by_depth = depth < 0 || inside > 0 ? slope * point.rows->regularization : 0;
    return;
  }
  if (surface.compliance) {
    const model::Compliance& pad = *surface.compliance;
    const SoftRow spring = soft_row(pad.stiffness, damping_beside(pad.stiffness, pad.damping, step), step);
    point.by_depth = depth < 0 || inside > 0 ? spring.erp / step : 0;
    target = spring.erp * (depth < 0 ? depth : inside) / step;
  } else {
    const bool fast = erp * inside / step >= kMaxCorrectingSpeed;
    point.by_depth = depth < 0 ? 1 / step : inside > 0 && !fast ? erp / step : 0;
    target = depth < 0 ? depth / step : std::min(erp * inside / step, kMaxCorrectingSpeed);
  }
  const double approach = -point.contact->normal.dot(Vec3(point.start.tail<3>()));
  if (!(surface.restitution > 0 && approach > surface.restitution_speed)) return;
  if (surface.restitution * approach < target) return;
  point.by_depth = 0;
  point.by_approach = surface.restitution;
}

void ContactSlopes::add_contact(Point& point, const ContactResponse& response) {
  const ContactRows& rows = *point.rows;
  const Vec3 &c = point.contact->position, r_a = c - a_.origin;
  point.push = wrench_of(rows, rows.impulse.data(), point.frame);
  total_ += shifted(point.push, r_a);
  bounces_ = bounces_ || point.by_approach != 0;
  for (Column& column : columns_) {
    column.by_q += shifted(wrench(point, moved(point, column, response)), r_a);
    if (point.by_approach == 0 || column.of_a == column.of_b) continue;
    Change rate;
    rate.start = column.of_a ? twist(a_, column.dof, c) : Spatial(-twist(b_, column.dof, c));
    column.by_u += shifted(wrench(point, rate), r_a);
  }
}

void ContactSlopes::note(const Contact& contact, const std::string& what) {
  notes_.push_back(fmt::format("contact {} - {}: {}", model_.shapes[as_index(contact.shape_a)].name,
                               model_.shapes[as_index(contact.shape_b)].name, what));
}

/// What is on the edge of the active set.
void ContactSlopes::note_sides(const Point& point, double largest) {
  const ContactRows& rows = *point.rows;
  if (rows.open ? point.r[0] < kLeastSpeed : rows.impulse[0] < kLeastImpulse * largest)
    note(*point.contact, rows.open ? "about to close: one-sided" : "about to open: one-sided");
  for (std::size_t k = 0; k < rows.disc_count && !rows.open; ++k) {
    const Disc& disc = rows.discs[k];
    const double* r = point.r + disc.row;
    const double speed = disc.size > 1 ? std::hypot(r[0], r[1]) : std::abs(r[0]);
    const double limit = disc.coefficient * rows.impulse[0] * disc.regularization;
    if (std::abs(speed - limit) <= kLimitMargin * limit)
      note(*point.contact, disc.slides ? "about to stick: one-sided" : "about to slide: one-sided");
  }
}

void ContactSlopes::add_slopes(const model::State& start, double step, Eigen::MatrixXd& by_q,
                               Eigen::MatrixXd& by_u) {
  Workspace& w = ContactDynamics::workspace();
  const ContactProblem& p = w.problem;
  notes_.clear();
  compute_velocities();
  double largest = 0;
  for (const ContactRows& rows : p.contacts) largest = std::max(largest, rows.impulse[0]);
  std::size_t i = 0;
  bool relaxes = false;
  std::optional<std::pair<int, int>> bodies;
  for (const Touch& touch : contact_.collider_.touches()) {
    if (!contact_.has_rows(touch)) continue;
    const Contact& any = contact_.contacts()[touch.first];
    // Shapes of the same two bodies often follow each other.
    const std::pair<int, int> these(contact_.body_of(any.shape_a), contact_.body_of(any.shape_b));
    if (bodies != these) {
      if (bodies) end_pair(by_q, by_u);
      begin_pair(any.shape_a, any.shape_b);
      bodies = these;
    }
    const auto closed = [&](std::size_t k) { return !p.contacts[k].open; };
    bool some = false;
    for (std::size_t k = 0; k < as_index(touch.count); ++k) some = some || closed(i + k);
    if (some) compute_responses(touch, start);
    for (std::size_t k = 0; k < as_index(touch.count); ++k, ++i) {
      Point point;
      point.contact = &contact_.contacts()[touch.first + k];
      point.rows = &p.contacts[i];
      point.r = w.r.data() + kMostRows * i;
      note_sides(point, largest);
      if (!closed(i)) continue;
      point.frame = contact_.frames_[i];
      point.law = law_of(*point.rows);
      const Vec3& c = point.contact->position;
      point.end = at_point(a_.end, c - a_.origin) - at_point(b_.end, c - b_.origin);
      point.start = at_point(a_.start, c - a_.origin) - at_point(b_.start, c - b_.origin);
      relaxes = relaxes || (point.rows->pad && !point.rows->pad->pad->law->relaxations.empty());
      compute_target(point, touch, step);
      add_contact(point, responses_[k]);
    }
  }
  if (bodies) end_pair(by_q, by_u);
  if (relaxes)
    notes_.emplace_back("pads that relax: by the state with what is left of their pressing as it is");
}

}  // namespace handsim::engine::articulated
