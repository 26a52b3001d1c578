// The parts of a scene's reader, one for each kind of block; private to this folder. All take problems into
// the reader's diagnostics and write defaults into the tree.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/file_kind.h"
#include "handsim/scene/scene_spec.h"

namespace handsim::scene {

inline const Quantity kCoordinate = {Dimension::length, -1000, 1000};
inline const Quantity kVelocity = {Dimension::speed, -100, 100};
inline const Quantity kAngularVelocity = {Dimension::angular_speed, -1000, 1000};

/// `hands.0`.
std::string item_path(std::string_view list, std::size_t i);
/// `position` and `rotation`. @param fallback position where none is given; absent: it must be.
Pose read_pose(MapReader& reader, std::optional<Vec3> fallback = {});

/// Kind and size of a solid: `kind_key` names the kind. False, with a problem, where the kind cannot be told,
/// and so neither which sizes it has.
bool read_solid(MapReader& reader, std::string_view kind_key, model::Shape& shape);
/// `friction` and `restitution`.
model::Material read_surface(MapReader& reader, std::string name);

/// The `hands` and `objects` lists; absent: none.
std::vector<HandEntry> read_hands(MapReader& reader);
std::vector<ObjectSpec> read_objects(MapReader& reader);
std::optional<GroundSpec> read_ground(MapReader& reader);

/// The `effects` list, with `auto` resolved and written out. Reads nothing but the scene's content.
model::Effects read_effects(MapReader& reader, const SceneSpec& scene);

void read_solver(MapReader reader, model::SolverSettings& solver);
/// Effects that the solver's engine or method does not have.
void check_engine(MapReader& reader, const model::SolverSettings& solver);
PictureSpec read_pictures(MapReader reader);
Criteria read_criteria(MapReader reader);

}  // namespace handsim::scene
