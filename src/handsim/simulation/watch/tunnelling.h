// Measures penetration and detects tunnelling: a shape whose centre passes through another one in a step, or
// that penetrates one by more than its own smallest radius. In all scenes with contact; some ns a body.
#pragma once

#include <string>
#include <vector>

#include "handsim/engine/collision/sweep.h"
#include "handsim/simulation/watch/monitor.h"

namespace handsim::simulation {

class Tunnelling final : public Watcher {
 public:
  explicit Tunnelling(const Watched& watched);

  std::string_view name() const override { return "tunnelling"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;
  /// One sentence for each of the first pairs, and one for all others.
  void add_warnings(std::vector<std::string>& out) const override;

  /// Largest depth of any contact point so far [m], `A and B` by the names of the shapes.
  Peak penetration() const;
  /// Number of pairs of shapes with tunnelling.
  int pairs() const { return static_cast<int>(events_.size()); }
  /// Names of the first pair in time; empty if there is none.
  std::string first_where() const;
  double first_time() const { return events_.empty() ? 0 : events_.front().time; }

 private:
  /// First time of tunnelling of a pair, and its largest depth.
  struct Event {
    int a = 0, b = 0;
    double time = 0;
    bool passed = false;
    double depth = 0, depth_time = 0;
  };
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  Event& event(int a, int b, double time);
  std::string names(int a, int b) const;
  std::string warning(const Event& met) const;
  void start_from(const model::State& state);
  void update_depths(const engine::Engine& engine);
  void collect_passages(const model::State& state);
  bool passes(std::size_t a, std::size_t b, const model::State& state) const;

  const model::Model& model_;
  bool tested_;  ///< true if the engine tests contacts
  double depth_ = 0, depth_time_ = 0;
  int deep_a_ = 0, deep_b_ = 0;  ///< shapes
  engine::Sweep sweep_;
  std::vector<double> radii_;  ///< largest allowed depth of each shape; infinite for immovable shapes [m]
  std::vector<Event> events_;
  model::State last_;
  std::vector<engine::Way> ways_;
};

}  // namespace handsim::simulation
