// The joint coordinates of one hand that a controller can drive, under the names that files use.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/model/model.h"

namespace handsim::control {

struct HandAxis {
  std::string joint;  ///< without the hand's name, e.g. `index_mcp`
  std::string axis;   ///< e.g. `flexion`
  std::size_t joint_index = 0;
  std::size_t axis_index = 0;
  std::size_t dof = 0;  ///< in vectors of model.dof_count()
  std::optional<model::Stop> stop;

  std::string name() const { return joint + "." + axis; }
};

struct HandAxes {
  std::string hand;                 ///< `right`, `left`, ...
  std::vector<HandAxis> axes;       ///< in the order of the hand's joints
  std::vector<std::string> absent;  ///< joints of the hand model that its mount omits, e.g. `wrist`

  /// True for `all`, a joint's name, or joint.axis, absent joints included.
  bool accepts(std::string_view name) const;
  /// Names of all joints, absent ones included.
  std::vector<std::string> joints() const;
};

/// True if `name` is `all`, the axis' joint or the axis itself.
bool matches(const HandAxis& axis, std::string_view name);

/// True for a name that is probably misspelt, not of a joint that other hands have: it is near a known name
/// that is not also `named`, or one of its words (`indx` of `indx_mcp`) is near to a known word.
bool is_misspelt(std::string_view name, const std::vector<std::string>& known,
                 const std::vector<std::string>& named);

/// @param absent joints of the hand model that this hand does not have.
HandAxes hand_axes(const model::Model& model, const model::HandIndex& hand,
                   std::vector<std::string> absent = {});

}  // namespace handsim::control
