#include "handsim/study/validate/subject.h"

#include <algorithm>
#include <cmath>

#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"

namespace handsim::study {

namespace {

/// Adds the moments of a path's tension. @param force tension [N] at an excursion
template <class Path, class Force>
void pull(const Path& path, std::span<const double> q, const Force& force, std::vector<double>& out) {
  const model::PathState state = model::path_state(path, q);
  const double tension = force(state.excursion);
  for (std::size_t i = 0; i < path.arms.size(); ++i)
    out[as_index(path.arms[i].dof)] += state.arm[i] * tension;
}

}  // namespace

Subject::Subject(const hand::HandSpec& spec, const hand::Person& person)
    : hand_(hand::build_hand(spec, person)), model_(model::make_model()) {
  hand::Placement placement;
  placement.mount = spec.wrist.axes.size() == 2 ? hand::Mount::universal : hand::Mount::hinge;
  hand::add_hand(model_, hand_, placement);
}

std::optional<int> Subject::dof(const std::string& axis) const {
  for (const model::Joint& joint : model_.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (joint.name + "." + joint.axes[a].name == "right." + axis)
        return joint.first_dof + static_cast<int>(a);
  return std::nullopt;
}

const model::Muscle* Subject::muscle(const std::string& name) const {
  for (const model::Muscle& each : model_.muscles)
    if (each.name == "right." + name) return &each;
  return nullptr;
}

std::vector<double> Subject::coordinates(const Angles& pose) const {
  std::vector<double> q(as_index(model_.dof_count()));
  for (const auto& [axis, angle] : pose)
    if (const std::optional<int> found = dof(axis)) q[as_index(*found)] = angle;
  return q;
}

double Subject::arm(const model::Muscle& muscle, int dof, std::span<const double> q) const {
  const model::PathState state = model::path_state(muscle.path, q);
  for (std::size_t i = 0; i < muscle.path.arms.size(); ++i)
    if (muscle.path.arms[i].dof == dof) return state.arm[i];
  return 0;
}

std::vector<double> Subject::tissue(std::span<const double> q) const {
  std::vector<double> out(q.size());
  for (const model::Joint& joint : model_.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      const std::size_t i = as_index(joint.first_dof) + a;
      if (const auto& tissue = joint.axes[a].tissue) out[i] -= tissue->stiffness * (q[i] - tissue->rest);
    }
  return out;
}

std::vector<double> Subject::passive(std::span<const double> q) const {
  std::vector<double> out = tissue(q);
  for (const model::Muscle& muscle : model_.muscles)
    pull(
        muscle.path, q, [&](double excursion) { return model::passive_force(muscle, excursion); }, out);
  return out;
}

std::vector<double> Subject::bands(std::span<const double> q) const {
  std::vector<double> out(q.size());
  for (const model::Band& band : model_.bands) {
    const auto force = [&](double excursion) {
      const double pulls = band.stiffness * (-excursion - band.rest);
      return band.both_ways ? pulls : std::max(0.0, pulls);
    };
    pull(band.path, q, force, out);
  }
  return out;
}

std::vector<double> Subject::balance(std::vector<double> q, const std::vector<int>& free,
                                     const std::map<const model::Muscle*, double>& tensions) const {
  const auto moments = [&](std::span<const double> at_q) {
    std::vector<double> all = passive(at_q), of_bands = bands(at_q);
    // The tendon has this tension: the muscle's passive one is part of it.
    for (const auto& tension : tensions)
      pull(
          tension.first->path, at_q,
          [&](double x) { return tension.second - model::passive_force(*tension.first, x); }, all);
    Eigen::VectorXd out(static_cast<Eigen::Index>(free.size()));
    for (std::size_t i = 0; i < free.size(); ++i)
      out[static_cast<Eigen::Index>(i)] = all[as_index(free[i])] + of_bands[as_index(free[i])];
    return out;
  };
  const auto range = [&](int dof) {
    for (const model::Joint& joint : model_.joints)
      for (std::size_t a = 0; a < joint.axes.size(); ++a)
        if (joint.first_dof + static_cast<int>(a) == dof && joint.axes[a].stop)
          return std::pair(joint.axes[a].stop->low, joint.axes[a].stop->high);
    return std::pair(-M_PI, M_PI);
  };
  // Pseudo-transient: steps along the moments, as damped joints turn, until only stops hold them.
  double step = 1;
  Eigen::VectorXd now = moments(q);
  const auto left = [&](const Eigen::VectorXd& moment) {
    double out = 0;
    for (std::size_t i = 0; i < free.size(); ++i) {
      const auto [low, high] = range(free[i]);
      const double m = moment[static_cast<Eigen::Index>(i)], x = q[as_index(free[i])];
      if ((x <= low && m < 0) || (x >= high && m > 0)) continue;
      out = std::max(out, std::abs(m));
    }
    return out;
  };
  for (int pass = 0; pass < 200000; ++pass) {
    if (left(now) < 1e-8) return q;
    std::vector<double> next = q;
    for (std::size_t i = 0; i < free.size(); ++i) {
      const auto [low, high] = range(free[i]);
      double& x = next[as_index(free[i])];
      x = std::clamp(x + std::clamp(step * now[static_cast<Eigen::Index>(i)], -0.05, 0.05), low, high);
    }
    const Eigen::VectorXd then = moments(next);
    // Small components do not count: a nearly balanced one changes its sign with every step of the others.
    const bool turned =
        (then.array() * now.array() < -0.25 * now.array().square() && then.array().abs() > 0.1 * left(now))
            .any();
    if (turned) {
      step *= 0.5;
      continue;
    }
    step = std::min(step * 1.1, 50.0);
    q = std::move(next);
    now = then;
  }
  throw Error(PhysicsFault{0, "the hand", "balance", "no posture was found in which moments balance"});
}

std::vector<int> Subject::finger_dofs(const std::string& finger) const {
  std::vector<int> out;
  for (const model::Joint& joint : model_.joints)
    if (joint.name.starts_with("right." + finger + "_"))
      for (int k = 0; k < model::dof_count(joint.kind); ++k) out.push_back(joint.first_dof + k);
  return out;
}

Vec3 tip_direction(const std::string& name) {
  if (name == "palmar") return {0, 0, -1};
  if (name == "dorsal") return {0, 0, 1};
  if (name == "distal") return {0, 1, 0};
  if (name == "proximal") return {0, -1, 0};
  return name == "ulnar" ? Vec3(1, 0, 0) : Vec3(-1, 0, 0);
}

std::string last_segment(const std::string& finger) { return finger + "_distal"; }

std::size_t Subject::body(const std::string& segment) const {
  std::size_t body = 0;
  for (std::size_t i = 0; i < model_.bodies.size(); ++i)
    if (model_.bodies[i].name == "right." + segment) body = i;
  return body;
}

const model::Shape& Subject::shape(const std::string& segment) const {
  const std::size_t of = body(segment);
  return *std::ranges::find_if(model_.shapes,
                               [&](const model::Shape& shape) { return as_index(shape.body) == of; });
}

double Subject::tip_centre(const std::string& finger) const {
  const model::Shape& last = shape(last_segment(finger));
  return last.pose.p.y() + 0.5 * last.length;
}

double Subject::tip(const std::string& finger) const {
  const std::vector<model::Fingertip>& tips = model_.hands.front().fingertips;
  return std::ranges::find_if(
             tips, [&](const model::Fingertip& tip) { return tip.name == "right." + finger + "_tip"; })
      ->point.y();
}

double Subject::middle(const std::string& segment) const {
  const model::Shape& of = shape(segment);
  const bool last = segment == last_segment(segment.substr(0, segment.rfind('_')));
  return of.pose.p.y() + (last ? 0.5 * of.radius : 0);  // only the fingertip's round end is beyond the ends
}

Pose Subject::segment_pose(const std::string& segment, std::span<const double> q) const {
  return model::state_at(model_, q).bodies[body(segment)].pose();
}

Eigen::MatrixXd Subject::tip_jacobian(const std::string& finger, std::span<const double> q) const {
  return point_jacobian(last_segment(finger), tip(finger), q);
}

Eigen::MatrixXd Subject::point_jacobian(const std::string& segment, double along,
                                        std::span<const double> q) const {
  return point_jacobian(segment, Vec3(0, along, 0), q);
}

Eigen::MatrixXd Subject::point_jacobian(const std::string& segment, const Vec3& point,
                                        std::span<const double> q) const {
  const std::size_t of = body(segment);
  const model::State state = model::state_at(model_, q);
  const Pose frame = state.bodies[of].pose();
  const model::Jacobian J = model::jacobian(model_, state, static_cast<int>(of), frame * point);
  const Mat3 axes = frame.q.conjugate().toRotationMatrix();
  Eigen::MatrixXd out = J(Eigen::all, finger_dofs(segment.substr(0, segment.rfind('_'))));
  out.topRows<3>() = (axes * out.topRows<3>()).eval();
  out.bottomRows<3>() = (axes * out.bottomRows<3>()).eval();
  return out;
}

}  // namespace handsim::study
