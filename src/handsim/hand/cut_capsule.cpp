#include "handsim/hand/cut_capsule.h"

#include <cmath>

namespace handsim::hand {

CapsuleMatter matter(const model::Shape& capsule, const Cut& cut) {
  const double r = capsule.radius, end = capsule.length, l = end - cut.begins, r2 = r * r;
  const double cylinder = M_PI * r2 * l, cap = cut.flat_end ? 0 : 2.0 / 3 * M_PI * r2 * r;
  const double at_cylinder = 0.5 * (cut.begins + end), at_cap = end + 3 * r / 8;
  CapsuleMatter out;
  out.volume = cylinder + cap;
  out.centre = (cylinder * at_cylinder + cap * at_cap) / out.volume;
  const auto beyond = [&](double at) { return (at - out.centre) * (at - out.centre); };
  out.axial = (cylinder * r2 / 2 + cap * 0.4 * r2) / out.volume;
  // A half ball about its own centre of mass, 3/8 r from its flat side.
  out.transverse = (cylinder * (l * l / 12 + r2 / 4 + beyond(at_cylinder)) +
                    cap * ((0.4 - 9.0 / 64) * r2 + beyond(at_cap))) /
                   out.volume;
  return out;
}

double covered(double reach, double radius) {
  if (reach <= radius) return 2 * reach * reach * reach / (3 * radius * radius);
  const double h = std::sqrt(reach * reach - radius * radius);
  return h + (2 * reach * reach * reach / 3 - reach * reach * h + h * h * h / 3) / (radius * radius);
}

double bulge(double parent_radius, double radius) {
  const double excess = parent_radius * parent_radius - radius * radius;
  return excess > 0 ? 2 * excess * std::sqrt(excess) / (3 * radius * radius) : 0;
}

}  // namespace handsim::hand
