// Largest forces and moments of a hand that is still: a linear program over forces on the skin, activations
// of muscles from 0 to 1, and what tissue and stops hold.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/validate/linear_program.h"
#include "handsim/study/validate/subject.h"

namespace handsim::study {

namespace {

/// A posture is one within this angle of each joint: over it tissue and resting muscles hold moments, too.
/// Chosen; docs/muscles.md says which rows it moves.
constexpr double kGives = 20 * M_PI / 180;
constexpr double kAtStop = 1e-6;   ///< an axis this near to its stop lies on it [rad]
constexpr double kInwards = -0.5;  ///< cosine beyond which the other end lies inside the finger's shaft
constexpr int kConeEdges = 8;

/// The edges of a cone of friction about a normal, each of a newton along it.
std::vector<Vec3> cone(const Vec3& normal, double friction) {
  if (friction == 0) return {normal};
  const Vec3 first = normal.unitOrthogonal(), second = normal.cross(first);
  std::vector<Vec3> out;
  for (int i = 0; i < kConeEdges; ++i) {
    const double turn = 2 * M_PI * i / kConeEdges;
    out.push_back(normal + friction * (std::cos(turn) * first + std::sin(turn) * second));
  }
  return out;
}

/// What a hand holds at one posture. Forces are added, then the largest sum of their gains is found.
class Press {
 public:
  /// @param dofs whose moments balance
  Press(const Subject& subject, std::span<const double> q, const std::vector<int>& dofs)
      : subject_(subject), q_(q.begin(), q.end()) {
    for (const model::Joint& joint : subject.model().joints)
      for (std::size_t a = 0; a < joint.axes.size(); ++a)
        if (const int dof = joint.first_dof + static_cast<int>(a); std::ranges::find(dofs, dof) != dofs.end())
          add_axis(dof, joint.axes[a]);
  }

  /// A force that may grow without end. @param torques that it asks of the joints, by coordinate [N m]
  /// @param across of it, that the palm's friction has to hold: `palm_friction` of its gain, or less
  void add(const Eigen::VectorXd& torques, double gain, const Eigen::Vector2d& across = {0, 0}) {
    columns_.push_back(torques);
    gains_.push_back(gain);
    across_.push_back(across);
  }

  struct Found {
    double sum = 0;                   ///< of gains; 0 where the posture is not held
    std::vector<double> activations;  ///< as Model::muscles; empty where it is not held
  };

  /// The largest sum of gains. @param palm_friction absent: what is across is held by something else
  Found largest(std::optional<double> palm_friction = {}) const {
    const auto rows = size(axes_), forces = size(columns_), muscles = size(subject_.model().muscles);
    const Eigen::Index walls = palm_friction ? 4 : 0;
    Eigen::MatrixXd equal = Eigen::MatrixXd::Zero(rows + walls, forces + muscles + rows + walls);
    Eigen::VectorXd to = Eigen::VectorXd::Zero(rows + walls), gain = Eigen::VectorXd::Zero(equal.cols());
    Eigen::VectorXd most = Eigen::VectorXd::Constant(equal.cols(), std::numeric_limits<double>::infinity());
    most.segment(forces, muscles).setOnes();
    const std::vector<double> passive = subject_.passive(q_), bands = subject_.bands(q_);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const Axis& axis = axes_[as_index(static_cast<int>(i))];
      for (Eigen::Index k = 0; k < forces; ++k)
        equal(i, k) = columns_[as_index(static_cast<int>(k))][axis.dof];
      equal(i, forces + muscles + i) = -axis.side;
      if (!axis.on_stop) most[forces + muscles + i] = 2 * axis.gives;
      to[i] = passive[as_index(axis.dof)] + bands[as_index(axis.dof)] - axis.side * axis.gives;
    }
    for (Eigen::Index m = 0; m < muscles; ++m) {
      const model::Muscle& muscle = subject_.model().muscles[as_index(static_cast<int>(m))];
      const model::PathState path = model::path_state(muscle.path, q_);
      const double force = model::isometric_force(muscle, path.excursion);
      for (std::size_t a = 0; a < muscle.path.arms.size(); ++a)
        for (Eigen::Index i = 0; i < rows; ++i)
          if (axes_[as_index(static_cast<int>(i))].dof == muscle.path.arms[a].dof)
            equal(i, forces + m) = -path.arm[a] * force;
    }
    for (Eigen::Index k = 0; k < forces; ++k) {
      gain[k] = gains_[as_index(static_cast<int>(k))];
      for (Eigen::Index w = 0; w < walls; ++w)
        equal(rows + w, k) = (w % 2 == 0 ? 1 : -1) * across_[as_index(static_cast<int>(k))][w / 2] -
                             palm_friction.value_or(0) * gain[k];
    }
    for (Eigen::Index w = 0; w < walls; ++w) equal(rows + w, forces + muscles + rows + w) = 1;
    const std::optional<Eigen::VectorXd> found = study::largest(gain, equal, to, most);
    if (!found) return {};
    return {std::max(0.0, gain.dot(*found)), {found->data() + forces, found->data() + forces + muscles}};
  }

