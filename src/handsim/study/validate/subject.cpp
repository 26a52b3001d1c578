#include "handsim/study/validate/subject.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/control/muscle_drive.h"
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
  for (std::size_t i = 0; i < path.arms.size(); ++i) out[at(path.arms[i].dof)] += state.arm[i] * tension;
}

constexpr double kHighest = 2000;  ///< of the forces that are tried [N]
/// Share of the largest torque, and torque [N m], that may be missing.
constexpr double kMissingShare = 0.01, kMissingTorque = 1e-3;
constexpr double kInwards = -0.5;     ///< cosine beyond which the other end lies inside the finger's shaft
constexpr double kFinestLean = 1e-4;  ///< of the search, over the friction
constexpr double kAtStop = 1e-6;      ///< an axis this near to its stop lies on it [rad]

/// The model with a muscle for each stop that an axis lies on, of all that muscles of the axis can give.
model::Model with_stops(model::Model model, std::span<const double> q) {
  std::vector<double> most(q.size());
  for (const model::Muscle& muscle : model.muscles) {
    const model::PathState path = model::path_state(muscle.path, q);
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i)
      most[at(muscle.path.arms[i].dof)] += muscle.force * std::abs(path.arm[i]);
  }
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      const std::size_t i = at(joint.first_dof) + a;
      const auto& stop = joint.axes[a].stop;
      if (!stop || !(most[i] > 0) || (q[i] > stop->low + kAtStop && q[i] < stop->high - kAtStop)) continue;
      model::Muscle& back = model.muscles.emplace_back();
      back.path.arms = {{static_cast<int>(i), {q[i] > stop->low + kAtStop ? -1.0 : 1.0}}};
      back.force = most[i];
      back.fibre_length = 1;
      back.length = 1 + model::path_state(back.path, q).excursion;
    }
  return model;
}

/// Forces of a contact whose torques muscles hold beside those of tissue, bands and stops, at one posture.
class Press {
 public:
  /// @param J torques of a force: a column for each of `dofs`, rows in the axes of `normal`
  Press(const Subject& subject, std::span<const double> q, std::vector<int> dofs, Eigen::MatrixXd J)
      : dofs_(std::move(dofs)),
        J_(std::move(J)),
        model_(with_stops(subject.model(), q)),
        state_(model::state_at(model_, q)),
        muscles_(model_, {dofs_.begin(), dofs_.end()}),
        torques_(q.size()),
        helped_(subject.tissue(q)) {
    const std::vector<double> bands = subject.bands(q);
    for (std::size_t i = 0; i < helped_.size(); ++i) helped_[i] += bands[i];
  }

  /// Largest component along `normal` of forces within `friction` of it: bisection on what is left undone.
  /// Tissue and bands may ask for a force: forces that hold are an interval.
  double largest(const Vec3& normal, double friction) {
    const Vec3 first = normal.unitOrthogonal(), second = normal.cross(first);
    across_ = J_.transpose() * (Eigen::Matrix<double, 3, 2>() << first, second).finished();
    along_ = J_.transpose() * normal;
    lean_.setZero();
    double low = 0, high = kHighest;
    while (low < kHighest && !holds(low, friction)) low = std::max(0.25, 1.4 * low);
    if (low > kHighest) return 0;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (holds(middle, friction) ? low : high) = middle;
    }
    return low;
  }

 private:
  /// Torques that muscles leave undone under a force along the normal and a lean.
  std::span<const double> missing(double force, const Eigen::Vector2d& lean) {
    const Eigen::VectorXd wanted = force * (along_ + across_ * lean);
    largest_ = wanted.cwiseAbs().maxCoeff();
    for (std::size_t i = 0; i < dofs_.size(); ++i)
      torques_[at(dofs_[i])] = wanted[static_cast<Eigen::Index>(i)] - helped_[at(dofs_[i])];
    muscles_.solve(state_, torques_);
    return muscles_.missing();
  }

  double squares(double force, const Eigen::Vector2d& lean) {
    double out = 0;
    for (const double each : missing(force, lean)) out += each * each;
    return out;
  }

  /// A pattern search over the lean, from the last one: what is missing is a smooth convex function of it.
  bool holds(double force, double friction) {
    double least = squares(force, lean_);
    for (double step = friction / 2; step > kFinestLean * friction;) {
      bool better = false;
      for (int way = 0; way < 8; ++way) {
        const Eigen::Vector2d lean =
            lean_ + step * Eigen::Vector2d(std::cos(way * M_PI_4), std::sin(way * M_PI_4));
        if (lean.norm() > friction) continue;
        if (const double found = squares(force, lean); found < least) {
          lean_ = lean;
          least = found;
          better = true;
        }
      }
      if (!better) step /= 2;
    }
    return balances(force, lean_) || balances(force, Eigen::Vector2d::Zero());
  }

  bool balances(double force, const Eigen::Vector2d& lean) {
    double most = 0;
    for (const double each : missing(force, lean)) most = std::max(most, std::abs(each));
    return most <= kMissingShare * largest_ + kMissingTorque;
  }

  std::vector<int> dofs_;
  Eigen::MatrixXd J_;
  model::Model model_;
  model::State state_;
  control::StaticOptimisation muscles_;
  std::vector<double> torques_, helped_;  ///< of muscles, of tissue and bands
  Eigen::VectorXd along_;                 ///< torques of a newton along the normal
  Eigen::Matrix<double, -1, 2> across_;   ///< and of one across it, in two directions
  Eigen::Vector2d lean_;                  ///< shear over the force along the normal
  double largest_ = 0;                    ///< of the torques that were wanted last [N m]
};

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
  std::vector<double> q(at(model_.dof_count()));
  for (const auto& [axis, angle] : pose)
    if (const std::optional<int> found = dof(axis)) q[at(*found)] = angle;
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
      const std::size_t i = at(joint.first_dof) + a;
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
      out[static_cast<Eigen::Index>(i)] = all[at(free[i])] + of_bands[at(free[i])];
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
      const double m = moment[static_cast<Eigen::Index>(i)], x = q[at(free[i])];
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
      double& x = next[at(free[i])];
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
                               [&](const model::Shape& shape) { return at(shape.body) == of; });
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
  const std::size_t of = body(segment);
  const model::State state = model::state_at(model_, q);
  const Pose frame = state.bodies[of].pose();
  const model::Jacobian J = model::jacobian(model_, state, static_cast<int>(of), frame * Vec3(0, along, 0));
  const Mat3 axes = frame.q.conjugate().toRotationMatrix();
  Eigen::MatrixXd out = J(Eigen::all, finger_dofs(segment.substr(0, segment.rfind('_'))));
  out.topRows<3>() = (axes * out.topRows<3>()).eval();
  out.bottomRows<3>() = (axes * out.bottomRows<3>()).eval();
  return out;
}

