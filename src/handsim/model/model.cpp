#include "handsim/model/model.h"

namespace handsim::model {

int Model::dof_count() const {
  return joints.empty() ? 0 : joints.back().first_dof + model::dof_count(joints.back().kind);
}

std::vector<std::optional<std::size_t>> Model::objects_of_shapes() const {
  std::vector<std::optional<std::size_t>> out(shapes.size());
  for (std::size_t i = 0; i < objects.size(); ++i)
    for (const int shape : objects[i].shapes) out[as_index(shape)] = i;
  return out;
}

int Model::add_group(std::string name) {
  groups.push_back({std::move(name)});
  return static_cast<int>(groups.size()) - 1;
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
