// Contact with friction in joint space: impulses at the points that the collider finds, solved
// with stops, torque limits of servos and loops at velocity level, so that all hold at the step's end. The
// inertia is that of the implicit step, with springs and dampers of tissue and servos.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "handsim/engine/articulated/contact/islands.h"
#include "handsim/engine/articulated/dynamics/loops.h"
#include "handsim/engine/articulated/dynamics/muscle_coupling.h"
#include "handsim/engine/collision/collider.h"
#include "handsim/engine/collision/penetration.h"

namespace handsim::engine::articulated {

/// Impulses of the last step: the warm start of the next, and what `each_impulse` gives.
struct ContactMemory {
  struct Point {
    int shape_a = 0, shape_b = 0, index = 0;
    Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();  ///< world [N s], [N m s]
    bool open = false;                                   ///< no impulse
    /// Sliding, spinning and rolling friction: limit of the impulse over speed where it slides, else 0.
    std::array<double, 3> tangent_stiffness{};
  };
  std::vector<Point> points;   ///< by shapes, then index
  std::vector<double> change;  ///< of each dof's rate; empty: not known
};

/// The contacts of an engine: finds them, makes the problem of a step, and solves it.
class ContactDynamics {
 public:
  /// All arguments must outlive this object. @param loops of the mechanism, null where it has none. @throws
  /// OdeFault
  ContactDynamics(const model::Model& model, const Settings& settings, Mechanism& mechanism, Loops* loops);

  /// Sets the tendons that couple coordinates, or null; they must outlive this object.
  void couple(MuscleCoupling* muscles) { muscles_ = muscles; }
  void refresh();
  /// Forgets the impulses of the last step.
  void forget() {
    memory_.points.clear();
    memory_.change.clear();
    system_.forget();
  }
  /// Takes over what is left of the pressing of pads.
  void load_state(const model::State& state) {
    if (pads_) pads_->set(state.pads);
  }
  void store_state(model::State& state) const {
    if (pads_) state.pads = pads_->pairs();
  }
  /// A step without contacts: pads recover.
  void recover(double step) {
    forget();
    if (!pads_ || pads_->pairs().empty()) return;
    pads_->recall(collider_, step);
    pads_->store(collider_, step, [](std::size_t) { return 0.0; });
  }
  /// Writes the contacts of the last step and their impulses, the warm start of the next step.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  /// Finds the contacts at a state. @return pairs given to the narrow phase. @throws OdeFault
  int collide(const model::State& state, const StepForecast& prospect);
  std::span<const Contact> contacts() const { return collider_.contacts(); }
  /// Calls f(node a, node b, point, impulse on a [N s], moment on a [N m s]) for each contact of the last
  /// `solve`; world axes; kNoNode for what cannot move.
  template <class F>
  void each_impulse(const F& f) const {
    auto point = memory_.points.begin();
    for (const Touch& touch : collider_.touches())
      for (int index = 0; has_rows(touch) && index < touch.count; ++index, ++point)
        f(node_of(point->shape_a), node_of(point->shape_b),
          contacts()[touch.first + as_index(index)].position, point->impulse, point->moment);
  }

  /// Computes accelerations, into Mechanism::du(), of a step [s] at whose end contacts, stops and torque
  /// limits are kept; `kinematics` was called, and the bases have their motion. Stores in the mechanism which
  /// stops and torque limits are in force.
  NewtonReport solve(double step);

 private:
  friend class ContactSlopes;  ///< of the solution, while the thread solves no other problem
  static Workspace& workspace();
  void store_solution(ContactProblem& p, double step);
  /// One body of a contact: its velocity at an origin, of the mechanism's island (Topology) where it is a
  /// node.
  struct BodyVelocity {
    Vec3 origin = Vec3::Zero(), v = Vec3::Zero(), w = Vec3::Zero();
    Vec3 velocity(const Vec3& position) const { return v + w.cross(position - origin); }
  };
  /// Inverses of mass [1/kg] and mean moment of inertia [1/(kg m2)]; zero of a body that cannot move.
  struct Mobility {
    double linear = 0, angular = 0;
  };
  /// Two bodies that touch; mobilities added.
  struct TouchingPair {
    BodyVelocity a, b;
    Mobility mobility;
  };
  /// The unknowns that move one of two nodes and not the other; sign 1: body a, -1: body b.
  struct MovingDofs {
    int node_a = kNoNode, node_b = kNoNode;
    std::vector<int> dofs;
    std::vector<signed char> signs;
  };

