// What the peers share: another engine as a program that `handsim accuracy` runs beside its own methods. It
// reads one request from standard input, builds the mechanism described there with its own API, and writes
// either every state of the motion or what a step costs. Knows nothing of handsim but this protocol.
//
// Request, JSON in SI and world axes: `task` (`motion` or `cost`), `method`, `settings` (a map of the
// method's own), `step`, `steps`, `gravity`, `bodies` (name, mass, inertia about the centre of mass in body
// axes as 9 numbers row by row, position of the centre of mass, orientation w x y z, velocity,
// angular_velocity), `joints` (name, kind, parent and child by name, closes_loop, anchor, axes, forces:
// constant, one for each axis).
//
// Answer: one line of JSON (`engine`, `version`, `kinetic_energy` at the start as the engine has it [J]; for
// `cost` also `cpu_seconds`, of all steps) and, for `motion`, a line for the start and for each step: time,
// and for each body in the order of the request position, orientation w x y z, velocity, angular velocity. A
// failure is a line on standard error and exit status 1.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <nlohmann/json.hpp>

namespace peer {

using Vec3 = Eigen::Vector3d;

/// The parent of joints to the ground.
inline constexpr int kGround = -1;

struct Body {
  std::string name;
  double mass = 0;                                    ///< [kg]
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about the centre of mass, body axes [kg m^2]
  Vec3 position = Vec3::Zero();                       ///< of the centre of mass [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< body to world
  Vec3 velocity = Vec3::Zero();                                     ///< of the centre of mass [m/s]
  Vec3 angular_velocity = Vec3::Zero();                             ///< [rad/s]

  Eigen::Isometry3d pose() const;
};

enum class JointKind { hinge, universal, ball, slider };

struct Joint {
  std::string name;
  JointKind kind = JointKind::hinge;
  int parent = kGround;        ///< index of a body, or kGround
  int child = 0;               ///< index of a body
  bool closes_loop = false;    ///< its child hangs on an earlier joint
  Vec3 anchor = Vec3::Zero();  ///< at the start, in the world [m]
  std::vector<Vec3> axes;  ///< at the start, in the world, unit; universal: the parent's, then the child's
  std::vector<double> forces;  ///< constant, along each axis [N m] or [N]
};

/// What is asked for. Every joint's parent stands before its child, loop-closing joints excepted. Trees are
/// of hinges, universal joints and sliders, loops are closed by ball joints: anything else is refused on
/// reading.
struct Request {
  bool cost = false;
  std::string method;
  nlohmann::json settings;
  double step = 0;  ///< [s]
  long steps = 0;
  Vec3 gravity = Vec3::Zero();  ///< [m/s^2]
  std::vector<Body> bodies;
  std::vector<Joint> joints;

  const Body& child(const Joint& joint) const { return bodies[static_cast<std::size_t>(joint.child)]; }
  /// Pose of a joint's parent at the start; the ground's is the identity.
  Eigen::Isometry3d parent_pose(const Joint& joint) const;
  /// Rate of each axis at the start, from the bodies' velocities [rad/s] or [m/s].
  std::vector<double> rates(const Joint& joint) const;
  bool has(const char* key) const { return settings.contains(key); }
  /// A number of `settings`.
  double setting(const char* key, double fallback) const { return settings.value(key, fallback); }
};

/// What a step leaves of a body, in the world.
struct BodyState {
  Vec3 position = Vec3::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Vec3 velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
};

/// A mechanism in a peer, at its start when made.
class Mechanism {
 public:
  Mechanism() = default;
  Mechanism(const Mechanism&) = delete;
  Mechanism& operator=(const Mechanism&) = delete;
  virtual ~Mechanism() = default;

  virtual void step() = 0;
  /// So many steps with nothing looked at between them: what is timed.
  virtual void run(long steps) {
    for (long i = 0; i < steps; ++i) step();
  }
  virtual double time() const = 0;
  /// One for each body of the request, in its order. Leaves what step() does next as it is.
  virtual std::vector<BodyState> state() = 0;
  virtual double kinetic_energy() = 0;
};

struct Peer {
  std::string engine, version;
  std::vector<std::string> settings;  ///< that it knows; any other is refused
  std::unique_ptr<Mechanism> (*make)(const Request& request);
};

/// The whole of main(): reads the request, answers it, returns the exit status.
int serve(const Peer& peer);

}  // namespace peer