 private:
  struct Axis {
    int dof = 0;
    double gives = 0;      ///< moment of tissue and resting muscles within the posture [N m]
    bool on_stop = false;  ///< the axis lies on a stop, whose moment has no limit
    double side = 1;       ///< sign of what is held: of the stop's moment
  };

  template <class T>
  static Eigen::Index size(const std::vector<T>& of) {
    return static_cast<Eigen::Index>(of.size());
  }

  double passive_at(int dof, double away) const {
    std::vector<double> q = q_;
    q[as_index(dof)] += away;
    return subject_.passive(q)[as_index(dof)];
  }

  void add_axis(int dof, const model::JointAxis& axis) {
    if (model::fused(axis)) return;
    Axis out{dof, std::abs(passive_at(dof, kGives) - passive_at(dof, -kGives)) / 2};
    if (const auto& stop = axis.stop) {
      const bool high = q_[as_index(dof)] >= stop->high - kAtStop;
      out.on_stop = high || q_[as_index(dof)] <= stop->low + kAtStop;
      out.side = high ? -1 : 1;
    }
    axes_.push_back(out);
  }

  const Subject& subject_;
  std::vector<double> q_;
  std::vector<Axis> axes_;
  std::vector<Eigen::VectorXd> columns_;
  std::vector<double> gains_;
  std::vector<Eigen::Vector2d> across_;
};

/// Torques that a force by the hand asks of the joints of a finger, by coordinate.
/// @param J point_jacobian() @param force in the segment's frame
Eigen::VectorXd torques_of(const Subject& subject, const std::string& segment, const Eigen::MatrixXd& J,
                           const Vec3& force) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(subject.model().dof_count());
  Eigen::Index column = 0;
  for (const int dof : subject.finger_dofs(segment.substr(0, segment.rfind('_'))))
    out[dof] = J.col(column++).head<3>().dot(force);
  return out;
}

std::vector<int> with_balanced(const Subject& subject, std::vector<int> dofs, const Measurement& of) {
  for (const std::string& axis : of.balanced) dofs.push_back(*subject.dof(axis));
  return dofs;
}

/// A contact of a finger with the object: its normal and force on the hand, at a point, all in the world.
struct Touch {
  std::string segment;
  Vec3 point = Vec3::Zero(), normal = Vec3::Zero(), force = Vec3::Zero();
};

std::vector<Touch> touches_of(const simulation::Simulation& run) {
  const model::Model& model = run.model();
  std::vector<Touch> out;
  for (const engine::Contact& contact : run.engine().contacts())
    for (const auto& [mine, side] : {std::pair(contact.shape_a, 1.0), std::pair(contact.shape_b, -1.0)}) {
      const int body = model.shapes[as_index(mine)].body;
      if (body < 0 || contact.depth < 0 || !model.bodies[as_index(body)].name.starts_with("right.")) continue;
      const std::string segment = model.bodies[as_index(body)].name.substr(6);
      if (segment.find('_') != std::string::npos && !segment.starts_with("thumb_"))
        out.push_back({segment, contact.position, side * contact.normal, side * contact.force});
    }
  return out;
}

/// A hand whose palm is still, its wrist held at angles while its fingers close on an object.
class GripRun {
 public:
  /// @param wrist angles of its axes
  GripRun(const Measurement& of, const Angles& wrist)
      : of_(of),
        subject_(subject_of(of)),
        run_(scene::load_scene(of.scene, with(of.changes, fused(wrist))), simulation::no_watchers),
        wrist_(wrist) {}

  /// The scene closes the hand for half of its time. Then muscles have the activations of the largest force
  /// that the fingers can press along a line by the normals of their contacts, while `balanced` axes have no
  /// moment; each comes in a quarter of the time. @return the force along that line in the end [N]
  double force() {
    for (long i = run_.step_count() / 2; i > 0; --i) run_.step();
    Press::Found best;
    Vec3 away = Vec3::Zero();
    for (const double tilt : of_.tilts) {
      const Vec3 along(0, std::sin(tilt), -std::cos(tilt));
      if (Press::Found found = held(along); found.sum >= best.sum) best = std::move(found), away = along;
    }
    if (best.activations.empty()) return 0;
    const long left = run_.step_count() - run_.steps(), ramp = left / 2;
    std::vector<double> excitations(best.activations.size());
    for (long i = 1; i <= left; ++i) {
      const double share = std::min(1.0, static_cast<double>(i) / static_cast<double>(ramp));
      for (std::size_t m = 0; m < excitations.size(); ++m)
        excitations[m] = std::clamp(share * best.activations[m], 0.0, 1.0);
      engine::StepInput input;
      input.excitations = excitations;
      run_.step(input);
    }
    double out = 0;
    for (const Touch& touch : touches_of(run_)) out += touch.force.dot(away);
    return std::max(0.0, out);
  }

