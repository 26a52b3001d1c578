// The parts of a scene's reader, one for each kind of block; private to this folder. All take problems into
// the reader's diagnostics and write defaults into the tree.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/settings.h"
#include "handsim/scene/read/file_kind.h"
#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

inline const Quantity kCoordinate = {Dimension::length, -1000, 1000};
inline const Quantity kVelocity = {Dimension::speed, -100, 100};
inline const Quantity kAngularVelocity = {Dimension::angular_speed, -1000, 1000};

/// `hands.0`.
std::string item_path(std::string_view list, std::size_t i);
/// Reads each block of an optional list; of more than `most` none, with a problem.
void each_block(MapReader& reader, std::string_view key, std::size_t most,
                const std::function<void(MapReader)>& read);
/// `position` and `rotation`. @param fallback position where none is given; absent: it must be.
Pose read_pose(MapReader& reader, std::optional<Vec3> fallback = {});

/// A referenced file or an inline block; null, with a problem, where it cannot be read.
YamlNode* referenced(MapReader& reader, std::string_view key, FileKind kind);

/// Puts what the file of an entry says under the keys that the entry leaves open, in place of its `file`.
/// @param overridden true where the entry's own keys leave the file's `key` without a say. False, with
/// problems, where the file cannot be used.
bool inline_file(YamlNode& entry, const std::string& path, FileKind kind,
                 bool (*overridden)(const YamlNode& entry, const std::string& key), Diagnostics& diagnostics);

/// Kind and size of a solid: `kind_key` names the kind. The pose is that of its centre: a mesh's lies off the
/// origin of its file. False, with a problem, where the kind cannot be told,
/// and so neither which sizes it has.
bool read_solid(MapReader& reader, std::string_view kind_key, model::Shape& shape);
/// The surface of a thing: `material`, one of the scene's by name, or its properties.
model::Material read_surface(MapReader& reader, std::string name,
                             const std::vector<model::Material>& materials);
/// The material of a name; nothing, with a problem, where there is none.
std::optional<model::Material> named_material(MapReader& reader, std::string_view key,
                                              const std::vector<model::Material>& materials);

/// The `contacts` block: named materials, and who meets whom.
ContactsSpec read_contacts(MapReader& reader);
/// What the rules of the contacts block, where it has any, say by group is checked against the scene's
/// things.
void check_contact_groups(const SceneSpec& scene, Diagnostics& diagnostics);
/// The effects that the rules of the contacts block need.
model::Effects effects_of_rules(const SceneSpec& scene);

/// The `hands` and `objects` lists; absent: none.
/// A driven wrist may lack a motion, a rail its place, and a grasped object its place: grasps and climbs give
/// them.
std::vector<HandEntry> read_hands(MapReader& reader, bool grasped, bool climbed);
/// @param beside_hand sizes that are hardly meant beside a hand are warned of.
std::vector<ObjectSpec> read_objects(MapReader& reader, const std::vector<model::Material>& materials,
                                     const std::vector<GraspSpec>& grasps, bool beside_hand);
std::optional<GroundSpec> read_ground(MapReader& reader, const std::vector<model::Material>& materials);

/// The `effects` list, with `auto` resolved and written out. Reads nothing but the scene's content.
model::Effects read_effects(MapReader& reader, const SceneSpec& scene);

/// Engine, step and the engine's own settings; keys of other engines are refused. Where the command line
/// names the engine, such keys of the file are left out, with a warning.
void read_settings(MapReader& reader, engine::Settings& solver);
/// Takes keys out of a `solver` block whose `engine` the command line names and which the file states; given
/// on the command line, or beside the file's own engine, they are problems.
/// @param need what is needed in a key's place; nothing: the key may stand. @param why they are left out
void refuse_keys(MapReader& reader, const std::function<std::optional<std::string>(const YamlEntry&)>& need,
                 const std::string& why);
std::optional<engine::GuardLimits> read_guard(MapReader& reader);
bool read_speculative(MapReader& reader);
std::uint64_t read_seed(MapReader& reader);
/// The `solver` block. Effects, mechanism and control have to be read.
void read_solver(MapReader& reader, SceneSpec& scene);
/// Effects that the solver's engine or method does not have.
void check_engine(MapReader& reader, const engine::Settings& solver);
PictureSpec read_pictures(MapReader reader);

}  // namespace handsim::scene
