// A person, as given in the `person` block or file of a scene.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>

#include "handsim/core/yaml_reader.h"

namespace handsim::hand {

enum class Sex { male, female, unknown };

struct Person {
  std::string title;
  double stature = 1.75;  ///< [m], 0.5..2.5
  double mass = 72;       ///< [kg], 2..400
  Sex sex = Sex::unknown;
  // Measured values replace predicted ones.
  std::optional<double> hand_length;         ///< wrist crease to tip of the middle finger [m]
  std::optional<double> hand_breadth;        ///< across the metacarpal heads [m]
  std::optional<double> hand_circumference;  ///< around the metacarpal heads [m]
  std::optional<double> hand_mass;           ///< [kg]
  std::optional<double> grip_strength;       ///< on a dynamometer [N]
  std::optional<double> age;                 ///< [years]
  /// Measured lengths and radii of segments by name, e.g. `index_proximal` [m]; the hand model gives others.
  std::map<std::string, double> bones, radii;
  std::map<std::string, double> fingers;  ///< measured: crease at the base to tip of thumb, index, middle [m]
  /// Percentile of the hand's length among people of this stature, mass and sex, 0..100 (50: as predicted).
  std::optional<double> hand_length_percentile;
  /// How far this hand is from what is predicted, in standard deviations, by names of kDeviations.
  std::map<std::string, double> deviations;
  std::optional<Place> place;  ///< of the file or block

  double deviation(std::string_view of) const;  ///< 0 where none is given
};

/// What is uncertain about a person's hand: the survey's dimensions, each given those before it and the
/// measured ones; what has a `spread` in the hand model and its muscles; grip strength, with the deviation of
/// the norm.
inline constexpr std::array<std::string_view, 13> kDeviations = {
    "hand_length",    "hand_breadth",     "palm_length",     "hand_circumference", "segments",
    "hand_mass",      "ranges",           "passive_tissue",  "grip_strength",      "extrinsic_arms",
    "intrinsic_arms", "extrinsic_forces", "intrinsic_forces"};

std::string_view name(Sex sex);

/// True if both have the same hands; titles and places in files may differ.
bool same_body(const Person& a, const Person& b);

/// Reads a person; every defect goes into the diagnostics.
Person read_person(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);

}  // namespace handsim::hand
