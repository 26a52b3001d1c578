#include "handsim/engine/collision/pad_memory.h"

#include <cmath>
#include <utility>

namespace handsim::engine {

namespace {

/// Parts of a pair that has parted are forgotten below this force [N].
constexpr double kForgotten = 1e-4;

/// What is left of a relaxing part after a step, and what it takes of a change of the force in it.
struct Decay {
  double left = 0, taken = 0;
};

Decay decay_of(const model::Relaxation& part, double step) {
  const double left = std::exp(-step / part.time);
  return {left, -part.share * std::expm1(-step / part.time) * part.time / step};
}

/// The pair after a step to a new elastic force.
void advance(PadMemory::Pair& pair, const model::Compliance& pad, double step, double force) {
  pair.push = pad.lasting() * force;
  for (std::size_t k = 0; k < pad.law->relaxations.size(); ++k) {
    const Decay decay = decay_of(pad.law->relaxations[k], step);
    pair.parts[k] = decay.left * pair.parts[k] + decay.taken * (force - pair.force);
    pair.push += pair.parts[k];
  }
  pair.force = force;
}

std::pair<int, int> shapes_of(const PadMemory::Pair& pair) { return {pair.shape_a, pair.shape_b}; }

}  // namespace

PadPoint::Push PadPoint::at(double r) const {
  const model::Elastic elastic = pad->elastic(depth - step * r);
  return {step * share * (gain * elastic.force + offset - pad->damping * r),
          step * share * (step * gain * elastic.slope + pad->damping)};
}

bool PadMemory::needed(const model::Model& model) { return std::ranges::any_of(model.materials, remembers); }

const PadMemory::Pair* PadMemory::find(int shape_a, int shape_b) const {
  const auto found = std::ranges::lower_bound(start_, std::pair(shape_a, shape_b), {}, shapes_of);
  return found != start_.end() && shapes_of(*found) == std::pair(shape_a, shape_b) ? &*found : nullptr;
}

void PadMemory::recall(Collider& collider, double step) {
  start_ = pairs_;
  steps_.assign(collider.touches().size(), {});
  for (std::size_t k = 0; k < steps_.size(); ++k) {
    Touch& touch = collider.touches()[k];
    model::Material& surface = touch.surface;
    if (!remembers(surface)) continue;
    const Contact& any = collider.contacts()[touch.first];
    const Pair* pair = find(any.shape_a, any.shape_b);
    // Once, should the touches be recalled again.
    if (const auto over_load = std::exchange(surface.friction_over_load, std::nullopt))
      surface.friction *= over_load->factor(pair ? pair->push : 0);
    PadStep& out = steps_[k];
    out.gain = surface.compliance->lasting();
    for (std::size_t i = 0; i < surface.compliance->law->relaxations.size(); ++i) {
      const Decay decay = decay_of(surface.compliance->law->relaxations[i], step);
      out.gain += decay.taken;
      if (pair) out.offset += decay.left * pair->parts[i] - decay.taken * pair->force;
    }
  }
}

void PadMemory::store_pair(const Collider& collider, std::size_t touch, double step, double force,
                           double shares) {
  const Touch& of = collider.touches()[touch];
  const Contact& any = collider.contacts()[of.first];
  const Pair* last = find(any.shape_a, any.shape_b);
  Pair& pair = pairs_.emplace_back(last ? *last : Pair{.shape_a = any.shape_a, .shape_b = any.shape_b});
  advance(pair, *of.surface.compliance, step, force);
  pair.push *= shares;
}

/// Keeps pairs that have parted until they have recovered.
void PadMemory::end_store(const Collider& collider, double step) {
  const std::size_t touching = pairs_.size();
  std::size_t k = 0;
  for (Pair pair : start_) {
    while (k < touching && shapes_of(pairs_[k]) < shapes_of(pair)) ++k;
    if (k < touching && shapes_of(pairs_[k]) == shapes_of(pair)) continue;
    const model::Material surface = collider.surface(pair.shape_a, pair.shape_b);
    if (!remembers(surface)) continue;
    advance(pair, *surface.compliance, step, 0);
    pair.push = 0;
    if (std::ranges::any_of(pair.parts, [](double part) { return std::abs(part) > kForgotten; }))
      pairs_.push_back(pair);
  }
  if (pairs_.size() > touching)
    std::ranges::inplace_merge(pairs_, pairs_.begin() + static_cast<std::ptrdiff_t>(touching), {}, shapes_of);
}

}  // namespace handsim::engine
