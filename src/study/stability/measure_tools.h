// What the measures of hard cases are made of: the largest value of a run, the bodies and the joint that a
// case names, and the tables of measures by theme.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "handsim/study/stability/stability_measures.h"

namespace handsim::study {

/// True at times [s] within the span that is looked at.
bool within(const MeasureSpec& spec, double time);

/// A largest value, where and when.
class Largest {
 public:
  void book(double value, double time, const std::string& where = {}) {
    if (best_ && !(value > best_->value)) return;
    best_ = {value, time, where};
  }
  const std::optional<Figure>& figure() const { return best_; }

 private:
  std::optional<Figure> best_;
};

/// Index of a body. @throws Error (input) where the scene has none of this name.
std::size_t body_of(const scene::Scene& scene, const std::string& name);
/// The bodies that are meant: the one that is named, or all that move.
std::vector<std::size_t> bodies_of(const scene::Scene& scene, const MeasureSpec& spec);

/// A coordinate, by `joint` or `joint.axis`; rates and values in rad or m.
struct Coordinate {
  const model::Joint* joint = nullptr;
  std::size_t axis = 0;

  double value(const model::State& state) const;
  double rate(const model::State& state) const;
};

/// @throws Error (input) where the scene has none of this name.
Coordinate coordinate_of(const scene::Scene& scene, const std::string& name);

/// A measure from as much of the scene and its own settings as it takes.
template <class M>
std::unique_ptr<Measure> make_of_scene(const scene::Scene& scene, const MeasureSpec& spec) {
  if constexpr (std::is_constructible_v<M, const scene::Scene&, const MeasureSpec&>)
    return std::make_unique<M>(scene, spec);
  else if constexpr (std::is_constructible_v<M, const scene::Scene&>)
    return std::make_unique<M>(scene);
  else if constexpr (std::is_constructible_v<M, const MeasureSpec&>)
    return std::make_unique<M>(spec);
  else
    return std::make_unique<M>();
}

// The measures, by theme.
std::span<const MeasureKind> energy_measures();
std::span<const MeasureKind> motion_measures();
std::span<const MeasureKind> surface_measures();
std::span<const MeasureKind> joint_measures();
std::span<const MeasureKind> run_measures();
std::span<const MeasureKind> procedures();

}  // namespace handsim::study
