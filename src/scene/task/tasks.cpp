#include "handsim/scene/task/tasks.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

// A new kind of task: its file, and its line here.
constexpr std::array kKinds = {
    TaskKind{"grasps", "a grasp", "object", true, hand::Mount::driven, read_grasp},
    TaskKind{"climbs", "a climb", "hold", false, hand::Mount::rail, read_climb},
};

/// Two tasks agree on the place of an object where it differs by less: that is rounding [m], [rad].
constexpr double kSamePlace = 1e-6;

/// One pose or a list of them, at least one.
std::vector<std::string> read_pose_names(MapReader& reader, const char* key) {
  const YamlNode* node = reader.child(key);
  std::vector<std::string> out;
  if (node && node->kind == YamlNode::Kind::scalar) out.push_back(node->text);
  if (node && node->kind == YamlNode::Kind::sequence)
    for (const YamlNode& item : node->items) out.push_back(item.text);
  if (out.empty() ||
      std::any_of(out.begin(), out.end(), [](const std::string& name) { return name.empty(); }))
    reader.problem(key, node ? node->described() : "nothing", "the name of a pose, or a list of them");
  return out;
}

/// Combines the plans of all tasks, and reports tasks that exclude each other.
class Planner {
 public:
  Planner(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands, Diagnostics& diagnostics)
      : scene_(scene),
        hands_(hands),
        diagnostics_(diagnostics),
        task_of_hand_(scene.hands.size()),
        task_of_object_(scene.objects.size()) {
    for (const HandEntry& hand : scene.hands) plans_.hands.push_back(hand.placement);
    plans_.objects = scene.objects;
    plans_.control = scene.control;
  }

  Plans run() {
    for (const auto& task : scene_.tasks) add(*task);
    // A task with a problem is reported once, not its idle hand, too.
    for (std::size_t i = 0; diagnostics_.problems.empty() && i < scene_.hands.size(); ++i) check_idle(i);
    return std::move(plans_);
  }

 private:
  void problem(const TaskSpec& task, const std::string& key, std::string got, std::string need) {
    diagnostics_.problems.push_back({task.place, task.path + key, std::move(got), std::move(need)});
  }

  void add(const TaskSpec& task) {
    const auto hand = find_hand(task);
    const auto object = find_object(task);
    if (!hand || !object) return;
    TaskPlan plan = task.plan({*hand, scene_.hands[*hand], hands_[*hand], scene_.objects[*object]});
    diagnostics_.warnings.insert(diagnostics_.warnings.end(), plan.warnings.begin(), plan.warnings.end());
    plans_.hands[*hand] = std::move(plan.placement);
    place_object(task, *object, plan.object_pose);
    if (plan.support) add_support(task, std::move(*plan.support));
    add_program(task, *hand, plan.close);
    if (plan.grasp) plans_.grasps.push_back(std::move(*plan.grasp));
    if (plan.climb) plans_.climbs.push_back(std::move(*plan.climb));
  }

  /// The hand of the task's name, or the only one; nothing, with a problem, where the task cannot have it.
  std::optional<std::size_t> find_hand(const TaskSpec& task) {
    std::vector<std::string> known;
    for (const HandEntry& entry : scene_.hands) known.push_back(entry.placement.name);
    auto at = static_cast<std::size_t>(std::find(known.begin(), known.end(), task.hand) - known.begin());
    if (task.hand.empty() && known.size() == 1) at = 0;
    if (at == known.size()) {
      problem(task, ".hand", task.hand.empty() ? "nothing in a scene of several hands or none" : task.hand,
              fmt::format("a hand of the scene: {}", fmt::join(known, ", ")));
      return std::nullopt;
    }
    const hand::Placement& placement = scene_.hands[at].placement;
    if (placement.mount != task.kind->mount || !placement.motion.keys.empty())
      problem(
          task, ".hand", std::string("a hand whose wrist has another place than ") + task.kind->what,
          task.kind->mount == hand::Mount::rail ? "wrist.mount rail" : "wrist.mount driven without a motion");
    else if (task_of_hand_[at])
      problem(task, ".hand", fmt::format("a hand that {} moves", task_of_hand_[at]->path), "one task a hand");
    else
      task_of_hand_[at] = &task;
    return task_of_hand_[at] == &task ? std::optional(at) : std::nullopt;
  }

  std::optional<std::size_t> find_object(const TaskSpec& task) {
    const bool moves = task.kind->moves_object;
    const auto found = std::find_if(scene_.objects.begin(), scene_.objects.end(),
                                    [&](const ObjectSpec& object) { return object.name == task.object; });
    if (found != scene_.objects.end() && found->is_static != moves)
      return static_cast<std::size_t>(found - scene_.objects.begin());
    std::string got = task.object;
    if (found != scene_.objects.end()) got += moves ? ", which does not move" : ", which moves";
    problem(task, std::string(".") + task.kind->object, got,
            fmt::format("the name of a {} object of the scene", moves ? "free" : "static"));
    return std::nullopt;
  }

