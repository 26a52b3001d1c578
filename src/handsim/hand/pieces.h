// The rows of a hand model on their way to bodies: what each of them brings, and how they share space and
// mass. Private to this folder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/hand/built_hand.h"
#include "handsim/hand/cut_capsule.h"
#include "handsim/model/mass_properties.h"

namespace handsim::hand {

/// What one row, or the palm, brings to a body: first the palm, then a part for each row, then what rows with
/// a size of their own carry of the palm.
struct Piece {
  std::string name;
  int body = 0;
  Pose frame;                                     ///< X_H of the frame in which the poses of its shapes are
  std::vector<model::Shape> shapes;               ///< [0] a segment's own capsule; none: a carrier
  std::vector<model::Shape> matter;               ///< has its mass in place of its shapes; empty: they do
  double mass = 0;                                ///< [kg]
  double round = 0;                               ///< radius of a carrier's ball [m]
  std::vector<std::string> of_palm;               ///< shapes that the palm brings it
  std::size_t row = 0;                            ///< in HandSpec::segments, of whom brings or carries it
  std::optional<Cut> cut;                         ///< of its capsule; absent: the whole capsule is its matter
  std::optional<model::MassProperties> together;  ///< of several shapes at unit density, in the part's frame
  std::optional<model::MassProperties> taken;     ///< that its parent lacks for it, in the parent's frame

  /// What has its mass.
  const std::vector<model::Shape>& solids() const { return matter.empty() ? shapes : matter; }
};

/// Sets the parts' masses and the hand's, its palm's volume and parts: space that rows share counts once, by
/// volume or by share of the hand, and parts of the palm take their shapes and matter from it.
void set_masses(std::vector<Piece>& parts, BuiltHand& hand, const HandSpec& spec, const Person& person);

}  // namespace handsim::hand
