// Watches a run for what contact should never let be: a shape whose centre passes through another within a
// step, or that lies deeper in another than its own smallest radius. On wherever contacts are tested, at some
// nanoseconds for each body.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/engine/contact/sweep.h"
#include "handsim/engine/engine.h"

namespace handsim::simulation {

class Tunnelling {
 public:
  /// The model must outlive this. @param start the state before the first step
  Tunnelling(const model::Model& model, const model::Effects& effects, const model::State& start);

  /// Takes in a step. @param contacts found at the last step's state; @param state after the step
  void look(std::span<const engine::Contact> contacts, const model::State& state);
  /// Goes on from another state.
  void restart(const model::State& state);

  /// Pairs of shapes that passed or lay too deep.
  int pairs() const { return static_cast<int>(events_.size()); }
  /// Of the first of them, by time; empty where there is none.
  std::string first_where() const;
  double first_time() const { return events_.empty() ? 0 : events_.front().time; }
  /// One sentence for each pair, and one for those beyond the first few.
  std::vector<std::string> warnings() const;

  void save(ArchiveWriter& out) const;
  /// The last state is to be told by restart.
  void restore(ArchiveReader& in);

 private:
  /// The first time a pair was met, and how deep it was at most.
  struct Event {
    int a = 0, b = 0;
    double time = 0;
    bool passed = false;
    double depth = 0, depth_time = 0;
  };
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  Event& event(int a, int b, double time);
  void look_at_depths(std::span<const engine::Contact> contacts);
  void look_at_ways(const model::State& state);
  bool passes(std::size_t a, std::size_t b, const model::State& state) const;

  const model::Model& model_;
  engine::Sweep sweep_;
  std::vector<double>
      radii_;  ///< deepest that a shape may lie in others, infinite where nothing moves it [m]
  std::vector<Event> events_;
  model::State last_;
  std::vector<engine::Way> ways_;
};

}  // namespace handsim::simulation
