// What a hand is drawn with beyond its shapes, so that one sees which side is the back and where the arm
// would be: nails and a stump of the wrist. They belong to pictures alone and touch nothing.
#pragma once

#include <vector>

#include "handsim/model/model.h"
#include "handsim/output/render/draw_list.h"

namespace handsim::output {

struct HandMark {
  Solid solid;        ///< in the frame of its body, X_BS
  int body = 0;       ///< index into Model::bodies
  int shape = 0;      ///< the shape that it is on: index into Model::shapes
  bool nail = false;  ///< else a stump
};

/// Of all hands. Only fingertips that are capsules have nails, only palms with shapes a stump.
std::vector<HandMark> hand_marks(const model::Model& model);

}  // namespace handsim::output
