// A person's hand as validation measures it: muscles, kinematics, isometric forces; private to this folder.
#pragma once

#include <span>

#include "handsim/model/state.h"
#include "handsim/study/validate/validate.h"

namespace handsim::study {

/// Name of a finger's last segment.
std::string last_segment(const std::string& finger);

/// Unit vector of palmar, dorsal, distal, proximal, ulnar or radial in a last segment's frame (right hand).
Vec3 tip_direction(const std::string& name);

class Subject {
 public:
  Subject(const hand::HandSpec& spec, const hand::Person& person);

  const hand::BuiltHand& hand() const { return hand_; }
  const model::Model& model() const { return model_; }
  /// Coordinate of an axis such as `index_mcp.flexion`, if the hand has it.
  std::optional<int> dof(const std::string& axis) const;
  const model::Muscle* muscle(const std::string& name) const;
  std::vector<double> coordinates(const Angles& pose) const;
  /// Moment arm [m] about an axis.
  double arm(const model::Muscle& muscle, int dof, std::span<const double> q) const;
  /// Moment of tissue about every coordinate [N m].
  std::vector<double> tissue(std::span<const double> q) const;
  /// Moment of tissue, and of muscles without activation, about every coordinate [N m].
  std::vector<double> passive(std::span<const double> q) const;
  /// Moment of bands about every coordinate [N m].
  std::vector<double> bands(std::span<const double> q) const;
  /// Coordinates where some balance: passive moments, bands and the tensions [N] of muscles.
  /// @param free that may turn @throws Error (physics) where none is found
  std::vector<double> balance(std::vector<double> q, const std::vector<int>& free,
                              const std::map<const model::Muscle*, double>& tensions) const;
  /// Coordinates of a finger's joints.
  std::vector<int> finger_dofs(const std::string& finger) const;
  /// Velocity of a point of a finger's segment (first three rows) and angular velocity of the segment by the
  /// finger's joints' rates, in the segment's frame: x ulnar, y distal, z dorsal (right hand).
  /// @param along the segment: the point's y [m]
  Eigen::MatrixXd point_jacobian(const std::string& segment, double along, std::span<const double> q) const;
  /// As above, of any point in the segment's frame.
  Eigen::MatrixXd point_jacobian(const std::string& segment, const Vec3& point,
                                 std::span<const double> q) const;
  /// As point_jacobian(), for the fingertip.
  Eigen::MatrixXd tip_jacobian(const std::string& finger, std::span<const double> q) const;
  /// Pose of a finger's segment in the world.
  Pose segment_pose(const std::string& segment, std::span<const double> q) const;
  /// y [m] in the last segment's frame of the fingertip, and of the centre of its round end.
  double tip(const std::string& finger) const;
  double tip_centre(const std::string& finger) const;
  /// y [m] of the middle of a segment: between its joints, or its joint and the fingertip.
  double middle(const std::string& segment) const;

 private:
  std::size_t body(const std::string& segment) const;
  const model::Shape& shape(const std::string& segment) const;

  hand::BuiltHand hand_;
  model::Model model_;
};

// Largest forces of a hand that is still (press.cpp). Muscles have activations from 0 to 1; moments of the
// fingers that press, and of axes that are `balanced`, balance beside tissue, bands and the stops of axes
// that the pose puts on them. Fused axes, and the wrist where it is not balanced, are held.

/// The largest force along a direction at a fingertip, without a moment [N].
/// @param of: with a `segment` at its middle; its `friction` lets the force lean from the direction
double largest_tip_force(const Subject& subject, const Measurement& of);

/// The largest force between the round ends of the thumb and of a finger, along the line of their centres
/// [N]. @throws Error (physics) where the ends do not face each other
double largest_pinch_force(const Subject& subject, const Measurement& of);

/// The largest moment about an axis [N m].
double largest_moment(const Subject& subject, const Measurement& of);

/// The force with which the fingers press an object to the palm, along the strongest of its `tilts`, in a
/// simulation of `scene` [N]: with the activations of the largest force that the muscles hold where the
/// fingers touch. The palm holds what they push across by its friction; the wrist is held at the angles of
/// the pose, where its moments balance if it is `balanced`. @throws Error (input) as load_scene()
double largest_grip_force(const Measurement& of);

}  // namespace handsim::study
