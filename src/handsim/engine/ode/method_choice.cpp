#include "handsim/engine/ode/method_choice.h"

#include <numeric>

namespace handsim::engine::ode {

double world_step_cost(int rows) {
  const double m = rows;
  return 160 * m + 0.11 * m * m * m;
}

double quick_step_cost(int rows, int iterations) { return (60 + 13.0 * iterations) * rows; }

MethodChoice::MethodChoice(const model::Model& model, const Joints& joints,
                           const std::vector<OdeBody>& bodies, const Settings& settings)
    : model_(model),
      iterations_(settings.ode().iterations),
      rows_per_contact_(settings.effects.has(model::Effect::friction) ? 3 : 1),
      root_(bodies.size()),
      rows_(bodies.size(), 0) {
  for (const OdeBody& body : bodies) moves_.push_back(body.id != nullptr && !body.driven);
  std::iota(root_.begin(), root_.end(), 0);
  for (std::size_t i = 0; i < model.joints.size(); ++i)
    join(model.joints[i].parent, model.joints[i].child, joints.rows(i));
  tree_ = root_;
  tree_rows_ = rows_;
}

int MethodChoice::root(int body) {
  while (root_[at(body)] != body) body = root_[at(body)] = root_[at(root_[at(body)])];
  return body;
}

void MethodChoice::join(int a, int b, int rows) {
  if (!moves_[at(a)]) a = b;
  if (!moves_[at(b)]) b = a;
  if (!moves_[at(a)]) return;
  const int first = root(a);
  const int second = root(b);
  rows_[at(first)] += rows;
  if (first == second) return;
  root_[at(second)] = first;
  rows_[at(first)] += rows_[at(second)];
}

OdeMethod MethodChoice::pick(std::span<const Contact> contacts) {
  root_ = tree_;
  rows_ = tree_rows_;
  for (const Contact& contact : contacts)
    join(model_.shapes[at(contact.shape_a)].body, model_.shapes[at(contact.shape_b)].body, rows_per_contact_);
  double direct = 0;
  double iterative = 0;
  for (std::size_t i = 0; i < root_.size(); ++i) {
    if (!moves_[i] || root_[i] != static_cast<int>(i)) continue;
    direct += world_step_cost(rows_[i]);
    iterative += quick_step_cost(rows_[i], iterations_);
  }
  return direct <= iterative ? OdeMethod::world_step : OdeMethod::quick_step;
}

}  // namespace handsim::engine::ode
