// Numbers of a scene that a reset can change by name, without building anything anew.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "handsim/model/state.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::environment {

/// Distribution of a drawn number; components of a vector are independent.
enum class Distribution {
  uniform,      ///< from a to b
  normal,       ///< mean a, standard deviation b
  log_uniform,  ///< exp of uniform between log a and log b; both above 0
};

/// A number to be drawn at each reset with a seed. Names, units and sizes:
///   gravity             [m/s^2], 3, world axes
///   objects.I.mass      [kg]; its inertia changes in proportion. I counts the scene's objects from 0
///   objects.I.friction  coefficient of its surface; it acts where no contact rule names a material
///   objects.I.position  [m], 3: where its origin starts
///   gains               factor on all gains of the controller
///   torque_limits       factor on all its torque limits
///   q                   [rad] or [m], one for each coordinate: added to where the scene starts it
struct Randomised {
  std::string name;
  Distribution distribution = Distribution::uniform;
  double a = 0, b = 0;
};

/// Sets, reads and draws the numbers above in one scene.
class Variation {
 public:
  /// @param scene to change; it must outlive this object, and no one else may use it.
  explicit Variation(scene::Scene& scene);
  /// Goes on with an equal scene.
  void use(scene::Scene& scene) { scene_ = &scene; }
  /// @returns whether a number is one of the scene's model or control, and not one of its start alone
  static bool changes_scene(std::string_view name) { return name != "q" && !name.ends_with(".position"); }

  /// Sets a number. @throws Error (input) for an unknown name, another size, or numbers out of range.
  void set(std::string_view name, std::span<const double> values);
  /// The values of a number: those of the scene at the start, or those last set.
  std::vector<double> get(std::string_view name) const;
  /// @param start of the scene. @throws Error (input) with all that cannot be drawn: unknown names, bounds
  /// that are not finite, in the wrong order or out of range. Sets numbers: a draw has to follow.
  void check(std::span<const Randomised> randomised, const model::State& start);
  /// Draws all of them: a function of the seed and the names alone. @throws Error (input) as `set`
  void draw(std::span<const Randomised> randomised, std::uint64_t seed);

  /// @returns whether a number that the engine or the controller holds has been set since the last call
  bool take_changed() { return std::exchange(changed_, false); }
  /// @returns whether the start is not the scene's own
  bool moves_start() const { return moves_start_; }
  /// The start with what was set. @param state the scene's own, which is changed
  void place(model::State& state) const;

 private:
  /// Numbers of an object, mass and inertia of one that can move, as the scene has them.
  struct Object {
    double mass = 0;
    Mat3 inertia = Mat3::Zero();
    Vec3 own_position = Vec3::Zero();  ///< of its origin at the start, as the scene has it
    Vec3 position = Vec3::Zero();      ///< as set
  };
  /// The object of a name such as objects.0.mass. @throws Error (input)
  std::size_t object_index(std::string_view name, std::string_view& key) const;
  std::size_t material_of(std::size_t object) const;
  std::size_t size_of(std::string_view name) const;
  void set_of_object(std::string_view name, std::span<const double> values);

  scene::Scene* scene_;
  std::vector<Object> objects_;            ///< as Model::objects
  std::vector<control::DrivenAxis> axes_;  ///< the axes of the scene's control plan, as the scene has them
  double gain_ = 1, torque_limit_ = 1;
  std::vector<double> q_;  ///< added at the start
  bool changed_ = false, moves_start_ = false;
};

}  // namespace handsim::environment
