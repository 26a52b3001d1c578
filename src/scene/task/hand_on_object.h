// A right hand at the world's origin and an object in it: where the two touch at given joint angles. Has the
// surfaces of the scene's contact rules, and the collision tests of its engines, so that what is planned is
// what a run finds.
#pragma once

#include <span>
#include <vector>

#include "handsim/control/hand_axes.h"
#include "handsim/engine/collision/collider.h"
#include "handsim/model/kinematics.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

/// The deepest point of a part of the hand on a part of the object, or one of several points of one depth.
struct TouchPoint {
  int body = 0;                ///< of the hand, in the model
  Vec3 point = Vec3::Zero();   ///< hand frame [m]
  Vec3 normal = Vec3::Zero();  ///< unit, out of the hand into the object
  double depth = 0;            ///< [m]
  double friction = 0;         ///< coefficient
  double spinning = 0;         ///< moment about the normal over the normal force [m]
  double stiffness = 0;        ///< of the point [N/m]; 0: rigid
};

class HandOnObject {
 public:
  explicit HandOnObject(const TaskSite& site);
  HandOnObject(const HandOnObject&) = delete;
  HandOnObject& operator=(const HandOnObject&) = delete;

  const model::Model& model() const { return model_; }
  const control::HandAxes& axes() const { return axes_; }
  int palm() const { return model_.hands.front().palm; }
  model::Part part(int body) const { return parts_[static_cast<std::size_t>(body)]; }
  /// Puts the object. @param x_HO its frame in the hand frame
  void place(const Pose& x_HO) { x_HO_ = x_HO; }
  /// All points at which the hand touches the object. @param q size model().dof_count() [rad]
  const std::vector<TouchPoint>& touches(std::span<const double> q);
  /// Bodies whose touches are asked for without those of the others. @returns their number for `depths`
  std::size_t watch(std::span<const int> bodies);
  /// Deepest of the points of each watched body, by body of the model [m]; 0: it does not touch.
  const std::vector<double>& depths(std::span<const double> q, std::size_t watched);
  /// Of a point of a body at q, by each coordinate.
  model::Jacobian jacobian(std::span<const double> q, int body, const Vec3& point);

 private:
  /// The model with the shapes of a few bodies and of the object only.
  struct Watched {
    model::Model model;
    std::unique_ptr<engine::Collider> collider;
  };
  void move(std::span<const double> q);

  model::Model model_;
  control::HandAxes axes_;
  std::vector<model::Part> parts_;  ///< of the bodies
  int object_ = 0;                  ///< its body
  Pose body_frame_;                 ///< X_OB
  Pose x_HO_;
  std::unique_ptr<engine::Collider> collider_;
  std::vector<std::unique_ptr<Watched>> watched_;
  model::State state_;       ///< at the angles last asked for
  std::vector<double> q_;    ///< these
  std::vector<bool> moved_;  ///< bodies, by the last change of angles
  std::vector<TouchPoint> touches_;
  std::vector<double> depths_;
};

}  // namespace handsim::scene
