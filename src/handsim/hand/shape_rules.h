// Lengths and shapes of a hand model file: sums of shares of the person's hand, capsules and boxes.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/anthropometry.h"
#include "handsim/model/model.h"

namespace handsim::hand {

/// A length as a sum of shares of the person's hand dimensions and of metres, e.g. `0.5 HB - 0.5 HT`.
struct LengthRule {
  double metres = 0, lengths = 0, breadths = 0, thicknesses = 0;

  double value(const HandSize& size) const;  ///< [m]
};

using PlaceRule = std::array<LengthRule, 3>;

/// A point in the frame of the rule [m].
Vec3 position(const PlaceRule& rules, const HandSize& size);

/// A capsule between two points, or a box, in the frame of its segment (palm: the hand frame), right hand.
struct ShapeSpec {
  std::string name;
  std::optional<PlaceRule> edges;  ///< full edge lengths of a box; absent: a capsule
  PlaceRule from, to;              ///< ends of a capsule's axis
  LengthRule radius;               ///< of a capsule
  PlaceRule at;                    ///< centre of a box
  Quat rotation = Quat::Identity();
  Place place;  ///< of the row, for messages
};

/// Problem of a size of a built part that is not above 10 um, or above 10 m.
/// @param place, key of its rule
void check_size(const Place& place, const std::string& key, double value, std::vector<Problem>& problems);
void throw_if_any(std::vector<Problem> problems);

/// The shape of a person, its pose in the frame of the rule.
/// @throws Error (input) for a radius, an edge or an axis that is out of range.
model::Shape shape_of(const ShapeSpec& spec, const HandSize& size);

/// A required length above 0.
LengthRule read_length(MapReader& reader, std::string_view key);
/// An optional list of three lengths.
std::optional<PlaceRule> read_place(MapReader& reader, std::string_view key);
/// A list of shapes with unique names; it may be absent if `least` is 0.
std::vector<ShapeSpec> read_shapes(MapReader& reader, std::string_view key, std::size_t least);

}  // namespace handsim::hand
