// Sums of contact forces over a run, for each finger and for each pair of objects in contact.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

/// Forces between two objects, or on a finger from all its contacts.
struct ContactSum {
  int contacts = 0;           ///< points at the last step
  Vec3 force = Vec3::Zero();  ///< on the first of the two (the finger) at the last step, world [N]
  double normal = 0;          ///< sum of the normal forces of the points at the last step [N]
  double friction = 0;        ///< sum of the magnitudes of their friction forces at the last step [N]
  double normal_time = 0;     ///< integral of `normal` over the run [N s]
  double largest_normal = 0;  ///< of all steps [N]
  double largest_at = 0;      ///< its time [s]
};

class ContactSums final : public Watcher {
 public:
  /// Things: fingers and palm of each hand (`right.index`), objects, the ground, bodies of a mechanism.
  explicit ContactSums(const Watched& watched);

  std::string_view name() const override { return "contact_forces"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_summary(SummaryJson& out) const override;

  using Pair = std::pair<std::string, std::string>;
  /// Pairs with contact in the run, by name; the force acts on the first one of a pair.
  std::vector<std::pair<Pair, ContactSum>> pairs() const;
  /// Fingers and palms with contact in the run.
  std::vector<std::pair<std::string, ContactSum>> fingers() const;

 private:
  std::vector<std::string> things_;                                  ///< by index, in the order of the shapes
  std::vector<std::size_t> thing_;                                   ///< of each shape
  std::vector<bool> is_finger_;                                      ///< of each thing
  std::map<std::pair<std::size_t, std::size_t>, ContactSum> pairs_;  ///< lower index first
  std::map<std::size_t, ContactSum> fingers_;
  double time_ = 0;  ///< of the run so far [s]
};

}  // namespace handsim::simulation
