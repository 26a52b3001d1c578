// A model's moving bodies in reduced coordinates: the tree in lanes, what moves its bases, and the ways
// between body poses and joint coordinates. Knows no method of integration and holds no loop together.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "handsim/engine/articulated/dynamics/topology.h"
#include "handsim/engine/articulated/kernels/kernels.h"
#include "handsim/model/actuation.h"

namespace handsim::engine::articulated {

/// Pose, velocity and acceleration of a kinematic body at a moment, in world axes.
struct BaseMotion {
  Pose pose;
  Vec3 v = Vec3::Zero(), w = Vec3::Zero();    ///< [m/s], [rad/s]
  Vec3 dv = Vec3::Zero(), dw = Vec3::Zero();  ///< accelerations [m/s^2], [rad/s^2]
};

/// The place of a node in the arrays of the tree: its batch, its lane, and indices of its numbers.
struct LaneSlot {
  int batch = 0, lane = 0;
  std::size_t q = 0, u = 0;  ///< of its first position and rate; the next are `stride` further on
  int axis = 0;              ///< of its batch: Axis or Joint3
  std::size_t dof = 0;       ///< first coordinate in Model, of a node with a joint
};

/// Pointers to a node's numbers in the arrays of the tree: entry k of a quantity is at [k * stride].
struct NodeView {
  const double *S = nullptr, *h = nullptr, *I = nullptr, *mass = nullptr, *c = nullptr, *pv = nullptr;
  const double *R = nullptr, *p = nullptr, *v = nullptr, *spin = nullptr;
  const double *momentum = nullptr, *energy = nullptr;
  const double* base_a = nullptr;  ///< its base's acceleration; null with a parent
  const double* tau = nullptr;     ///< nodes of several rates
  const double *q = nullptr, *u = nullptr, *du = nullptr;
  // Nodes of one rate: their lane of an Axis (lane_tree.h).
  const double *low = nullptr, *high = nullptr, *restitution = nullptr, *weight = nullptr, *work = nullptr;
  const double *servo_stiffness = nullptr, *servo_damping = nullptr, *servo_error = nullptr,
               *servo_feed = nullptr, *servo_limit = nullptr;
  double *side = nullptr, *saturated = nullptr, *force = nullptr, *reaction = nullptr;
  model::Servo servo() const {
    return {*servo_stiffness, *servo_damping, *servo_error, *servo_feed, *servo_limit};
  }
};

/// The moving bodies of a model, their joints and bases.
class Mechanism {
 public:
  /// The model must outlive this object. @param kernel null: the fastest one for the model
  Mechanism(const model::Model& model, const Settings& settings, const Kernel* kernel = nullptr);
  Mechanism(const Mechanism&) = delete;  ///< views_ point into tree_
  Mechanism& operator=(const Mechanism&) = delete;

  const Vec3& gravity() const { return gravity_; }  ///< zero without the effect [m/s^2]
  const Topology& topology() const { return topology_; }
  const Kernel& kernel() const { return *kernel_; }
  const LaneTree& tree() const { return *tree_; }
  const LaneSlot& slot(std::size_t node) const { return slots_[node]; }
  const NodeView& view(std::size_t node) const { return views_[node]; }
  std::span<const NodeView> views() const { return views_; }
  std::size_t stride() const { return as_index(kernel_->width); }
  /// Square of the largest angular velocity of a link, as `kinematics` last found it [1/s^2].
  double spin() const { return *std::max_element(tree_->spin, tree_->spin + stride()); }
  /// Positions, rates and accelerations in the tree's order, empty lanes included.
  std::span<double> q() { return {tree_->q, as_index(tree_->positions)}; }
  std::span<double> u() { return {tree_->u, as_index(tree_->rates)}; }
  std::span<double> du() { return {tree_->du, as_index(tree_->rates)}; }
  /// Torques of the last step, in the order of u(), then the servos' part of them.
  std::span<double> torques() { return {tree_->tau, 2 * as_index(tree_->rates)}; }

