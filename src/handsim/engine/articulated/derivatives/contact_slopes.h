// Derivatives of the contacts' part of a step: of the residual F = A x - g - J^T p - servos at its solution x
// by positions and rates. Impulses follow Coulomb's law at the row velocities, so that their derivatives are
// those of Newton's method with the active set of the solution. Places, normals and depths of contacts depend
// on how the two shapes lie to each other: six numbers of a pair, by central differences of the narrow phase.
// How bodies' motion and rows depend on positions is analytic.
#pragma once

#include <string>
#include <vector>

#include "handsim/engine/articulated/contact/contact_dynamics.h"
#include "handsim/engine/articulated/derivatives/dynamics_slopes.h"

namespace handsim::engine::articulated {

/// Derivatives of a contact's place, normal and depth, and relative ones of its share of the pair's stiffness
/// and of its spinning coefficient, by a twist of shape a against shape b about a point; the angular part
/// comes first.
struct ContactResponse {
  Eigen::Matrix<double, 3, 6> place = Eigen::Matrix<double, 3, 6>::Zero(), normal = place;
  Eigen::Matrix<double, 1, 6> depth = Eigen::Matrix<double, 1, 6>::Zero(), share = depth, spin = depth;
};

/// The derivatives of the contacts of a step that was solved.
class ContactSlopes {
 public:
  /// All arguments must outlive this object.
  ContactSlopes(const model::Model& model, Mechanism& mechanism, ContactDynamics& contact,
                const DynamicsSlopes& tree);

  /// Newton steps with the exact matrix from the last solution to rounding; Mechanism::du() and the memory of
  /// the contacts become those of it. @param inertia H with all weights but those of servos
  /// @returns false where the residual does not vanish
  bool refine(const Eigen::MatrixXd& inertia, double step);
  /// Adds J^T (dp/dr) J of the solution.
  void add_stiffness(Eigen::MatrixXd& K);
  /// Adds the derivatives of F by positions, and those by rates without the stiffness. @param start the state
  /// that the step starts from
  void add_slopes(const model::State& start, double step, Eigen::MatrixXd& by_q, Eigen::MatrixXd& by_u);
  /// Contacts whose derivatives hold to one side, or without a part, one sentence each.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  using Law6 = Eigen::Matrix<double, 6, 6>;
  /// A rate that moves a body of the pair: how its position changes the velocities of a and b at their
  /// origins, at the end and the start of the step; and how position and rate change the wrench on a at its
  /// origin.
  struct Column {
    int dof = 0;
    bool of_a = false, of_b = false;
    Spatial end_a = Spatial::Zero(), end_b = end_a, start_a = end_a, start_b = end_a;
    Spatial by_q = end_a, by_u = end_a;
  };
  /// A body of the pair: its velocity at its origin with the rates of the step's end and start.
  struct Partner {
    int node = kNoNode;
    Vec3 origin = Vec3::Zero();
    Spatial end = Spatial::Zero(), start = Spatial::Zero();
  };
  /// Derivatives of a contact by the rate of a column: velocities of a against b at the contact at the end
  /// and the start of the step, place, normal, depth, and relative changes of its share of the pair's
  /// stiffness and of its spinning coefficient.
  struct Change {
    Spatial end = Spatial::Zero(), start = Spatial::Zero();
    Vec3 place = Vec3::Zero(), normal = Vec3::Zero();
    double depth = 0, share = 0, spin = 0;
  };
  /// A contact of the solution.
  struct Point {
    const Contact* contact = nullptr;
    const ContactRows* rows = nullptr;
    const double* r = nullptr;  ///< row velocities
    Mat3 frame;
    Law6 law;             ///< minus the derivative of impulses by r
    Spatial push;         ///< moment and force of the impulses there
    Spatial end, start;   ///< velocity of a against b there
    double by_depth = 0;  ///< derivatives of the target
    double by_approach = 0;
  };
  void factor(const Eigen::MatrixXd& inertia);
  static Law6 law_of(const ContactRows& rows);
  void compute_velocities();
  Partner partner_of(int shape) const;
  void begin_pair(int shape_a, int shape_b);
  void end_pair(Eigen::MatrixXd& by_q, Eigen::MatrixXd& by_u);
  void compute_responses(const Touch& touch, const model::State& start);
  void difference(const Touch& touch, const Pose& x_WA, const Pose& x_WB, int direction);
  void share_depths(const Touch& touch);
  void compute_spinning(const Touch& touch);
  void compute_target(Point& point, const Touch& touch, double step) const;
  void add_contact(Point& point, const ContactResponse& response);
  Spatial twist(const Partner& side, int dof, const Vec3& place) const;
  Change moved(const Point& point, const Column& column, const ContactResponse& response) const;
  Spatial wrench(const Point& point, const Change& change) const;
  void note(const Contact& contact, const std::string& what);
  void note_sides(const Point& point, double largest);

  const model::Model& model_;
  Mechanism& mechanism_;
  ContactDynamics& contact_;
  const DynamicsSlopes& tree_;
  Eigen::MatrixXd K_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factor_;
  std::vector<Spatial> end_;  ///< velocity of each node at the rates of the step's end
  std::vector<Column> columns_;
  Partner a_, b_;
  bool bounces_ = false;                    ///< a contact of the pair has restitution
  Spatial total_ = Spatial::Zero();         ///< wrench of the pair on a, at its origin
  std::vector<ContactResponse> responses_;  ///< of the touch
  Vec3 about_ = Vec3::Zero();               ///< where their twists are
  std::vector<std::string> notes_;
};

}  // namespace handsim::engine::articulated