double largest_tip_force(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  const Eigen::MatrixXd J = of.segment.empty()
                                ? subject.tip_jacobian(of.finger, q)
                                : subject.point_jacobian(of.segment, subject.middle(of.segment), q);
  return Press(subject, q, subject.finger_dofs(of.finger), J.topRows<3>())
      .largest(tip_direction(of.direction), of.friction);
}

double largest_pinch_force(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  std::vector<int> dofs;
  std::array<Vec3, 2> centre, outwards;
  std::array<Eigen::MatrixXd, 2> J;  // in the world
  const std::array<std::string, 2> fingers = {"thumb", of.finger};
  for (std::size_t i = 0; i < 2; ++i) {
    const Pose segment = subject.segment_pose(last_segment(fingers[i]), q);
    const double along = subject.tip_centre(fingers[i]);
    centre[i] = segment.p + segment.q * Vec3(0, along, 0);
    outwards[i] = segment.q * Vec3(0, 1, 0);
    J[i] = segment.q.toRotationMatrix() *
           subject.point_jacobian(last_segment(fingers[i]), along, q).topRows<3>();
    for (const int dof : subject.finger_dofs(fingers[i])) dofs.push_back(dof);
  }
  const Vec3 normal = (centre[1] - centre[0]).normalized();
  if (normal.dot(outwards[0]) < kInwards || -normal.dot(outwards[1]) < kInwards)
    throw Error(PhysicsFault{0, of.name, "pinch", "the round ends do not face each other in this pose"});
  // The thumb presses towards the finger, the finger with the opposite force.
  Eigen::MatrixXd both(3, J[0].cols() + J[1].cols());
  both << J[0], -J[1];
  return Press(subject, q, dofs, std::move(both)).largest(normal, of.friction);
}

double largest_moment(const Subject& subject, const Measurement& of) {
  std::vector<int> dofs = {*subject.dof(of.axis)};
  for (const std::string& axis : of.balanced) dofs.push_back(*subject.dof(axis));
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, static_cast<Eigen::Index>(dofs.size()));
  J(0, 0) = of.direction == "negative" ? -1 : 1;
  return Press(subject, subject.coordinates(of.pose), dofs, std::move(J)).largest({1, 0, 0}, 0);
}

double largest_grip_force(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  std::map<int, double> torques;  // of a newton, by coordinate; the hand's own grip does not load the wrist
  for (const std::string& axis : of.balanced) torques[*subject.dof(axis)] = 0;
  for (const auto& [segment, share] : of.shares) {
    const Eigen::MatrixXd J = subject.point_jacobian(segment, subject.middle(segment), q);
    Eigen::Index column = 0;
    for (const int dof : subject.finger_dofs(segment.substr(0, segment.rfind('_'))))
      torques[dof] += share * tip_direction("palmar").dot(J.col(column++).head<3>());
  }
  std::vector<int> dofs;
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, static_cast<Eigen::Index>(torques.size()));
  for (const auto& [dof, torque] : torques) {
    J(0, static_cast<Eigen::Index>(dofs.size())) = torque;
    dofs.push_back(dof);
  }
  return Press(subject, q, dofs, std::move(J)).largest({1, 0, 0}, 0);
}

}  // namespace handsim::study
