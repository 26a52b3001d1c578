#include "handsim/scene/read/scene_spec.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/scene/read/criteria.h"
#include "handsim/scene/read/readers.h"

namespace handsim::scene {

namespace {

constexpr std::size_t kLongestTitle = 1000;

void check_times(MapReader& reader, const SceneSpec& scene) {
  const double steps = scene.duration / scene.solver.step;
  if (steps > 1e9) reader.problem("duration", fmt::format("{:g} steps", steps), "at most 1e9 steps");
  if (steps < 0.5) reader.problem("duration", fmt::format("{:g} of a step", steps), "at least one step");
  const auto warn_if_rounded = [&](const char* key, double time) {
    const double ratio = time / scene.solver.step;
    if (std::abs(ratio - std::round(ratio)) > 1e-6 * ratio || ratio < 0.5)
      reader.warning(key, fmt::format("{:g} s is no multiple of the step of {:g} s: rounded to steps", time,
                                      scene.solver.step));
  };
  warn_if_rounded("duration", scene.duration);
  warn_if_rounded("record.every", scene.record_every);
}

}  // namespace

std::string item_path(std::string_view list, std::size_t i) { return fmt::format("{}.{}", list, i); }

void each_block(MapReader& reader, std::string_view key, std::size_t most,
                const std::function<void(MapReader)>& read) {
  YamlNode* list = reader.list(key, false, std::numeric_limits<std::size_t>::max());
  if (!list) return;
  if (list->items.size() > most)
    return reader.problem(key, list->described(), fmt::format("at most {} {}", most, key));
  for (std::size_t i = 0; i < list->items.size(); ++i)
    read(MapReader(list->items[i], item_path(reader.path_of(key), i), reader.diagnostics()));
}

Pose read_pose(MapReader& reader, std::optional<Vec3> fallback) {
  Pose pose;
  pose.p = reader.vector("position", kCoordinate, std::move(fallback));
  pose.q = reader.rotation("rotation");
  return pose;
}

SceneSpec read_scene(YamlNode& root, Diagnostics& diagnostics) {
  SceneSpec scene;
  if (!is_of_kind(root, "", FileKind::scene, diagnostics)) return scene;
  MapReader reader(root, "", diagnostics);
  scene.title = reader.text("title", "untitled");
  if (scene.title.size() > kLongestTitle)
    reader.problem("title", fmt::format("a text of {} bytes", scene.title.size()),
                   fmt::format("at most {} bytes", kLongestTitle));
  scene.grasps = read_grasps(reader);
  scene.climbs = read_climbs(reader);
  scene.hands = read_hands(reader, !scene.grasps.empty(), !scene.climbs.empty());
  scene.contacts = read_contacts(reader);
  scene.objects = read_objects(reader, scene.contacts.materials, scene.grasps, !scene.hands.empty());
  if (reader.sound() && !scene.grasps.empty()) place_grasps(scene, diagnostics);
  if (reader.sound()) place_climbs(scene, diagnostics);
  std::vector<std::string> taken = {"world", "ground"};
  for (const ObjectSpec& object : scene.objects) taken.push_back(object.name);
  scene.mechanism = read_mechanism(reader, std::move(taken), scene.contacts.materials);
  if (reader.sound() && scene.hands.empty() && scene.objects.empty() && scene.mechanism.bodies.empty())
    reader.problem("hands", "no hand, no object and no body", "at least one");
  scene.ground = read_ground(reader, scene.contacts.materials);
  scene.gravity = reader.vector("gravity", {Dimension::acceleration, -1000, 1000}, scene.gravity);
  if (reader.sound()) check_contact_groups(scene, diagnostics);
  if (reader.has("control"))
    scene.control =
        read_control(reader.map("control"), scene.hands, !scene.grasps.empty() || !scene.climbs.empty());
  if (reader.sound() && !scene.grasps.empty()) add_grasp_programs(scene, diagnostics);
  if (reader.sound()) add_climb_programs(scene, diagnostics);
  scene.solver.effects = read_effects(reader, scene);
  const std::size_t before_times = diagnostics.problems.size();
  read_solver(reader, scene);
  if (reader.sound()) check_engine(reader, scene.solver);
  std::optional<double> duration;
  if (!scene.grasps.empty() || !scene.climbs.empty())
    duration = std::max({grasps_end(scene), climbs_end(scene), 1e-3});
  scene.duration = reader.number("duration", {Dimension::time, 1e-6, 1e5}, duration);
  MapReader record = reader.map("record");
  scene.record_every = record.number("every", {Dimension::time, 1e-6, 1e5}, 0.01);
  scene.record_contacts = record.flag("contacts", false);
  record.finish();
  if (diagnostics.problems.size() == before_times) check_times(reader, scene);
  scene.pictures = read_pictures(reader.map("pictures"));
  scene.solver.contact_forces = scene.record_contacts || scene.pictures.contact_forces ||
                                !scene.grasps.empty() || !scene.climbs.empty();
  if (scene.solver.contact_forces && !scene.solver.effects.any_contact())
    reader.warning(scene.record_contacts ? "record" : "pictures",
                   "contact forces are asked for, but no effect lets anything touch");
  scene.criteria = read_criteria(reader.map("criteria"));
  if (reader.sound()) check_criteria(reader.map("criteria"), scene);
  reader.finish();
  return scene;
}

}  // namespace handsim::scene
