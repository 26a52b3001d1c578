#include "handsim/model/model.h"

namespace handsim::model {

int dof_count(JointKind kind) {
  switch (kind) {
    case JointKind::hinge:
    case JointKind::slider:
      return 1;
    case JointKind::universal:
      return 2;
    case JointKind::ball:
      return 3;
  }
  return 0;
}

int Model::dof_count() const {
  return joints.empty() ? 0 : joints.back().first_dof + model::dof_count(joints.back().kind);
}

Model make_model() {
  Model model;
  Body world;
  world.name = "world";
  world.kinematic = true;
  model.bodies.push_back(world);
  return model;
}

}  // namespace handsim::model
