// A recorded motion of five seconds for tests of dynamics: every axis of every hand swings around the middle
// of its range, at 0.5 to 1 Hz and up to 150 deg/s.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>

#include "handsim/control/hand_axes.h"
#include "handsim/core/units.h"
#include "handsim/model/model.h"

namespace handsim::test {

inline void write_smooth_motion(const std::filesystem::path& path, const model::Model& model,
                                double seconds = 5, double rate = 100) {
  std::ofstream out(path);
  out << "time[s]";
  std::vector<control::HandAxes> hands;
  for (const model::HandIndex& hand : model.hands) hands.push_back(control::hand_axes(model, hand));
  for (const control::HandAxes& hand : hands)
    for (const control::HandAxis& axis : hand.axes) out << ',' << hand.hand << '.' << axis.name() << "[deg]";
  out << '\n';
  for (int k = 0; k <= seconds * rate; ++k) {
    const double time = k / rate;
    out << fmt::format("{}", time);
    double phase = 0;
    for (const control::HandAxes& hand : hands)
      for (const control::HandAxis& axis : hand.axes) {
        phase += 0.61;
        const double low = axis.stop->low / kDegree, high = axis.stop->high / kDegree;
        const double frequency = 0.5 + 0.5 * std::fmod(0.43 * phase, 1.0);
        const double swing = std::min(0.35 * (high - low), 150 / (2 * M_PI * frequency));
        out << fmt::format(",{}", 0.5 * (low + high) + swing * std::sin(2 * M_PI * frequency * time + phase));
      }
    out << '\n';
  }
}

}  // namespace handsim::test
