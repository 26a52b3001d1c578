// Closes each finger of a hand from open angles towards closed ones until it touches an object: geometry
// only. A part that touches stops the joints before it; the joints beyond go on until the next part touches.
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
  int body = 0;                          ///< of the hand, in the model
  Vec3 point = Vec3::Zero();             ///< hand frame [m]
  Vec3 normal = Vec3::Zero();            ///< unit, out of the hand into the object
  double depth = 0;                      ///< [m]
  double friction = 0;                   ///< coefficient
  double spinning = 0;                   ///< moment about the normal over the normal force [m]
  double share = 1;                      ///< of the pad of its pair of shapes
  std::optional<model::Compliance> pad;  ///< absent: rigid
  double planned = 0;                    ///< normal force that it shall have [N]
  bool of_palm = false;                  ///< also of a pad that a segment carries

  /// Force of the pad when it is pressed by so much more [m], and lasts [N].
  double push(double deeper = 0) const;
};

/// How much deeper the pads of a part have the sum of its planned forces, within 2 mm, and their stiffness on
/// that way.
struct PadMove {
  double deeper = 0;     ///< [m]
  double stiffness = 0;  ///< of a whole pad [N/m]; 0: rigid
};
PadMove pad_move(std::span<const TouchPoint> of_part);

/// A right hand at the world's origin and an object in it: where the two touch at given joint angles, with
/// the scene's contact rules and its engines' collision tests, so that a run finds what is planned.
class HandOnObject {
 public:
  explicit HandOnObject(const TaskSite& site);
  HandOnObject(const HandOnObject&) = delete;
  HandOnObject& operator=(const HandOnObject&) = delete;

  const model::Model& model() const { return model_; }
  const control::HandAxes& axes() const { return axes_; }
  int palm() const { return model_.hands.front().palm; }
  model::Part part(int body) const { return parts_[as_index(body)]; }
  /// Puts the object. @param x_HO its frame in the hand frame
  void place(const Pose& x_HO) { x_HO_ = x_HO; }
  /// All points at which the hand touches the object. @param q size model().dof_count() [rad]
  const std::vector<TouchPoint>& touches(std::span<const double> q);
  /// Touches of a finger's segments, without pads of the palm that they carry. @returns number for `depths`
  std::size_t watch(std::span<const int> bodies);
  /// Those of the palm and its pads.
  std::size_t watch_palm();
  /// Deepest of the points of each watched body, by body of the model [m]; 0: it does not touch.
  const std::vector<double>& depths(std::span<const double> q, std::size_t watched);
  /// Jacobian of a point that moves with a body, at q. @param point in the hand frame [m]
  model::Jacobian jacobian(std::span<const double> q, int body, const Vec3& point);

 private:
  /// The model with the shapes of a few bodies and of the object only.
  struct Watched {
    model::Model model;
    std::unique_ptr<engine::Collider> collider;
  };
  void move(std::span<const double> q);
  template <class Watches>
  std::size_t watch_shapes(Watches watches);

  model::Model model_;
  control::HandAxes axes_;
  std::vector<model::Part> parts_;  ///< of the bodies, by their first shapes
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

/// A chain of segments from the palm to a fingertip.
struct FingerChain {
  model::Part part = model::Part::index;
  std::vector<std::size_t> axes;  ///< in HandAxes::axes, from the palm outwards
  std::vector<int> bodies;        ///< from the palm outwards
  std::size_t watched = 0;        ///< these bodies, in HandOnObject
};

class Closing {
 public:
  /// @param open, closed angles by axis [rad]. The hand must outlive this.
  Closing(HandOnObject& hand, std::vector<double> open, std::vector<double> closed);

  const std::vector<FingerChain>& chains() const { return chains_; }
  /// True if the finger's closed angles differ from its open ones.
  bool moves(const FingerChain& chain) const { return way(chain) > 1e-9; }
  /// Turns the thumb's first axis, of all poses, by this angle [rad]: how far it is opposite the fingers.
  void oppose(double turn);
  /// Angles from open (share 0) to closed (1), or back beyond open (below 0), within the joints' ranges.
  std::vector<double> angles_at(double share) const;
  /// Opens the fingers that touch the object anywhere on its way into the hand until they are clear of it.
  /// @param from start of the hand's approach, in the hand frame [m]; false: a finger cannot be opened so far
  bool open_clear(const Pose& x_HO, const Vec3& from);
  /// The angles before the fingers close: those of `open`, or wider.
  const std::vector<double>& open() const { return open_; }
  /// Angles with each finger closed on the object. @param depth to which the bodies press [m], by body
  std::vector<double> close(const std::vector<double>& depth);
  /// Angles nearer to those at which pads have the planned forces: the fingers' points go into the object
  /// without sliding, which would leave unplanned friction. @param q from where. @param contacts there, in
  /// the hand frame. @param moved the object's way [m]
  std::vector<double> press(const std::vector<double>& q, const std::vector<TouchPoint>& contacts,
                            const Vec3& moved);

 private:
  void press(const FingerChain& chain, const std::vector<TouchPoint>& contacts, const Vec3& moved,
             const std::vector<double>& from, std::vector<double>& q);
  /// Angle of the chain's fastest axis from open to closed [rad].
  double way(const FingerChain& chain) const;
  double angle(std::size_t axis, double share) const;
  bool touches(const FingerChain& chain, const std::vector<double>& q);
  void close(const FingerChain& chain, const std::vector<double>& depth, std::vector<double>& q);

  HandOnObject& hand_;
  std::vector<FingerChain> chains_;
  std::vector<double> start_, closed_;  ///< the path; `open_` lies on it
  std::vector<double> open_;
  double opposed_ = 0;  ///< turn of the thumb
};

}  // namespace handsim::scene