  /// Sets positions, rates, torques, and places and velocities of the bases to those of a state.
  void load_state(const model::State& state);
  /// Sets the torques of the last step to those of a state.
  void load_torques(const model::State& state);
  /// Writes poses and velocities of all moving bodies, which `kinematics` last found, into a state.
  void store_state(model::State& state) const;
  /// Writes coordinates, rates and torques of all joints. @param state with all bodies as `store_state` has
  /// them
  void store_coordinates(model::State& state) const;

  /// The motion of a kinematic body; `update_bases` writes a changed one into the tree.
  BaseMotion& base(int body) { return bases_[as_index(body)]; }
  const BaseMotion& base(int body) const { return bases_[as_index(body)]; }
  void update_bases();
  /// Gives free bodies without children the gyroscopic torque of an implicit step of this length (spin.h).
  void update_gyroscopic_torques(double step);
  /// Adds forces from outside to those of the step; after `update_gyroscopic_torques`.
  void add_forces(std::span<const BodyForce> forces);
  /// Reads masses, inertias and gravity of the model again; `kinematics` has to be called after it.
  void refresh(const Settings& settings);
  /// An island's origin in the world; of a free one, where its positions have it.
  Vec3 origin(int island) const;

  /// Plain joint torques, size model.dof_count() or empty.
  void set_torques(std::span<const double> torques);
  /// Sound servo drives, size model.dof_count() or empty. @param step of one that is implicit [s]; nothing:
  /// servos keep their targets in the middle of a step, too.
  void set_servos(std::span<const model::Servo> servos, std::optional<double> step);
  /// Stops in force.
  int stops_in_force() const;
  /// Positions, rates, how the bases move and which stops and torque limits are in force: the same for every
  /// instruction set. `restore` leaves the rest of the tree as it was.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  /// Forgets which stops and torque limits were in force.
  void forget_limits();
  /// @returns whether a node is a free body without children, which has a gyroscopic torque of an implicit
  /// step
  bool is_single_body(std::size_t node) const {
    return std::ranges::find(single_bodies_, static_cast<int>(node)) != single_bodies_.end();
  }

 private:
  /// Calls f with the tree as LaneTreeOf its width.
  template <class F>
  decltype(auto) in_lanes(const F& f) const;

  /// A body that a node carries, and its island's origin: every `stride`th number.
  struct Carried {
    int body = 0, batch = 0, lane = 0;
    const double* origin = nullptr;
    std::size_t stride = 1;
  };
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  void place_nodes();
  template <int W>
  void make_tree(const Settings& settings);
  NodeView find_view(std::size_t node) const;
  template <int W>
  void make_batch(const LaneTreeOf<W>& tree, NodeBatch<W>& b, const std::vector<int>& nodes);
  template <int W>
  void fill_lane(const LaneTreeOf<W>& tree, int index, const Settings& settings);
  void load_node(const Node& node, const LaneSlot& slot, const model::State& state);

  const model::Model& model_;
  Vec3 gravity_;
  Topology topology_;
  const Kernel* kernel_;
  std::shared_ptr<LaneTree> tree_;        ///< a LaneTreeMemory
  std::vector<std::vector<int>> chunks_;  ///< nodes of each batch
  std::vector<LaneSlot> slots_;
  std::vector<NodeView> views_;  ///< of each node
  std::vector<Carried> carried_;
  std::vector<int> singles_;        ///< nodes of one rate, whose coordinate a torque or servo may act on
  std::vector<int> balls_;          ///< nodes
  std::vector<int> outside_;        ///< joints that are no node's
  std::vector<int> single_bodies_;  ///< nodes of free bodies without children
  std::vector<BaseMotion> bases_;   ///< as Model::bodies
  std::vector<Vec3> origins_;       ///< of the islands that are not free
  bool torques_at_rest_ = true;     ///< no coordinate has a torque from the last `set_torques`
  bool servos_at_rest_ = true;      ///< no coordinate has a servo from the last `set_servos`
};

}  // namespace handsim::engine::articulated
