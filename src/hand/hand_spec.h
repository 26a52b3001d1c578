// The content of a hand model file: rows of segments with rules for their size, and their joints. Segments
// are data: one reader serves every hand.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/anthropometry.h"
#include "handsim/hand/muscle_spec.h"
#include "handsim/model/model.h"

namespace handsim::hand {

/// A length as a share of one of the person's hand dimensions, or fixed.
struct LengthRule {
  enum class Base { metre, hand_length, hand_breadth, hand_thickness };
  double factor = 0;
  Base base = Base::metre;

  double value(const HandSize& size) const;  ///< [m]
};

/// A joint row. Axes are given in the segment's frame (wrist: in the hand frame), for a right hand.
struct JointSpec {
  std::string name;
  model::JointKind kind = model::JointKind::hinge;
  std::vector<model::JointAxis> axes;
};

struct SegmentSpec {
  std::string name;
  model::Part finger = model::Part::index;
  int parent = -1;                              ///< row in HandSpec::segments; kPalm: the palm
  bool has_child = false;                       ///< false: the last segment, whose cap ends at the fingertip
  std::optional<std::array<LengthRule, 3>> at;  ///< joint centre in the parent's frame; absent: distal end
  Quat rotation = Quat::Identity();             ///< q_parent_segment at zero coordinates
  LengthRule length;
  LengthRule radius;
  double mass_share = 0;  ///< of the hand's mass; body_mass_share rule only
  JointSpec joint;
  Place place;  ///< of the row, for messages
};

inline constexpr int kPalm = -1;

/// How the mass of a hand is computed.
struct MassRule {
  enum class Kind {
    body_mass_share,  ///< share of body mass; each segment gets its mass_share of it, the palm the rest
    density,          ///< each part its volume times a density
  };
  Kind kind = Kind::density;
  double male = 0, female = 0, unknown = 0;
  double density = 1000;  ///< [kg/m^3]
  std::string source;
};

struct PalmSpec {
  LengthRule length, breadth, thickness;
  std::array<LengthRule, 3> offset;  ///< of the box's centre from (0, length / 2, 0), hand frame
};

struct HandSpec {
  std::string title;
  std::map<std::string, std::string> sources;
  Anthropometry anthropometry;
  MassRule mass;
  PalmSpec palm;
  JointSpec wrist;
  model::Material skin;
  std::vector<SegmentSpec> segments;  ///< parents before children
  std::optional<MuscleFile> muscles;
};

/// Axes of a hand's joints: the wrist's, then those of the segments.
std::vector<HandAxis> hand_axes(const HandSpec& spec);

/// Reads a hand model, following its `anthropometry` reference.
HandSpec read_hand_spec(YamlNode& node, const std::string& path, Diagnostics& diagnostics);

/// Reports a problem of `axes` if two axes of a joint are not perpendicular or have the same name.
void check_axis_pair(MapReader& reader, const std::vector<model::JointAxis>& axes);

}  // namespace handsim::hand