  template <class Archive, class T>
  static void serialize(Archive& archive, T& point);
  void order_dofs();
  void select_dofs();
  void compute_free(ContactProblem& p, double step);
  bool free_step_holds(std::size_t single, double step) const;
  double stop_target(double room, double step) const;
  void choose_trees(double step);
  bool is_constrained(int dof) const { return constrained_[as_index(root_of_[as_index(dof)])]; }
  bool has_rows(const Touch& touch) const;
  void add_contacts(ContactProblem& p, double step);
  void add_contact(ContactProblem& p, const Touch& touch, std::size_t index, double step);
  void compute_pair(ContactProblem& p, std::size_t index, int shape_a, int shape_b);
  void collect_moving_dofs(MovingDofs& of) const;
  BodyVelocity velocity_of(int shape) const;
  double mobility_across(ContactProblem& p, const Contact& contact, double enough);
  double set_compliance(ContactRows& rows, const Contact& contact, const model::Material& surface,
                        double share, double step);
  double compute_target(ContactRows& rows, const Contact& contact, const model::Material& surface,
                        double share, double crossed, double approach, double step);
  void warm_start(ContactRows& rows, const Contact& contact, const Mat3& frame, int index);
  /// The solution's impulses: for the next step's warm start and `each_impulse`, and as the forces of
  /// contacts that watchers read.
  void store_impulses(const ContactProblem& p, double step);
  void store_pads(ContactProblem& p, double step);
  void add_loop_rows(ContactProblem& p);
  void bound_axes(ContactProblem& p, double step);
  bool apply_restitution(ContactProblem& p);
  bool stiffen(ContactProblem& p);
  int body_of(int shape) const { return model_.shapes[as_index(shape)].body; }
  /// In the solver, or kNoDof. @param single a node of one rate
  int place_of(int single) const { return place_[as_index(space_.first_dof(single))]; }
  int node_of(int shape) const { return mechanism_.topology().node_of_body[as_index(body_of(shape))]; }
  Mobility mobility_of(int shape) const;

  const model::Model& model_;
  Mechanism& mechanism_;
  Loops* loops_;
  MuscleCoupling* muscles_ = nullptr;
  Collider collider_;
  CrossedBodies crossed_;
  JointSpace space_;
  ContactSystem system_;
  bool friction_, with_forces_;
  double erp_, heaviest_ = 0;        ///< mass of the heaviest body [kg]
  std::vector<int> singles_;         ///< nodes of one rate
  std::vector<LimitSide> sides_;     ///< of each of these: the stop that was in force
  std::vector<int> order_, chosen_;  ///< dof of each place in the full order; places of the involved ones
  std::vector<int> place_, dof_of_;  ///< in the solver, of each dof that is involved, and back
  std::vector<int> root_of_;         ///< of each dof
  /// By roots: whether contacts, stops or torque limits change the free step of the tree.
  std::vector<char> constrained_;
  std::vector<std::vector<int>> carriers_;  ///< places of the dofs that carry each node, ascending
  std::vector<double> inverse_inertia_;     ///< inverse of the diagonal, with servos, by place
  std::vector<double> change_;              ///< of each dof's rate in the free step
  TouchingPair pair_;
  std::vector<MovingDofs> moving_dofs_;  ///< of each pair that touches; mostly those of the last step
  const MovingDofs* moving_ = nullptr;   ///< of the pair
  std::vector<int> loop_dofs_;
  std::vector<double> loop_entries_;
  std::vector<Mat3> frames_;        ///< of each contact; columns: normal, two tangents
  std::vector<std::size_t> light_;  ///< rigid contacts of light pairs
  std::optional<PadMemory> pads_;   ///< with surfaces that need it only
  std::vector<PadPoint> points_;    ///< of the pads in this step; rows refer to them
  PadStep pad_;                     ///< of the touch
  std::vector<double> depths_;      ///< of the contacts after the step
  ContactMemory memory_;
  std::size_t warm_started_ = 0;
};

}  // namespace handsim::engine::articulated
