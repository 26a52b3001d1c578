// Contact with friction in joint space: impulses at the points that ODE's collision detection finds, solved
// together with the joint stops at velocity level, and with the servos' torque limits, so that all hold at
// the end of the step. The inertia is that of the implicit step, springs and dampers of tissue and servos in
// it.
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/articulated/cone_solver.h"
#include "handsim/engine/articulated/joint_space.h"
#include "handsim/engine/ode/collider.h"

namespace handsim::engine::articulated {

/// Accelerations of contacts and stops are found to this [m/s^2 or rad/s^2]: a hundred-thousandth of
/// gravity's.
inline constexpr double kContactTolerance = 1e-4;
inline constexpr int kMostSweeps = 500;

class ContactDynamics {
 public:
  /// All must outlive this. @param mechanism without loops. @throws ode::OdeFault
  ContactDynamics(const model::Model& model, const Settings& settings, Mechanism& mechanism);

  /// Forgets the impulses of the last step.
  void forget() { last_.clear(); }
  /// Contacts of the last step, and the impulses that the next one starts from.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  /// Finds the contacts at a state. @return pairs given to the narrow phase. @throws ode::OdeFault
  int collide(const model::State& state);
  std::span<const Contact> contacts() const { return collider_.contacts(); }

  /// Accelerations, into Mechanism::du(), of a step [s] that ends with contacts, stops and torque limits
  /// kept; `kinematics` and the bases' motion have to be found. Leaves which stops and limits are in force.
  ConeReport solve(double step);

 private:
  /// A contact's place among the rows.
  struct Point {
    Cone cone;
    Mat3 frame = Mat3::Identity();  ///< columns: normal, two tangents
    double target = 0;              ///< normal velocity that it is to have at least [m/s]
    double softness = 0;            ///< added to the normal row's W
  };
  struct StopRow {
    std::size_t axis = 0;  ///< of `axes_`
    double side = 0;
    double target = 0;  ///< outward rate that it may have at most
  };
  /// A coordinate with a stop or a servo.
  struct Coordinate {
    int dof = 0;
    AxisView axis;
    const double *q = nullptr, *u = nullptr;
    double row_side = 0;  ///< its stop is among the rows
    double held = 0;      ///< its impulse [N m s] or [N s], from solution to solution
  };
  struct Remembered {
    int shape_a = 0, shape_b = 0, index = 0;
    Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();  ///< world
  };

  template <class Archive, class T>
  static void carry(Archive& archive, T& remembered);
  void find_points(double step);
  void recall(std::size_t contact, int index, std::size_t& from);
  void remember(double step);
  Vec3 relative_velocity(const Contact& contact) const;
  Vec3 relative_spin(const Contact& contact) const;
  int body_of(int shape) const { return model_.shapes[static_cast<std::size_t>(shape)].body; }
  double inverse_mass(int shape) const;
  void find_free(double step);
  void build(double step);
  void add_row(const Contact& contact, const Vec3& direction, bool angular, std::size_t row);
  /// Accelerations with the impulses; false where one passes a stop that is not among the rows, which is
  /// added.
  bool apply(double step);
  bool revise_limits(double step, bool only_first);

  const model::Model& model_;
  Mechanism& mechanism_;
  ode::Collider collider_;
  JointSpace space_;
  ConeSolver solver_;
  bool friction_, with_forces_;
  double erp_;
  std::vector<Coordinate> axes_;
  std::vector<Point> points_;  ///< as the contacts
  std::vector<StopRow> stops_;
  std::vector<Cone> cones_;
  std::vector<double> J_, Y_;  ///< rows by dofs; L^-T J^T
  std::vector<double> free_, x_, start_;
  std::vector<Remembered> last_;
};

}  // namespace handsim::engine::articulated
