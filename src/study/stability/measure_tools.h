// Functions for the measures of hard cases: the measured time span, the bodies and the joint that a case
// names, and the tables of measures.
#pragma once

#include "handsim/study/stability/stability_measures.h"

namespace handsim::study {

/// True if the present time is within the measured span.
bool within(const MeasureSpec& spec, const simulation::Simulation& now);

/// Replaces the figure if the value is larger.
void keep_larger(std::optional<Figure>& figure, double value, const std::string& where);

/// Index of a body. @throws Error (input) if the scene has none of this name.
std::size_t body_of(const scene::Scene& scene, const std::string& name);
/// The body that the settings name, or all that are not kinematic.
std::vector<std::size_t> bodies_of(const scene::Scene& scene, const MeasureSpec& spec);

/// A joint coordinate; values in rad or m.
struct Coordinate {
  const model::Joint* joint = nullptr;
  std::size_t axis = 0;

  double value(const model::State& state) const;
  double rate(const model::State& state) const;
};

/// @param name `joint` or `joint.axis`. @throws Error (input) if the scene has none of this name.
Coordinate coordinate_of(const scene::Scene& scene, const std::string& name);

inline constexpr MeasureNeeds kNothing = {}, kBody = {.body = true}, kJoint = {.joint = true};

// The measures.
std::span<const MeasureKind> motion_measures();
std::span<const MeasureKind> joint_measures();
std::span<const MeasureKind> run_measures();
std::span<const MeasureKind> procedures();

}  // namespace handsim::study
