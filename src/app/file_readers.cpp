#include "handsim/app/file_readers.h"

#include <array>

#include "handsim/control/gains.h"
#include "handsim/control/motion_trajectory.h"
#include "handsim/control/poses.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/hand/hand_spec.h"
#include "handsim/scene/read/contact_spec.h"
#include "handsim/scene/read/engine_choice.h"
#include "handsim/scene/read/objects.h"
#include "handsim/scene/read/scene_spec.h"
#include "handsim/scene/task/tasks.h"
#include "handsim/study/rollouts/rollouts_spec.h"
#include "handsim/study/track/marker_set.h"
#include "handsim/study/validate/validate.h"

namespace handsim::app {

namespace {

/// Reads a tree only for its problems.
template <auto kRead>
void read_root(YamlNode& root, Diagnostics& diagnostics) {
  if constexpr (requires { kRead(root, "", diagnostics); })
    kRead(root, "", diagnostics);
  else
    kRead(root, diagnostics);
}

void read_whole_scene(YamlNode& root, Diagnostics& diagnostics) {
  scene::read_scene(root, scene::task_kinds(), diagnostics);
}

/// A file of muscles by itself: the axes that it names are those of whatever hand includes it.
void read_muscles(YamlNode& root, Diagnostics& diagnostics) {
  hand::read_muscle_file(root, "", std::nullopt, diagnostics);
}

using scene::FileKind;

constexpr std::array kReaders = {
    FileReader{"scene", FileKind::scene, read_whole_scene},
    FileReader{"person", FileKind::person, read_root<hand::read_person>},
    FileReader{"hand", FileKind::hand_model, read_root<hand::read_hand_spec>},
    FileReader{"controller", FileKind::controller, read_root<control::read_controller>},
    FileReader{"poses", FileKind::poses, read_root<control::read_pose_file>},
    FileReader{"object", FileKind::object, read_root<scene::read_object_file>},
    FileReader{"material", FileKind::material, read_root<scene::read_material_file>},
    FileReader{"anthropometry", FileKind::anthropometry, read_root<hand::read_anthropometry>},
    FileReader{"grip_norms", FileKind::grip_norms, read_root<hand::read_grip_table>},
    FileReader{"muscles", FileKind::muscles, read_muscles},
    FileReader{"measurements", FileKind::measurements, study::read_validate},
    FileReader{"rollouts", FileKind::rollouts, read_root<study::read_rollouts>},
    FileReader{"names", FileKind::motion_names, read_root<control::read_motion_names>},
    FileReader{"markers", FileKind::marker_set, read_root<study::read_marker_set>},
    FileReader{"costs", FileKind::costs, read_root<scene::read_costs>},
};

}  // namespace

std::span<const FileReader> file_readers() { return kReaders; }

}  // namespace handsim::app
