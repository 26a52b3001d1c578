// Functions that the exporters share, and their parts: surfaces, muscles and bands. Private to this folder.
#pragma once

#include <string>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/engine/settings.h"
#include "handsim/model/model.h"
#include "handsim/model/state.h"

namespace handsim::output {

/// True if the body is the child of a joint that does not close a loop.
bool has_parent(const model::Model& model, std::size_t body);
/// The drive that moves a kinematic body; null where none does.
const model::Drive* drive_of(const model::Model& model, const engine::Settings& settings, int body);
/// True if the axis has limits that act.
bool has_stop(const model::JointAxis& axis, const engine::Settings& settings);
/// `x y z` with all digits.
std::string numbers(const Vec3& v);
/// `w x y z`, MuJoCo's order.
std::string wxyz(const Quat& q);
/// Text as an XML attribute's value.
std::string attribute(const std::string& text);

/// Attributes `condim` and `friction` of a geom, or of a pair, whose friction has five numbers.
std::string mjcf_friction(const model::Material& surface, const engine::Settings& settings, bool of_pair);

/// A `pair` for every two shapes that may touch and whose surfaces MuJoCo combines otherwise than handsim: it
/// takes the greater coefficient of friction, and its soft contacts are no springs in series.
std::string mjcf_pairs(const model::Model& model, const engine::Settings& settings);

/// Elements of <tendon> and <actuator>, each a line, indented by four; empty without muscles and bands.
struct MjcfTendons {
  std::string tendons, actuators;
  int count = 0;  ///< of actuators
};

/// MJCF's fixed tendons have constant moment arms: those at the state; an actuator has its muscle's isometric
/// force there, per activation, beside the passive one. MuJoCo's law of activation is muscle_curves.h's.
MjcfTendons mjcf_tendons(const model::Model& model, const engine::Settings& settings,
                         const model::State& state);

/// `<tag>text</tag>`
inline std::string element(const char* tag, const std::string& text) {
  return fmt::format("<{0}>{1}</{0}>", tag, text);
}
/// With all digits.
inline std::string element(const char* tag, double value) {
  return element(tag, fmt::format("{:.17g}", value));
}

/// Muscles and bands in effect, for the ForceSet: each length is one polynomial of its coordinates, exact
/// within its arms' range; OpenSim's arms are its derivatives. Welded coordinates stay at the start.
std::string osim_muscles(const model::Model& model, const engine::Settings& settings,
                         const model::State& start);

}  // namespace handsim::output
