// What the recursive algorithms work on: nodes of one kind and depth side by side, W to a batch, quantities
// as arrays of W lanes: the five fingers are one pass of the vector unit. Plain data for any instruction set.
// Spatial vectors are in world axes about the origin O of their island, angular part first (Featherstone
// 2008, section 2.1, p. 7: Plucker coordinates): nothing is transformed from link to link. O is where the
// island's reference node has its joint: distances stay as small as the mechanism.
#pragma once

#include <cstddef>

namespace handsim::engine::articulated {

enum class NodeKind {
  revolute,   ///< a hinge, or one axis of a universal joint
  prismatic,  ///< a slider
  ball,
  free,  ///< a body without a joint
};

constexpr int rate_count(NodeKind kind) {
  constexpr int counts[] = {1, 1, 3, 6};
  return counts[static_cast<int>(kind)];
}
/// Numbers that hold its position: for a ball a quaternion x, y, z, w, for a free body p and a quaternion.
constexpr int position_count(NodeKind kind) {
  constexpr int counts[] = {1, 1, 4, 7};
  return counts[static_cast<int>(kind)];
}

template <int W>
using Lane = double[W];

/// A link's motion, as its children need it.
template <int W>
struct alignas(64) Frame {
  Lane<W> quat[4];  ///< q_WL: x, y, z, w
  Lane<W> R[9];     ///< the same as a matrix, rows first
  Lane<W> p[3];     ///< centre of mass from O [m]
  Lane<W> v[6];     ///< spatial velocity
  Lane<W> a[6];     ///< spatial acceleration, less gravity's

  /// Calls visit(&Frame::field) for each field.
  template <class Visit>
  static constexpr void each_field(const Visit& visit) {
    (visit(&Frame::quat), visit(&Frame::R), visit(&Frame::p), visit(&Frame::v), visit(&Frame::a));
  }
};

/// Forces across the single coordinate of each node of a batch.
template <int W>
struct alignas(64) Axis {
  // Constant: passive tissue; a stop, infinite where there is none.
  Lane<W> stiffness, damping, rest;
  Lane<W> low, high, restitution;
  Lane<W> present;  ///< 1 where the lane has a node, else 0
  // Set for each step.
  Lane<W> tau;  ///< plain torque [N m] or [N]
  Lane<W> servo_stiffness, servo_damping, servo_error, servo_feed, servo_limit;
  // Kept from step to step: what the solution found in force.
  Lane<W> side;       ///< -1 on the low stop, 1 on the high one, else 0
  Lane<W> saturated;  ///< -1, 1: the servo is at its limit, else 0
  // Into the solution.
  Lane<W> force;     ///< generalised force [N m] or [N]
  Lane<W> weight;    ///< added to the joint-space inertia
  Lane<W> locked;    ///< 1: the acceleration is `given`
  Lane<W> given;     ///< [1/s^2 times the coordinate's unit]
  Lane<W> reaction;  ///< out: force of the lock
  Lane<W> work;      ///< out: done by all of these in a step, by Kernel::work [J]

  /// Calls visit(&Axis::field) for each field that is kept from step to step.
  template <class Visit>
  static constexpr void each_kept(const Visit& visit) {
    (visit(&Axis::side), visit(&Axis::saturated));
  }
};

enum class ParentLink {
  base,      ///< parents' motion stands in a Frame of the batch's own
  aligned,   ///< lane by lane the children of one batch
  gathered,  ///< each lane has its own
};

/// Nodes of one kind and one depth. Lanes without a node are a unit inertia at rest.
template <int W>
struct alignas(64) NodeBatch {
  // Constants of topology.h.
  Lane<W> before[4], turned[4], direction[3], anchor[3], arm[3], mass, inertia[3];
  Lane<W> body_turn[4];  ///< q_LB of the body
  // Functions of the position.
  Lane<W> sine, cosine;  ///< of half the angle; revolute nodes
  Lane<W> S[6];          ///< the joint's motion axis; nodes of one rate
  Lane<W> h[3];          ///< mass times p
  Lane<W> I[6];          ///< rotational inertia about O: xx, xy, xz, yy, yz, zz
  // Functions of the velocity.
  Lane<W> c[6];                 ///< velocity-product acceleration
  Lane<W> pv[6];                ///< velocity-product force v x* I v
  Lane<W> spin;                 ///< square of the angular velocity
  Lane<W> momentum[6], energy;  ///< of the bodies: about O, and kinetic; by Kernel::momenta
  Frame<W> frame;
  NodeKind kind;
  ParentLink link;
  bool has_children;
  bool adds_first;  ///< aligned, and the first to hand down to its parents, which need not be cleared
  bool cleared;     ///< before children hand down
  bool massless;    ///< no lane has a body
  int parent;       ///< batch; of Base frames where link is base
  int parent_batch[W], parent_lane[W];
  int used;  ///< lanes with a node
  int q, u;  ///< first position and rate
  int axis;  ///< index of its Axis or Joint3
};

/// Inertia and force that the children of a batch add to it: angular block A (as I), coupling B (rows first),
/// linear block C, and force p.
template <int W>
struct alignas(64) Handed {
  Lane<W> A[6], B[9], C[6], p[6];

