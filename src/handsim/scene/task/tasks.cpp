#include "handsim/scene/task/tasks.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/task_checks.h"

namespace handsim::scene {

namespace {

// A new kind of task needs a file of its own and a line here.
constexpr std::array kKinds = {
    TaskKind{"grasps", "a grasp", "object", true, hand::Mount::driven, read_grasp},
    TaskKind{"climbs", "a climb", "hold", false, hand::Mount::rail, read_climb},
};

/// Rounding of an object's pose within which two tasks agree on it [m], [rad].
constexpr double kPoseTolerance = 1e-6;

/// Combines the plans of all tasks, and reports tasks that exclude each other.
class Planner {
 public:
  Planner(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands, Diagnostics& diagnostics)
      : scene_(scene), hands_(hands), diagnostics_(diagnostics), task_of_object_(scene.objects.size()) {
    for (const HandEntry& hand : scene.hands) plans_.hands.push_back(hand.placement);
    plans_.objects = scene.objects;
    plans_.control = scene.control;
  }

  Plans run() {
    for (const auto& task : scene_.tasks) add(*task);
    return std::move(plans_);
  }

 private:
  void problem(const TaskSpec& task, const std::string& key, std::string got, std::string need) {
    diagnostics_.problems.push_back({task.place, task.path + key, std::move(got), std::move(need)});
  }

  void add(const TaskSpec& task) {
    const std::size_t hand = *hand_of(scene_, task), object = *object_of(scene_, task);
    TaskPlan plan = task.plan({scene_, hand, scene_.hands[hand], hands_[hand], scene_.objects[object]});
    diagnostics_.warnings.insert(diagnostics_.warnings.end(), plan.warnings.begin(), plan.warnings.end());
    diagnostics_.problems.insert(diagnostics_.problems.end(), plan.problems.begin(), plan.problems.end());
    plans_.hands[hand] = std::move(plan.placement);
    place_object(task, object, plan.object_pose);
    if (plan.support) add_support(task, std::move(*plan.support));
    add_program(task, hand, plan.moves);
    if (plan.grasp) plans_.grasps.push_back(std::move(*plan.grasp));
    if (plan.climb) plans_.climbs.push_back(std::move(*plan.climb));
  }

  /// Two tasks of one object must agree on its pose.
  void place_object(const TaskSpec& task, std::size_t object, const Pose& pose) {
    Pose& placed = plans_.objects[object].pose;
    const TaskSpec* other = std::exchange(task_of_object_[object], &task);
    if (!other) {
      placed = pose;
      return;
    }
    const double distance = (placed.p - pose.p).norm(), angle = placed.q.angularDistance(pose.q);
    if (distance > kPoseTolerance || angle > kPoseTolerance)
      problem(task, std::string(".") + task.kind->object,
              fmt::format("a pose of {} {:.3g} m and {:.3g} rad from that of {}", task.object, distance,
                          angle, other->path),
              "tasks that agree on it, or one task for each object");
  }

  void add_support(const TaskSpec& task, ObjectSpec support) {
    const bool taken = std::ranges::any_of(
        plans_.objects, [&](const ObjectSpec& object) { return object.name == support.name; });
    if (taken)
      problem(task, ".support", "an object named " + support.name,
              "another name: the task gives this one to its post");
    else
      plans_.objects.push_back(std::move(support));
  }

  /// Adds the program that opens the hand and closes it later. The hand starts in its open pose.
  void add_program(const TaskSpec& task, std::size_t hand, const std::vector<TaskMove>& moves) {
    control::PoseFile& file = *plans_.control->poses;
    control::ProgramChoice& choice = plans_.control->programs[hand];
    control::ProgramSpec program;
    program.place = task.place;
    for (const TaskMove& move : moves) {
      if (move.pose) file.poses[move.name] = *move.pose;
      program.keys.push_back({move.start, move.time, move.name, task.place});
    }
    choice = {task.path, task.place, task.path};
    while (file.programs.contains(choice.program)) choice.program += '+';
    file.programs[choice.program] = std::move(program);
    hand::Placement& placement = plans_.hands[hand];
    for (const auto& [joint, pose] : file.poses.at(moves.front().name).joints)
      if (joint != scene_.hands[hand].model->wrist.name) placement.start.try_emplace(joint, pose.angles);
  }

  const SceneSpec& scene_;
  const std::vector<hand::BuiltHand>& hands_;
  Diagnostics& diagnostics_;
  std::vector<const TaskSpec*> task_of_object_;
  Plans plans_;
};

}  // namespace

std::span<const TaskKind> task_kinds() { return kKinds; }

Plans make_plans(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands,
                 Diagnostics& diagnostics) {
  return Planner(scene, hands, diagnostics).run();
}

std::vector<TaskMove> moves_through_poses(const TaskSpec& task, double close) {
  std::vector<TaskMove> out = {{0, 0, task.open, std::nullopt}};
  for (const std::string& pose : task.closed) {
    out.push_back({close, task.close_time, pose, std::nullopt});
    close += task.close_time;
  }
  return out;
}

void read_task(MapReader& block, const char* object_key, TaskSpec& task) {
  if (block.has("hand")) task.hand = block.name("hand");
  task.object = block.name(object_key);
  MapReader wrist = block.required_map("wrist", "position and rotation of the hand frame at the object");
  task.wrist = read_pose(wrist);
  wrist.finish();
  task.open = block.text("open");
  task.closed = block.texts("closed", 1, kMostItems, "the name of a pose, or a list of them");
}

void add_phase(TaskSpec& task, std::string name, double span) {
  const double start = task.phases.empty() ? 0 : task.end();
  task.phases.push_back({std::move(name), start, start + span});
}

}  // namespace handsim::scene
