// Closes the fingers of a hand on an object, each until it touches: geometry only. A finger goes from its
// open angles towards its closed ones; a part that touches stops the joints before it, and the joints beyond
// it go on until the next part touches or the closed angles are reached.
#pragma once

#include <vector>

#include "handsim/scene/task/hand_on_object.h"

namespace handsim::scene {

/// A chain of segments from the palm to a fingertip.
struct FingerChain {
  model::Part part = model::Part::index;
  std::vector<std::size_t> axes;  ///< in HandAxes::axes, from the palm outwards
  std::vector<int> bodies;        ///< from the palm outwards
  std::size_t watched = 0;        ///< these bodies, in HandOnObject
};

/// The chains of a hand, in the order of its joints.
std::vector<FingerChain> finger_chains(HandOnObject& hand);

class Closing {
 public:
  /// @param open, closed angles by axis [rad]. The hand must outlive this.
  Closing(HandOnObject& hand, std::vector<double> open, std::vector<double> closed);

  const std::vector<FingerChain>& chains() const { return chains_; }
  /// True if the finger's closed angles differ from its open ones.
  bool moves(const FingerChain& chain) const;
  /// Turns the thumb's first axis, of all poses, by this angle from the named ones [rad]: how far it stands
  /// opposite the fingers.
  void oppose(double turn);
  /// Angles on the way from open (share 0) to closed (1), or on the way back beyond open (below 0), within
  /// the joints' ranges.
  std::vector<double> at(double share) const;
  /// Opens the fingers that touch the object anywhere on its way into the hand until they are clear of it.
  /// @param from start of the hand's approach, in the hand frame [m]; false: a finger cannot be opened so far
  bool open_clear(const Pose& x_HO, const Vec3& from);
  /// The angles before the fingers close: those of `open`, or wider.
  const std::vector<double>& open() const { return open_; }
  /// Angles with each finger closed on the object. @param depth to which the bodies press [m], by body
  std::vector<double> close(const std::vector<double>& depth);
  /// Angles with which the points of the fingers go into the object and do not slide on it: what slides while
  /// it is pressed is left with friction that nobody planned. @param q from where @param contacts there, in
  /// the hand frame
  /// @param deeper by which each body is pressed [m], by body @param moved by which the object moves [m]
  std::vector<double> press(const std::vector<double>& q, const std::vector<TouchPoint>& contacts,
                            const std::vector<double>& deeper, const Vec3& moved);

 private:
  void press(const FingerChain& chain, const std::vector<TouchPoint>& contacts,
             const std::vector<double>& deeper, const Vec3& moved, const std::vector<double>& from,
             std::vector<double>& q);
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
