// The rows of a hand model on their way to bodies: what each of them brings, and how they share space and
// mass. Private to this folder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/hand/build.h"
#include "handsim/hand/cut_capsule.h"
#include "handsim/model/mass_properties.h"

namespace handsim::hand {

/// What one row, or the palm, brings to a body.
struct Piece {
  std::string name;
  int body = 0;
  Pose frame;                                     ///< X_H of the frame in which the poses of its shapes are
  std::vector<model::Shape> shapes;               ///< [0] a segment's own capsule; none: a carrier
  double mass = 0;                                ///< [kg]
  double round = 0;                               ///< radius of a carrier's ball [m]
  std::vector<std::string> of_palm;               ///< shapes that split_palm brings it
  std::optional<Cut> cut;                         ///< of its capsule; absent: the whole capsule is its matter
  std::optional<model::MassProperties> together;  ///< of several shapes at unit density, in the part's frame
  std::optional<model::MassProperties> taken;     ///< that its parent lacks for it, in the parent's frame
};

/// Space that two rows share at zero angles counts once: a plane through the joint divides them. Of a parent
/// that is one box, or goes on beyond the joint, the segment begins where it leaves it.
void share_space(std::vector<Piece>& parts, const HandSpec& spec);

/// Volume of a part's matter [m^3]; a carrier takes its share of the segment after it.
double volume_of(const std::vector<Piece>& parts, std::size_t i);

/// Masses by share of the hand. Without a share the palm gets the remainder, so that all sum to the hand.
void set_masses_by_share(std::vector<Piece>& parts, BuiltHand& hand, const HandSpec& spec,
                         const Person& person);

/// Masses by volume; a measured hand mass scales them.
void set_masses_by_volume(std::vector<Piece>& parts, BuiltHand& hand, const HandSpec& spec,
                          const Person& person);

/// Gives the parts of the palm their shapes, and of its mass what it would lack without them: what their
/// shapes share with the rest of it stays there. The sum of both is the palm, to rounding.
void split_palm(std::vector<Piece>& parts, const HandSpec& spec);

}  // namespace handsim::hand
