// The muscles of a hand model file: rows with moment arms on a hand of a stated size, forces of a person of a
// stated grip strength, and bands between joints and tendons. build_muscles() scales them to a person.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/anthropometry.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/model/muscle.h"

namespace handsim::hand {

/// A tendon's arms by axes of the hand: wrist axes first, then those of the segments in their order.
struct TendonSpec {
  std::string name;
  model::TendonPath path;  ///< `dof` is the number of the axis; arms of the reference hand
};

struct MuscleSpec {
  TendonSpec tendon;
  std::string nerve;         ///< may be empty
  double force = 0;          ///< of the reference person [N]
  double fibre_length = 0;   ///< optimal, of the reference hand [m]
  double tendon_length = 0;  ///< slack, of the reference hand [m]
  double pennation = 0;      ///< [rad]
  double rest = 1;           ///< fibre length at the joints' rest angles, over the optimal one
  double activation_time = 0.015, deactivation_time = 0.05;  ///< [s]
  double excitable = 1, effort = 1;                          ///< of model::Muscle

  /// What a row says beside its tendon and nerve (core/fields.h).
  template <class Visit>
  static void fields(Visit&& visit) {
    constexpr Quantity kTime{Dimension::time, 1e-4, 1};
    visit("force", &MuscleSpec::force, Quantity{Dimension::force, 0.1, 1e4}, Required{});
    visit("fibre", &MuscleSpec::fibre_length, Quantity{Dimension::length, 1e-3, 1}, Required{});
    visit("tendon", &MuscleSpec::tendon_length, Quantity{Dimension::length, 0, 1}, Required{});
    visit("pennation", &MuscleSpec::pennation, Quantity{Dimension::angle, 0, 1});
    visit("rest", &MuscleSpec::rest, Quantity{Dimension::none, 0.5, 1.5});
    visit("activation_time", &MuscleSpec::activation_time, kTime);
    visit("deactivation_time", &MuscleSpec::deactivation_time, kTime);
  }
};

/// A band across joints.
struct BandSpec {
  TendonSpec tendon;
  double stiffness = 0, damping = 0;  ///< of the reference hand [N/m], [N s/m]
  double rest = 0;                    ///< [m]
  bool both_ways = true;
  std::vector<std::string> between;  ///< muscles whose tendons it joins

  /// What a row says beside its tendon (core/fields.h).
  template <class Visit>
  static void fields(Visit&& visit) {
    visit("stiffness", &BandSpec::stiffness, Quantity{Dimension::stiffness, 0, 1e7}, Required{});
    visit("damping", &BandSpec::damping, Quantity{Dimension::damping, 0, 1e5}, Required{});
    visit("rest", &BandSpec::rest, Quantity{Dimension::length, -0.5, 0.5});
    visit("both_ways", &BandSpec::both_ways);
  }
};

/// What the path of a flexor gains where a pulley of its sheath is torn.
struct PulleySpec {
  std::string name, finger;
  TendonSpec gained;  ///< name of the muscle; arms of the reference hand
};

struct MuscleFile {
  std::string title;
  std::map<std::string, std::string> sources;
  double hand_length = 0;    ///< of the hand that the arms and lengths are of [m]
  double grip_strength = 0;  ///< of the person that the forces are of [N]
  GripTable norms;
  std::vector<MuscleSpec> muscles;
  std::vector<BandSpec> bands;
  /// By the name of a nerve at a level: the muscles that hang on it, with the share of each.
  std::map<std::string, std::map<std::string, double>> nerves;
  /// By the same nerves: the fingers whose pads feel through them, with the share of each.
  std::map<std::string, std::map<std::string, double>> feeling;
  double numb = 0;  ///< share of its muscles' largest effort that a finger without feeling lacks
  /// By a muscle: the neighbours that its effort reaches, with the share of each (model::Spill).
  std::map<std::string, std::map<std::string, double>> spill;
  std::vector<std::string> common_drive;  ///< muscles of model::Muscle::common_drive
  double common_share = 1;                ///< that number
  std::vector<PulleySpec> pulleys;
  std::map<std::string, double> spread;  ///< as HandSpec::spread
};

/// An axis of a hand, in the order of TendonSpec.
struct HandAxis {
  std::string name;                 ///< e.g. `index_mcp.flexion`, `wrist.flexion`
  double low = -M_PI, high = M_PI;  ///< range [rad]
  double rest = 0;                  ///< rest angle of its tissue [rad]
  double held = 0;                  ///< where the mount omits the axis [rad]
};

/// Standard deviations by these names: of ln of a size; `ranges` is an angle [rad].
std::map<std::string, double> read_spread(MapReader reader, std::initializer_list<const char*> names);

/// Reads `muscles`; problems go into the diagnostics. @param axes of the hand; absent: any name is one
MuscleFile read_muscle_file(const YamlNode& node, const std::string& path,
                            const std::optional<std::vector<HandAxis>>& axes, Diagnostics& diagnostics);

/// Adds a path with a sign; products stay among its own arms.
void add_path(const model::TendonPath& path, double sign, model::TendonPath& to);

/// The axis is a joint's of this finger.
bool turns(const HandAxis& axis, const std::string& finger);

/// The muscle crosses the wrist: its belly lies in the forearm.
bool is_extrinsic(const MuscleSpec& muscle, const std::vector<HandAxis>& axes);

/// Muscles and bands of a person's hand; `dof` is the number of an axis.
struct HandMuscles {
  std::vector<model::Muscle> muscles;
  std::vector<model::Band> bands;
  double strength = 1;  ///< factor on the reference person's forces
};

/// Arms, fibres, tendons and the stiffness of bands scale with hand length; forces with the person's or
/// the norm's grip strength, and below the norm's smallest stature with the square of stature, as areas do.
HandMuscles build_muscles(const MuscleFile& file, const std::vector<HandAxis>& axes, const HandSize& size,
                          const Person& person);

}  // namespace handsim::hand
