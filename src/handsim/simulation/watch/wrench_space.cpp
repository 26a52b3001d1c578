#include "handsim/simulation/watch/wrench_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "handsim/core/least_squares.h"
#include "handsim/core/qhull.h"

namespace handsim::simulation {

namespace {

constexpr int kDimension = 6;
constexpr double kFlat = 1e-9;  ///< Wrench spaces thinner than this in some direction, against 1, are flat.

using Wrench = Eigen::Matrix<double, kDimension, 1>;

/// The wrenches of unit normal force along the pyramid's edges; a soft contact adds twists about its normal.
void add_edges(const WrenchContact& contact, double length, std::vector<Wrench>& out) {
  const Vec3 u = contact.normal.unitOrthogonal();
  const Vec3 v = contact.normal.cross(u);
  const auto add = [&](const Vec3& force, double twist) {
    Wrench wrench;
    wrench << force, (contact.position.cross(force) + twist * contact.normal) / length;
    out.push_back(wrench);
  };
  if (contact.friction == 0 && contact.spinning == 0) return add(contact.normal, 0);
  for (int i = 0; i < kConeEdges; ++i) {
    const double angle = 2 * M_PI * i / kConeEdges;
    add(contact.normal + contact.friction * (std::cos(angle) * u + std::sin(angle) * v), 0);
  }
  if (contact.spinning == 0) return;
  add(contact.normal, contact.spinning);
  add(contact.normal, -contact.spinning);
}

/// Whether the points lie in a hyperplane.
bool flat(const std::vector<Wrench>& points) {
  Eigen::MatrixXd spread(kDimension, points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    spread.col(static_cast<Eigen::Index>(i)) = points[i] - points.front();
  const Eigen::VectorXd sizes = singular_values(spread);
  return sizes.size() < kDimension || sizes[kDimension - 1] < kFlat;
}

}  // namespace

WrenchSpace wrench_space(std::span<const WrenchContact> contacts, double length) {
  std::vector<Wrench> points;
  for (const WrenchContact& contact : contacts) add_edges(contact, length, points);
  WrenchSpace out;
  if (points.size() <= kDimension || flat(points)) return out;
  std::vector<double> coordinates;
  for (const Wrench& point : points) coordinates.insert(coordinates.end(), point.begin(), point.end());
  // Qx merges coplanar facets and is exact to rounding; QJ moves the points by some 1e-11, for nearly
  // coplanar ones that defeat the merging.
  QhullState hull = run_qhull(coordinates, kDimension, "qhull Qx Pp");
  if (!hull) hull = run_qhull(coordinates, kDimension, "qhull QJ Pp");
  if (!hull) return out;
  double nearest = std::numeric_limits<double>::infinity();
  for (const facetT* facet = hull->facet_list; facet && facet->next; facet = facet->next)
    nearest = std::min(nearest, -facet->offset);
  qh_getarea(hull.get(), hull->facet_list);
  out.volume = hull->totvol;
  out.force_closure = nearest > kFlat;
  out.epsilon = std::max(0.0, nearest);
  return out;
}

}  // namespace handsim::simulation
