// What pads remember from step to step: each pair of shapes its elastic force and the parts of it that relax
// (model/compliance.h). Memory is the pair's, so that contact points may come and go. In a step of length h
// the elastic force goes straight from its last value to the one at the step's end, F+; then the relaxing
// parts are exactly q_k+ = e_k q_k + c_k phi_k (F+ - F), e_k = exp(-h / t_k), phi_k = (1 - e_k) t_k / h, and
// the whole force at the step's end is gain F+ + offset with numbers that are known at its start.
#pragma once

#include <algorithm>
#include <vector>

#include "handsim/engine/collision/collider.h"
#include "handsim/model/state.h"

namespace handsim::engine {

/// The pad of a touch in one step: its force at the end is gain times the elastic force there, and offset.
struct PadStep {
  double gain = 1;
  double offset = 0;  ///< [N]
};

/// A contact point's push by a pad: p = step share (gain F(depth - step r) + offset - damping r) for the
/// velocity r at which the surfaces part after the step.
struct PadPoint {
  const model::Compliance* pad = nullptr;
  double depth = 0;  ///< at the step's start [m]
  double step = 0;   ///< [s]
  double share = 1;  ///< of the pair's stiffness
  double gain = 1, offset = 0;

  struct Push {
    double impulse = 0;  ///< not yet limited to 0 or more [N s]
    double slope = 0;    ///< minus its derivative by r [N s / (m/s)]
  };
  Push at(double r) const;
};

class PadMemory {
 public:
  using Pair = model::PadState;

  /// Whether pairs with this surface have memory.
  static bool remembers(const model::Material& surface) {
    return surface.compliance && surface.compliance->law;
  }
  /// Whether any surface of the model has.
  static bool needed(const model::Model& model);

  /// The pads of the touches found, for a step [s] from the memory as it is. Gives the touches their friction
  /// by the normal force of the last step.
  void recall(Collider& collider, double step);
  /// As the touches of the collider; of pairs without memory the defaults.
  const PadStep& of(std::size_t touch) const { return steps_[touch]; }
  /// Takes over the step made, also a second time. @param depth_after of a contact's surfaces, by its index
  /// [m]
  template <class Depth>
  void store(const Collider& collider, double step, const Depth& depth_after) {
    begin_store();
    for (std::size_t k = 0; k < collider.touches().size(); ++k) {
      const Touch& touch = collider.touches()[k];
      if (!remembers(touch.surface)) continue;
      double force = 0, shares = 0;
      for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
        const double elastic = touch.surface.compliance->elastic(depth_after(i)).force;
        force += collider.shares()[i] * std::max(elastic, 0.0);
        shares += collider.shares()[i];
      }
      store_pair(collider, k, step, force / shares, shares);
    }
    end_store(collider, step);
  }

  const std::vector<Pair>& pairs() const { return pairs_; }
  void set(const std::vector<Pair>& pairs) { pairs_ = pairs; }

 private:
  const Pair* find(int shape_a, int shape_b) const;
  void begin_store() { pairs_.clear(); }
  void store_pair(const Collider& collider, std::size_t touch, double step, double force, double shares);
  void end_store(const Collider& collider, double step);

  std::vector<Pair> pairs_, start_;  ///< by shapes; at the start of the step
  std::vector<PadStep> steps_;
};

}  // namespace handsim::engine
