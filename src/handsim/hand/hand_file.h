// The content of a hand model file: rows of segments with rules for their size, and joints, for every hand.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/anthropometry.h"
#include "handsim/hand/muscle_file.h"
#include "handsim/hand/shape_rules.h"
#include "handsim/model/model.h"

namespace handsim::hand {

/// Names of the fingers.
inline const std::vector<std::pair<std::string_view, model::Part>> kFingers = {
    {"thumb", model::Part::thumb},
    {"index", model::Part::index},
    {"middle", model::Part::middle},
    {"ring", model::Part::ring},
    {"little", model::Part::little}};

/// A joint row. Axes are given in the segment's frame (wrist: in the hand frame), for a right hand.
struct JointSpec {
  std::string name;
  model::JointKind kind = model::JointKind::hinge;
  std::vector<model::JointAxis> axes;
};

struct SegmentSpec {
  std::string name;
  std::string finger;                           ///< any name
  model::Part part = model::Part::index;        ///< the finger with which sums, tables and colours count it
  std::optional<std::size_t> parent;            ///< row in HandSpec::segments; absent: the palm
  bool has_child = false;                       ///< false: the last segment, whose cap ends at the fingertip
  std::optional<std::array<LengthRule, 3>> at;  ///< joint centre in the parent's frame; absent: distal end
  Quat rotation = Quat::Identity();             ///< q_parent_segment at zero coordinates
  LengthRule length;
  LengthRule radius;
  std::vector<ShapeSpec> shapes;  ///< beside the capsule of this length and radius
  double mass_share = 0;          ///< of the hand's mass; body_mass_share rule only
  bool fixed = false;             ///< part of its parent's body; no joint
  /// A body without a shape between two joints of a joint of three axes; the next row is its segment.
  bool carrier = false;
  /// Shapes of the palm that move with this row, in place of a size and shapes of its own; with their mass.
  std::vector<std::string> of_palm;
  std::vector<std::string>
      pads;  ///< shapes of the palm that move with this row beside its own; with their mass
  JointSpec joint;
  Place place;  ///< of the row, for messages
};

/// Share of a segment's mass that is in the carrier, where its joint has three axes.
inline constexpr double kCarrierShare = 0.05;

/// How the mass of a hand is computed.
struct MassRule {
  enum class Kind {
    body_mass_share,  ///< a share of body mass; each part gets its mass_share of it
    tissue_density,   ///< volume times a density; space that rows share at zero angles counts once
    density,          ///< each part its whole volume times a density
  };
  Kind kind = Kind::density;
  double male = 0, female = 0, unknown = 0;
  double density = 1000;  ///< [kg/m^3]
  std::string source;
};

/// One box, or several shapes in the hand frame.
struct PalmSpec {
  LengthRule length, breadth, thickness;
  PlaceRule offset;  ///< of the box's centre from (0, length / 2, 0), hand frame
  std::vector<ShapeSpec> shapes;
  /// Where the palm's matter is, if not in its shapes: they touch and are seen, and have no mass. A part of
  /// the palm that takes a shape takes the matter of its name.
  std::vector<ShapeSpec> matter;
  /// Share of the hand's mass, body_mass_share only. Absent: what segments leave of 1. Present: may be less.
  std::optional<double> mass_share;
  Place place;  ///< for messages
};

/// Between the world and the wrist of a hand that hangs on its wrist: a body with the mass, centre of mass
/// and inertia of shares of body mass and length, on a hinge through its ends.
struct ForearmSpec {
  LengthRule length, radius;
  double male = 0, female = 0, unknown = 0;  ///< shares of body mass
  double centre = 0.5;                       ///< of its length, from the elbow
  /// Radii of gyration about the axes across and along it, in shares of its length.
  double across = 0, along = 0;
  JointSpec joint;
  Place place;  ///< for messages
};

/// A person's share of body mass, of a MassRule or a ForearmSpec.
template <class Shares>
double share_of(const Shares& of, Sex sex) {
  return sex == Sex::male ? of.male : sex == Sex::female ? of.female : of.unknown;
}

struct HandSpec {
  std::string title;
  std::map<std::string, std::string> sources;
  Anthropometry anthropometry;
  MassRule mass;
  PalmSpec palm;
  JointSpec wrist;
  std::optional<ForearmSpec> forearm;
  model::Material skin;
  std::vector<SegmentSpec> segments;  ///< parents before children
  std::optional<MuscleFile> muscles;
  /// Standard deviations by names of kDeviations: of ln of a size, of `ranges` [rad].
  std::map<std::string, double> spread;
};

/// Axes of a hand's joints: the wrist's, the forearm's, then those of the segments.
std::vector<HandAxis> hand_axes(const HandSpec& spec);

/// Reads a hand model, following its `anthropometry` reference.
HandSpec read_hand_spec(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);
/// As read_hand_spec(), but equal trees share what any thread has read.
std::shared_ptr<const HandSpec> shared_hand_spec(const YamlNode& node, const std::string& path,
                                                 Diagnostics& diagnostics);

/// Reports a problem of `axes` if two axes of a joint are not perpendicular or have the same name.
void check_axis_pair(MapReader& reader, const std::vector<model::JointAxis>& axes);

}  // namespace handsim::hand