  /// Calls visit(&Handed::field) for each field.
  template <class Visit>
  static constexpr void each_field(const Visit& visit) {
    (visit(&Handed::A), visit(&Handed::B), visit(&Handed::C), visit(&Handed::p));
  }
};

/// Numbers of a batch in the articulated-body algorithm; the memory is shared by all trees of a thread.
template <int W>
struct alignas(64) Work : Handed<W> {
  Lane<W> U[6], weighted, inverse, u_force,
      rate;  ///< U, D with its weight, 1/D, u, and du apart from the parent's
};

/// The larger blocks of ball and free nodes.
template <int W>
struct alignas(64) Joint3 {
  Lane<W> after[4];
  Lane<W> S[6][6];  ///< S[column][row], rate_count columns
  Lane<W> tau[6];
};
/// Numbers of a Joint3 in the articulated-body algorithm.
template <int W>
struct alignas(64) Work3 {
  Lane<W> U[6][6];
  Lane<W> D[6][6];  ///< Cholesky factor of S^T U, diagonal inverted
  Lane<W> rate[6];
};

/// Memory of this thread for so many items; its content stays until other trees work.
template <int W>
Work<W>* thread_work(std::size_t count);
template <int W>
Work3<W>* thread_work3(std::size_t count);

/// A tree in lanes: what does not depend on their width.
struct LaneTree {
  int batches = 0;
  int rates = 0, positions = 0;        ///< sizes of the arrays below, all lanes counted
  double* q = nullptr;                 ///< positions, [batch][component][lane]
  double* u = nullptr;                 ///< rates
  double* du = nullptr;                ///< accelerations
  double* tau = nullptr;               ///< State::tau of the last step, as rates; balls as told
  double* tau_servo = nullptr;         ///< the servos' part
  double max_speed = 0, max_turn = 0;  ///< bounds of every link [m/s], [rad/s]
  double* spin = nullptr;              ///< largest NodeBatch::spin of each lane
  double erp = 1;                      ///< share of an angle beyond its stop that a step brings back
};

/// A tree in W lanes: its arrays.
template <int W>
struct LaneTreeOf : LaneTree {
  static constexpr int kWidth = W;
  NodeBatch<W>* batch = nullptr;
  Axis<W>* axis = nullptr;
  Joint3<W>* joint3 = nullptr;
  Frame<W>* base = nullptr;
};
/// @param tree that was made for W lanes
template <int W>
const LaneTreeOf<W>& lanes_of(const LaneTree& tree) {
  return static_cast<const LaneTreeOf<W>&>(tree);
}

/// The algorithms for one width and instruction set, for trees of that width. Same bits from every one.
struct Kernel {
  const char* name = "";
  int width = 1;
  /// Kinematics and inertias of every link at q, u. False where a speed leaves its bounds or is not a number.
  bool (*kinematics)(const LaneTree&);
  /// Only what depends on u.
  bool (*velocities)(const LaneTree&);
  /// Forces, weights and locks of a step [s] that evaluates springs and dampers at its end.
  void (*prepare)(const LaneTree&, double step);
  /// tau and tau_servo of a step [s] whose du is found.
  void (*compute_torques)(const LaneTree&, double step);
  /// Forces at the very state, without weights or stops, and tau and tau_servo.
  void (*prepare_smooth)(const LaneTree&);
  /// du from q, u, forces and weights: the articulated-body algorithm.
  void (*solve)(const LaneTree&);
  /// Joint-space inertia by the composite-rigid-body algorithm; overwrites the sums of `solve`. By batch of
  /// nodes of one rate and by lane: entries with itself, then with every node that carries it, to the base.
  void (*inertia)(const LaneTree&, double* out);
  /// The same with the bits of Eigen's products.
  void (*paired_inertia)(const LaneTree&, double* out);
  /// Compares du with the stops and limits that it was found with and corrects these. `single`: only the
  /// first one that is wrong. True where nothing was wrong. @param step [s]
  bool (*update_active_set)(const LaneTree&, double step, bool single);
  /// Orientation and velocity of every body, as `kinematics` or `velocities` last found them, into the work
  /// of its batch: x, y, z, w of q_WB into A, the velocity into p.
  void (*bodies)(const LaneTree&);
  /// Momentum and kinetic energy of every body, as `kinematics` or `velocities` last found it.
  void (*momenta)(const LaneTree&);
  /// Work of the single coordinates' forces in a step [s], by du and the mean of the rates at both ends.
  void (*work)(const LaneTree&, double step);
  /// u += h du, then q by u.
  void (*integrate)(const LaneTree&, double step);
  /// Derivatives of q at u.
  void (*position_rates)(const LaneTree&, double* out);
  /// Makes quaternions unit and brings angles into (-pi, pi].
  void (*normalise)(const LaneTree&);
  /// prepare, solve and update_active_set of all axes, in two passes.
  bool (*accelerate)(const LaneTree&, double step);
  /// compute_torques, integrate and kinematics, in one pass. False as kinematics.
  bool (*advance)(const LaneTree&, double step);
};

}  // namespace handsim::engine::articulated
