#include "handsim/scene/read/scene_file.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/contact_groups.h"
#include "handsim/scene/read/effects.h"
#include "handsim/scene/read/task_checks.h"

namespace handsim::scene {

namespace {

constexpr std::size_t kLongestTitle = 1000;
constexpr std::size_t kMostTasks = 60;

void check_times(MapReader& reader, const SceneSpec& scene) {
  const double steps = scene.duration / scene.solver.step;
  if (steps > 1e9) reader.problem("duration", fmt::format("{:g} steps", steps), "at most 1e9 steps");
  if (steps < 0.5) reader.problem("duration", fmt::format("{:g} of a step", steps), "at least one step");
  const auto warn_if_rounded = [&](const char* key, double time) {
    const double ratio = time / scene.solver.step;
    if (std::abs(ratio - std::round(ratio)) > 1e-6 * ratio || ratio < 0.5)
      reader.warning(key, fmt::format("{:g} s is not a multiple of the step of {:g} s: rounded to steps",
                                      time, scene.solver.step));
  };
  warn_if_rounded("duration", scene.duration);
  warn_if_rounded("record.every", scene.record_every);
}

Tasks read_tasks(MapReader& reader, std::span<const TaskKind> kinds) {
  Tasks tasks;
  for (const TaskKind& kind : kinds) {
    std::size_t i = 0;
    reader.each(kind.list, 0, kMostTasks, [&](MapReader block) {
      std::unique_ptr<TaskSpec> task = kind.read(block);
      task->kind = &kind;
      task->place = block.node().place();
      task->path = item_path(kind.list, i++);
      tasks.push_back(std::move(task));
      block.finish();
    });
  }
  return tasks;
}

void read_content(MapReader& reader, SceneSpec& scene, Diagnostics& diagnostics) {
  scene.hands = read_hands(reader, scene.tasks);
  scene.contacts = read_contacts(reader);
  scene.objects = read_objects(reader, scene.contacts.materials, scene.tasks, !scene.hands.empty());
  const bool read = reader.sound();
  check_task_objects(scene, diagnostics);
  if (read) check_task_hands(scene, diagnostics);
  std::vector<std::string> taken = scene.object_names();
  taken.insert(taken.end(), {"world", "ground"});
  scene.mechanism = read_mechanism(reader, std::move(taken), scene.contacts.materials);
  if (reader.sound() && scene.hands.empty() && scene.objects.empty() && scene.mechanism.bodies.empty())
    reader.problem("hands", "no hand, no object and no body", "at least one");
  scene.ground = read_ground(reader, scene.contacts.materials);
  scene.gravity = reader.vector("gravity", {Dimension::acceleration, -1000, 1000}, scene.gravity);
  if (reader.sound()) check_contact_groups(scene, diagnostics);
  scene.excitations = read_excitations(reader);
  if (reader.has("control"))
    scene.control = read_control(reader.map("control"), scene.hands, !scene.tasks.empty());
  if (reader.sound()) check_task_programs(scene, diagnostics);
}

void read_run(MapReader& reader, SceneSpec& scene, Diagnostics& diagnostics) {
  const std::size_t before = diagnostics.problems.size();
  read_solver(reader, scene);
  if (reader.sound()) check_engine(reader, scene.solver);
  std::optional<double> duration;
  if (!scene.tasks.empty()) duration = std::max(scene.tasks_end(), 1e-3);
  scene.duration = reader.number("duration", {Dimension::time, 1e-6, 1e5}, duration);
  MapReader record = reader.map("record");
  scene.record_every = record.number("every", {Dimension::time, 1e-6, 1e5}, 0.01);
  scene.record_contacts = record.flag("contacts", false);
  scene.tables.bodies = record.flag("bodies", false);
  scene.tables.markers = record.flag("markers", false);
  scene.tables.momentum = record.flag("momentum", false);
  scene.tables.reactions = record.flag("reactions", false);
  record.finish();
  if (diagnostics.problems.size() == before) check_times(reader, scene);
  const bool muscles = scene.solver.effects.has(model::Effect::muscles);
  PictureSpec pictures;
  pictures.muscles = muscles;
  pictures.follow = std::ranges::any_of(scene.tasks, [](auto& task) { return task->kind->moves_object; });
  scene.pictures = read_pictures(reader.map("pictures"), pictures);
  scene.solver.contact_forces = scene.record_contacts || scene.pictures.contact_forces ||
                                !scene.tasks.empty() ||
                                (scene.tables.reactions && scene.solver.effects.any_contact());
  if (scene.solver.contact_forces && !scene.solver.effects.any_contact())
    reader.warning(scene.record_contacts ? "record" : "pictures",
                   "contact forces are requested, but no effect of contact is on");
  for (const HandEntry& hand : scene.hands)
    for (const auto& [key, value] : {std::pair("tendon_strain", hand.placement.tendon_strain),
                                     std::pair("short_range_stiffness", hand.placement.short_range)})
      if (value && !(muscles && hand.model->muscles))
        reader.warning(
            "hands", fmt::format("{}: {} is given, but {}", hand.placement.name, key,
                                 muscles ? "the hand model has no muscles" : "the effect muscles is not on"));
}

}  // namespace

std::vector<std::string> SceneSpec::object_names() const {
  std::vector<std::string> out;
  for (const ObjectSpec& object : objects) out.push_back(object.name);
  for (const auto& task : tasks)
    if (task->support) out.push_back(*task->support);
  return out;
}

double SceneSpec::tasks_end() const {
  double end = 0;
  for (const auto& task : tasks) end = std::max(end, task->end());
  return end;
}

SceneSpec read_scene(const YamlNode& root, std::span<const TaskKind> kinds, Diagnostics& diagnostics) {
  SceneSpec scene;
  if (!is_of_kind(root, "", FileKind::scene, diagnostics)) return scene;
  MapReader reader(root, "", diagnostics);
  scene.title = reader.text("title", "untitled");
  if (scene.title.size() > kLongestTitle)
    reader.problem("title", fmt::format("a text of {} bytes", scene.title.size()),
                   fmt::format("at most {} bytes", kLongestTitle));
  scene.tasks = read_tasks(reader, kinds);
  read_content(reader, scene, diagnostics);
  scene.solver.effects = read_effects(reader, scene);
  read_run(reader, scene, diagnostics);
  scene.criteria = read_criteria(reader.map("criteria"));
  if (reader.sound()) check_criteria(reader.map("criteria"), scene);
  reader.finish();
  scene.files = diagnostics.resolution.files;
  return scene;
}

}  // namespace handsim::scene
