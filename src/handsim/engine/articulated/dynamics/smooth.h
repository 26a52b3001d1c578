// Motion without stops as an ordinary differential equation in joint coordinates, by Runge-Kutta methods;
// loops are held by constraint forces, and projected onto their constraints after every step of the method.
#pragma once

#include "handsim/engine/articulated/dynamics/loops.h"
#include "handsim/engine/articulated/dynamics/runge_kutta.h"

namespace handsim::engine::articulated {

class Smooth {
 public:
  /// @param loops null where there is none. All must outlive this object.
  Smooth(const model::Model& model, const Settings& settings, Mechanism& mechanism, Loops* loops);

  /// Carries positions, rates and driven bases from one time to another [s] under the forces last set; leaves
  /// the kinematics found. False where a speed left its bounds or the method could not go on.
  bool advance(double from, double to);
  /// Step that the error control is at [s]; 0: none yet.
  double size() const { return size_; }
  void set_size(double size) { size_ = size; }

 private:
  bool slope(double t, std::span<const double> y, std::span<double> out);
  void accelerate();
  void place_bases(double t, model::KeySide side);
  void apply_velocity_jumps(double t);
  double next_key(double t) const;
  bool integrate(double from, double to);
  bool integrate_adaptively(double from, double to);
  bool close_loops();

  const model::Model& model_;
  Settings settings_;
  Mechanism& mechanism_;
  Loops* loops_;
  RungeKutta method_;
  std::vector<double> y_, next_;  ///< positions, then rates
  std::vector<double> before_;
  std::vector<BaseMotion> bases_before_;
  double size_ = 0;           ///< step that the error control is at [s]; 0: none yet
  double next_key_time_ = 0;  ///< end of the stretch without keyframes [s]
  bool driven_ = false;
};

}  // namespace handsim::engine::articulated