 private:
  static std::vector<std::string> with(std::vector<std::string> changes, std::string more) {
    changes.push_back(std::move(more));
    changes.emplace_back("record.contacts=true");
    return changes;
  }
  static std::string fused(const Angles& wrist) {
    std::string out;
    for (const auto& [axis, angle] : wrist)
      out += fmt::format("{}{}: {}", out.empty() ? "" : ", ", axis, angle);
    return "hands.0.fused={" + out + "}";
  }
  /// The same hand on a wrist that turns.
  static Subject subject_of(const Measurement& of) {
    const scene::Scene scene = scene::load_scene(of.scene, with(of.changes, "hands.0.fused={}"));
    return {*scene.spec.hands.at(0).model, scene.spec.hands.at(0).person};
  }

  /// @param along in the palm's frame, which is the world's of the simulation
  Press::Found held(const Vec3& along) const {
    Angles pose = wrist_;
    for (const model::Joint& joint : run_.model().joints)
      for (std::size_t a = 0; a < joint.axes.size(); ++a)
        if (joint.name.starts_with("right."))
          pose[joint.name.substr(6) + "." + joint.axes[a].name] =
              run_.state().q[as_index(joint.first_dof) + a];
    const std::vector<double> q = subject_.coordinates(pose);
    std::vector<int> dofs;
    for (const char* finger : {"index", "middle", "ring", "little"})
      for (const int dof : subject_.finger_dofs(finger)) dofs.push_back(dof);
    Press press(subject_, q, with_balanced(subject_, dofs, of_));
    const Vec3 first(1, 0, 0), second = along.cross(first);
    for (const Touch& touch : touches_of(run_)) {
      const Pose frame = segment_frame(touch.segment);
      const Eigen::MatrixXd J = subject_.point_jacobian(touch.segment, frame.inverse() * touch.point, q);
      press.add(torques_of(subject_, touch.segment, J, frame.q.conjugate() * Vec3(-touch.normal)),
                touch.normal.dot(along), {touch.normal.dot(first), touch.normal.dot(second)});
    }
    return press.largest(of_.friction);
  }

  Pose segment_frame(const std::string& segment) const {
    for (std::size_t i = 0; i < run_.model().bodies.size(); ++i)
      if (run_.model().bodies[i].name == "right." + segment) return run_.state().bodies[i].pose();
    return {};
  }

  const Measurement& of_;
  Subject subject_;
  simulation::Simulation run_;
  Angles wrist_;
};

}  // namespace

double largest_tip_force(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  const std::string segment = of.segment.empty() ? last_segment(of.finger) : of.segment;
  const Eigen::MatrixXd J = subject.point_jacobian(
      segment, of.segment.empty() ? subject.tip(of.finger) : subject.middle(segment), q);
  Press press(subject, q, with_balanced(subject, subject.finger_dofs(of.finger), of));
  for (const Vec3& edge : cone(tip_direction(of.direction), of.friction))
    press.add(torques_of(subject, segment, J, edge), 1);
  return press.largest().sum;
}

double largest_pinch_force(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  std::vector<int> dofs;
  std::array<Pose, 2> frame;
  std::array<Vec3, 2> centre, outwards;
  std::array<Eigen::MatrixXd, 2> J;
  const std::array<std::string, 2> fingers = {"thumb", of.finger};
  for (std::size_t i = 0; i < 2; ++i) {
    frame[i] = subject.segment_pose(last_segment(fingers[i]), q);
    const double along = subject.tip_centre(fingers[i]);
    centre[i] = frame[i].p + frame[i].q * Vec3(0, along, 0);
    outwards[i] = frame[i].q * Vec3(0, 1, 0);
    J[i] = subject.point_jacobian(last_segment(fingers[i]), along, q);
    for (const int dof : subject.finger_dofs(fingers[i])) dofs.push_back(dof);
  }
  const Vec3 normal = (centre[1] - centre[0]).normalized();
  if (normal.dot(outwards[0]) < kInwards || -normal.dot(outwards[1]) < kInwards)
    throw Error(PhysicsFault{0, of.name, "pinch", "the round ends do not face each other in this pose"});
  Press press(subject, q, with_balanced(subject, dofs, of));
  // The thumb presses towards the finger, the finger with the opposite force.
  for (const Vec3& edge : cone(normal, of.friction))
    press.add(torques_of(subject, last_segment("thumb"), J[0], frame[0].q.conjugate() * edge) -
                  torques_of(subject, last_segment(of.finger), J[1], frame[1].q.conjugate() * edge),
              1);
  return press.largest().sum;
}

double largest_moment(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  Press press(subject, q, with_balanced(subject, {*subject.dof(of.axis)}, of));
  Eigen::VectorXd torques = Eigen::VectorXd::Zero(subject.model().dof_count());
  torques[*subject.dof(of.axis)] = of.direction == "negative" ? -1 : 1;
  press.add(torques, 1);
  return press.largest().sum;
}

double largest_grip_force(const Measurement& of) {
  double out = GripRun(of, of.pose).force();
  for (const Angles& pose : of.or_poses) out = std::max(out, GripRun(of, pose).force());
  return of.over_pose ? out / GripRun(of, *of.over_pose).force() : out;
}

}  // namespace handsim::study
