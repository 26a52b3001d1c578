// The distance field that a hand's skin is the zero of.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::output {

/// All points within a radius of a box, which has no width in a capsule; the radius may change along z, the
/// width along y.
struct Flesh {
  Pose pose;                     ///< X_HS in the spread hand
  Vec3 half = Vec3::Zero();      ///< of the box [m]
  double near = 0, far = 0;      ///< radius at the box's lower and upper end [m]
  int shape = 0;                 ///< index into Model::shapes
  int body = 0;                  ///< index into SkinField::bodies
  double taper = 0;              ///< share of the box that is missing in width at its lower end along y
  Mat3 axes = Mat3::Identity();  ///< its rotation, once the field is made
  double size = 0;               ///< from its centre outward [m], likewise

  double distance(const Vec3& x) const;
  /// False only where the distance is not below d; cheaper.
  bool may_be_within(double d, const Vec3& x) const {
    return d + size > 0 && (x - pose.p).squaredNorm() < (d + size) * (d + size);
  }
  Vec3 end() const { return pose * Vec3(0, 0, half.z()); }
  /// Half of the box about it along the axes of the hand.
  Vec3 reach() const {
    return pose.q.toRotationMatrix().cwiseAbs() * half + Vec3::Constant(std::max(near, far));
  }
};

/// A body that a joint moves: skin beyond a plane through the joint moves with it.
struct Hinge {
  int body = 0;                ///< index into SkinField::bodies
  Vec3 centre = Vec3::Zero();  ///< of the joint, in the spread hand [m]
  Vec3 along = Vec3::UnitY();  ///< normal of the plane, distal
  double width = 0;            ///< half of that over which the share of the body rises from 0 to 1 [m]
};

/// A finger: bodies from a joint with the palm outward.
struct Ray {
  bool thumb = false;
  std::vector<Flesh> flesh;
  std::vector<Hinge> hinges;  ///< by body, from the palm
  double radius = 0;          ///< of its first segment [m]
  double embedded = 0;        ///< depth of the first segment in the palm at its joint [m]
};

/// The field whose zero is a hand's skin, in the hand frame, fingers spread.
class SkinField {
 public:
  SkinField(const model::Model& model, const model::HandIndex& hand);

  /// Negative within the skin; flesh further than the thickness of the palm is left out [m].
  double operator()(const Vec3& x) const;
  /// To the palm, then to each finger [m].
  Eigen::VectorXd distances(const Vec3& x) const;
  /// Shares of the fingers in the motion of skin at a point with these distances, as far as it is beyond
  /// their first joints.
  Eigen::RowVectorXf shares(const Eigen::VectorXd& distances) const;
  /// Shares of the bodies there; they sum to 1.
  Eigen::RowVectorXf weights(const Vec3& x, const Eigen::RowVectorXf& shares) const;
  int nearest_shape(const Vec3& x) const;
  /// All that a skin follows from [nm], of a left hand mirrored: equal for the hands of one person.
  std::vector<std::int64_t> key(bool of_left) const;
  std::vector<int> shapes() const;  ///< in the order of the key
  /// How much nearer a point is to a finger than to the palm, over half the palm's thickness.
  double beyond_palm(const Eigen::VectorXd& distances) const;

  std::vector<int> bodies;                       ///< indices into Model::bodies, the palm first
  std::vector<Pose> rest;                        ///< X_HB, spread
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();  ///< bounds [m]
  double length = 0;                             ///< from the wrist to the farthest fingertip [m]

 private:
  void add_palm(const model::Model& model, const model::HandIndex& hand);
  void add_wrist(bool on_forearm);
  void add_rays(const model::Model& model, const model::HandIndex& hand);
  void spread();
  void shape_rays();
  void add_web();
  void set_hinges();
  double palm(const Vec3& x, double limit) const;

  Pose x_HW_;  ///< with all coordinates at zero
  std::vector<Flesh> palm_, web_, all_;
  std::vector<Flesh> rigid_, pads_;  ///< of the palm: without pads that fingers move, and these
  Flesh stump_;                      ///< of the arm
  std::vector<Ray> rays_;
  double scale_ = 0;  ///< half the palm's thickness [m]
  double cut_ = 0;    ///< y of the plane that ends the wrist [m]
};

}  // namespace handsim::output
