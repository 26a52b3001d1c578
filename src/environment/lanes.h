// Steps of several environments of one scene in the lanes of the vector unit (articulated/lane_group.h), to
// the bits of the same steps one by one.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "handsim/engine/articulated/lane_group.h"
#include "handsim/environment/environment.h"

namespace handsim::environment {

class Lanes {
 public:
  /// @param like an environment of the scene, @param widest BatchSetup::lanes
  Lanes(const Environment& like, int widest);

  /// Environments that a call of `step` takes; 0 where the scene has no use for lanes.
  int width() const { return group_ ? group_->width() : 0; }
  /// True where an action's steps can begin in lanes.
  bool takes(Environment& environment, const Action& action) const;

  struct Member {
    Environment* environment = nullptr;
    Action action;
    int made = 0;  ///< out: steps made; the environment has to make the others alone
  };
  /// @param members at most width(), all of which `takes` accepts
  void step(std::span<Member> members, int substeps);

 private:
  void load(int lane, const Member& member);
  void set_targets(std::span<const Member> members, unsigned active);
  void store(int lane, Member& member, int made, bool leaves);

  std::unique_ptr<engine::articulated::LaneGroup> group_;
  engine::articulated::LaneControlPlan plan_;
  std::vector<double> torques_;
  double step_ = 0;  ///< [s]
};

}  // namespace handsim::environment
