// The content of a controller file: the form of control, feed-forward terms, and rows of gains by joint. For
// any person: rows may state a frequency and a damping ratio, which plan.h turns into gains for the hand.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/control/hand_axes.h"
#include "handsim/core/yaml_reader.h"

namespace handsim::control {

enum class Form {
  explicit_torque,  ///< torques from the state at the start of the step: unstable beyond a limit
                    ///< (stability.h)
  implicit_gain,    ///< spring-dampers that the engine solves within the step: stable at any step
};

/// Gains of a joint axis as rows state them: given, or designed (frequency, damping_ratio, integral_time).
struct AxisGains {
  std::optional<double> proportional;   ///< [N m/rad], 0..1e4
  std::optional<double> derivative;     ///< [N m s/rad], 0..1e3; acts on the measured rate
  std::optional<double> integral;       ///< [N m/(rad s)], 0..1e5; absent: none
  std::optional<double> frequency;      ///< of the undamped spring on the effective inertia [Hz], 0.01..1000
  std::optional<double> damping_ratio;  ///< 0..100; 1 critical
  std::optional<double> integral_time;  ///< proportional over integral gain [s], above 0; absent: no integral
  std::optional<double> torque_limit;   ///< [N m], above 0
  std::optional<double> derivative_cutoff;  ///< of a first-order low-pass on the rate [Hz]; absent: none
  std::optional<double> integral_zone;      ///< the integral acts only at errors below [rad]; absent: always

  /// Replaces the values that a later row states. A given gain removes designed ones, and vice versa.
  void overlay(const AxisGains& later);

  template <class Visit>
  static void fields(Visit&& visit) {
    visit("proportional", &AxisGains::proportional, Quantity{Dimension::rotational_stiffness, 0, 1e4});
    visit("derivative", &AxisGains::derivative, Quantity{Dimension::rotational_damping, 0, 1e3});
    visit("integral", &AxisGains::integral, Quantity{Dimension::rotational_integral, 0, 1e5});
    visit("frequency", &AxisGains::frequency, Quantity{Dimension::frequency, 0.01, 1000});
    visit("damping_ratio", &AxisGains::damping_ratio, Quantity{Dimension::none, 0, 100});
    visit("integral_time", &AxisGains::integral_time, Quantity{Dimension::time, 1e-3, 1e6});
    visit("torque_limit", &AxisGains::torque_limit, Quantity{Dimension::torque, 0, 1000, true});
    visit("derivative_cutoff", &AxisGains::derivative_cutoff, Quantity{Dimension::frequency, 0.01, 1e5});
    visit("integral_zone", &AxisGains::integral_zone, Quantity{Dimension::angle, 0, 10, true});
  }
};

struct GainRow {
  std::vector<std::string> joints;  ///< `all`, joints, joint.axis, or patterns with one `*`
  AxisGains gains;
  Place place;
};

struct ControllerSpec {
  Form form = Form::implicit_gain;
  bool gravity_compensation = false;  ///< feeds forward the torques of the weight at the measured angles
  bool tissue_compensation = false;   ///< feeds forward the torques of passive tissue at the target angles
  /// Feeds forward the torques of inverse dynamics along the targets (rates and accelerations included) and
  /// lets the damping act on the difference of rates; includes the weight.
  bool feed_forward = false;
  /// Grip strength of the hand whose torque limits the rows state [N]. A task that knows the person's
  /// strength scales the limits in proportion. Absent: limits are not scaled.
  std::optional<double> grip_strength;
  std::vector<GainRow> rows;  ///< a later row overrides earlier ones
};

/// Reads a controller file; every defect goes into the diagnostics.
ControllerSpec read_controller(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);

/// Problems: rows of a misspelt joint. A warning: joints that no hand has, as a file for several may name.
void check_names(const ControllerSpec& spec, const std::vector<HandAxes>& hands, Diagnostics& diagnostics);

/// The gains of an axis from all rows that name it; nothing if none does: the axis is not driven.
std::optional<AxisGains> gains_of(const ControllerSpec& spec, const HandAxis& axis);

}  // namespace handsim::control
