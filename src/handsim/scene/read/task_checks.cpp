#include "handsim/scene/read/task_checks.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

void problem(const TaskSpec& task, const std::string& key, std::string got, std::string need,
             Diagnostics& diagnostics) {
  diagnostics.problems.push_back({task.place, task.path + key, std::move(got), std::move(need)});
}

/// @param taken the task of each hand so far.
void check_hand(const SceneSpec& scene, const TaskSpec& task, std::vector<const TaskSpec*>& taken,
                Diagnostics& diagnostics) {
  const auto hand = hand_of(scene, task);
  const auto report = [&](std::string got, std::string need) {
    problem(task, ".hand", std::move(got), std::move(need), diagnostics);
  };
  if (!hand) {
    std::vector<std::string> known;
    for (const HandEntry& entry : scene.hands) known.push_back(entry.placement.name);
    return report(task.hand.value_or("nothing, in a scene with several hands or none"),
                  fmt::format("a hand of the scene: {}", fmt::join(known, ", ")));
  }
  const hand::Placement& placement = scene.hands[*hand].placement;
  const bool rail = task.kind->mount == hand::Mount::rail;
  if (placement.mount != task.kind->mount || !placement.motion.keys.empty())
    report(std::string("a hand that ") + task.kind->what + " cannot place",
           rail ? "wrist.mount rail" : "wrist.mount driven without a motion");
  else if (taken[*hand])
    report(fmt::format("a hand that {} moves", taken[*hand]->path), "one task per hand");
  taken[*hand] = &task;
}

void check_object(const SceneSpec& scene, const TaskSpec& task, Diagnostics& diagnostics) {
  const auto object = object_of(scene, task);
  const bool moves = task.kind->moves_object;
  if (object && scene.objects[*object].is_static != moves) return;
  std::vector<std::string> known;
  for (const ObjectSpec& each : scene.objects)
    if (each.is_static != moves) known.push_back(each.name);
  problem(task, std::string(".") + task.kind->object,
          task.object + (!object ? ", which is no object of the scene"
                         : moves ? ", which does not move"
                                 : ", which moves"),
          fmt::format("a {} object of the scene{}", moves ? "free" : "static",
                      known.empty() ? "" : ": " + need_word(task.object, known)),
          diagnostics);
  // The object that was meant has no place of its own.
  if (!object && moves)
    std::erase_if(diagnostics.problems, [](const Problem& each) {
      return each.key.starts_with("objects.") && each.key.ends_with(".position") && each.got == "nothing";
    });
}

/// A hand whose mount relies on a task needs one.
void check_unplaced(const SceneSpec& scene, std::size_t hand, Diagnostics& diagnostics) {
  const auto report = [&](const char* key, const char* got, const char* need) {
    diagnostics.problems.push_back({scene.hands[hand].place, item_path("hands", hand) + key, got, need});
  };
  const hand::Placement& placement = scene.hands[hand].placement;
  const auto places = [&](const auto& task) { return task->kind->mount == placement.mount; };
  if (std::ranges::none_of(scene.tasks, places)) return;
  if (placement.mount == hand::Mount::rail)
    report(".wrist.mount", "a rail without a climb", "a climb of this hand, or another mount");
  else if (placement.motion.keys.empty())
    report(".wrist.motion", "nothing", "a mapping with keyframes, or a grasp of this hand");
}

}  // namespace

std::optional<std::size_t> hand_of(const SceneSpec& scene, const TaskSpec& task) {
  if (!task.hand && scene.hands.size() == 1) return 0;
  for (std::size_t i = 0; i < scene.hands.size(); ++i)
    if (scene.hands[i].placement.name == task.hand) return i;
  return std::nullopt;
}

std::optional<std::size_t> object_of(const SceneSpec& scene, const TaskSpec& task) {
  for (std::size_t i = 0; i < scene.objects.size(); ++i)
    if (scene.objects[i].name == task.object) return i;
  return std::nullopt;
}

void check_task_objects(const SceneSpec& scene, Diagnostics& diagnostics) {
  const bool named =
      std::ranges::none_of(scene.objects, [](const ObjectSpec& object) { return object.name.empty(); });
  for (const auto& task : scene.tasks)
    if (named && !task->object.empty()) check_object(scene, *task, diagnostics);
}

void check_task_hands(const SceneSpec& scene, Diagnostics& diagnostics) {
  std::vector<const TaskSpec*> taken(scene.hands.size());
  for (const auto& task : scene.tasks) check_hand(scene, *task, taken, diagnostics);
  for (std::size_t i = 0; i < taken.size(); ++i)
    if (!taken[i]) check_unplaced(scene, i, diagnostics);
}

void check_task_programs(const SceneSpec& scene, Diagnostics& diagnostics) {
  for (const auto& task : scene.tasks) {
    const auto report = [&](const char* key, std::string got, std::string need) {
      problem(*task, key, std::move(got), std::move(need), diagnostics);
    };
    const std::string what = task->kind->what;
    if (!scene.control || !scene.control->poses) {
      report("", what + " in a scene without control", "a control block with a controller and poses");
      continue;
    }
    const auto& poses = scene.control->poses->poses;
    std::vector<std::string> known;
    for (const auto& [name, pose] : poses) known.push_back(name);
    const auto check = [&](const char* key, const std::string& pose) {
      if (!poses.contains(pose)) report(key, pose, "a pose of the pose file" + nearest_hint(pose, known));
    };
    check(".open", task->open);
    for (const std::string& pose : task->closed) check(".closed", pose);
    if (!scene.control->programs[*hand_of(scene, *task)].program.empty())
      report("", "a hand with a program of its own", what + ", or a program");
  }
}

}  // namespace handsim::scene