  /// Two tasks of one object have to agree on where it is.
  void place_object(const TaskSpec& task, std::size_t object, const Pose& pose) {
    Pose& placed = plans_.objects[object].pose;
    const TaskSpec* other = std::exchange(task_of_object_[object], &task);
    if (!other) {
      placed = pose;
      return;
    }
    const double way = (placed.p - pose.p).norm(), turn = placed.q.angularDistance(pose.q);
    if (way > kSamePlace || turn > kSamePlace)
      problem(task, std::string(".") + task.kind->object,
              fmt::format("a place of {} {:.3g} m and {:.3g} rad from that by {}", task.object, way, turn,
                          other->path),
              "tasks that agree on it, or one task for each object");
  }

  void add_support(const TaskSpec& task, ObjectSpec support) {
    const bool taken = std::any_of(plans_.objects.begin(), plans_.objects.end(),
                                   [&](const ObjectSpec& object) { return object.name == support.name; });
    if (taken)
      problem(task, ".support", support.name + ", an object of the scene", "that name for the post");
    else
      plans_.objects.push_back(std::move(support));
  }

  bool knows_poses(const TaskSpec& task, const control::PoseFile& file) {
    std::vector<std::string> known;
    for (const auto& [name, pose] : file.poses) known.push_back(name);
    bool all = true;
    const auto check = [&](const char* key, const std::string& pose) {
      if (file.poses.contains(pose)) return;
      all = false;
      problem(task, key, pose, "a pose of the pose file" + nearest_hint(pose, known));
    };
    check(".open", task.open);
    for (const std::string& pose : task.closed) check(".closed", pose);
    return all;
  }

  /// The program that opens the hand and closes it later. The hand starts in its open pose.
  void add_program(const TaskSpec& task, std::size_t hand, double close) {
    if (!plans_.control || !plans_.control->poses)
      return problem(task, "", std::string(task.kind->what) + " in a scene without control",
                     "a control block with a controller and poses");
    control::PoseFile& file = *plans_.control->poses;
    control::ProgramChoice& choice = plans_.control->programs[hand];
    if (!choice.program.empty())
      problem(task, "", "a hand with a program of its own", std::string(task.kind->what) + ", or a program");
    if (!knows_poses(task, file)) return;
    control::ProgramSpec program;
    program.place = task.place;
    program.keys.push_back({0, 0, task.open, task.place});
    for (const std::string& pose : task.closed) {
      program.keys.push_back({close, task.close_time, pose, task.place});
      close += task.close_time;
    }
    choice = {task.path, task.place, task.path};
    while (file.programs.contains(choice.program)) choice.program += '+';
    file.programs[choice.program] = std::move(program);
    hand::Placement& placement = plans_.hands[hand];
    for (const auto& [joint, pose] : file.poses.at(task.open).joints)
      if (joint != scene_.hands[hand].model.wrist.name) placement.start.try_emplace(joint, pose.angles);
  }

  /// A hand whose place was left to the tasks.
  void check_idle(std::size_t hand) {
    const auto problem = [&](const char* key, const char* got, const char* need) {
      diagnostics_.problems.push_back({scene_.hands[hand].place, item_path("hands", hand) + key, got, need});
    };
    const hand::Placement& placement = scene_.hands[hand].placement;
    const auto places = [&](const auto& task) { return task->kind->mount == placement.mount; };
    if (task_of_hand_[hand] || std::none_of(scene_.tasks.begin(), scene_.tasks.end(), places)) return;
    if (placement.mount == hand::Mount::rail)
      problem(".wrist.mount", "a rail without a climb", "a climb of this hand, or another mount");
    else if (placement.motion.keys.empty())
      problem(".wrist.motion", "nothing", "a mapping with keyframes, or a grasp of this hand");
  }

  const SceneSpec& scene_;
  const std::vector<hand::BuiltHand>& hands_;
  Diagnostics& diagnostics_;
  std::vector<const TaskSpec*> task_of_hand_, task_of_object_;
  Plans plans_;
};

}  // namespace

std::span<const TaskKind> task_kinds() { return kKinds; }

Plans make_plans(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands,
                 Diagnostics& diagnostics) {
  return Planner(scene, hands, diagnostics).run();
}

void read_task(MapReader& block, const char* object_key, TaskSpec& task) {
  if (block.has("hand")) task.hand = block.name("hand");
  task.object = block.name(object_key);
  MapReader wrist = block.required_map("wrist", "position and rotation of the hand frame at the object");
  task.wrist = read_pose(wrist);
  wrist.finish();
  task.open = block.text("open");
  task.closed = read_pose_names(block, "closed");
}

void add_phase(TaskSpec& task, std::string name, double span) {
  const double start = task.phases.empty() ? 0 : task.end();
  task.phases.push_back({std::move(name), start, start + span});
}

}  // namespace handsim::scene
