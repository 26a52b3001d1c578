#include "handsim/engine/collision/surface_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace handsim::engine {

namespace {

using model::ConvexMesh;

/// The edges of a face: indices of `loops`.
struct FaceEdges {
  int first, last;

  FaceEdges(const ConvexMesh& mesh, int face) : first(mesh.loop_starts[as_index(face)] + 1) {
    last = first - 1 + static_cast<int>(mesh.loops[as_index(first - 1)]);
  }
  int after(int edge) const { return edge < last ? edge + 1 : first; }
  int before(int edge) const { return edge > first ? edge - 1 : last; }
};

const Vec3& corner(const ConvexMesh& mesh, int edge) { return mesh.vertex(mesh.loops[as_index(edge)]); }

Vec3 side(const ConvexMesh& mesh, int edge) {
  return corner(mesh, FaceEdges(mesh, mesh.owners[as_index(edge)]).after(edge)) - corner(mesh, edge);
}

int across(const ConvexMesh& mesh, int edge) { return mesh.owners[as_index(mesh.twins[as_index(edge)])]; }

/// Calls visit(edge) for the edges that leave a corner, from one of them on.
template <class Visit>
void around(const ConvexMesh& mesh, int first, const Visit& visit) {
  int edge = first;
  do {
    visit(edge);
    edge = mesh.twins[as_index(FaceEdges(mesh, mesh.owners[as_index(edge)]).before(edge))];
  } while (edge != first);
}

/// The nearest point of a face to p above it.
Foot foot_on(const ConvexMesh& mesh, int face, const Vec3& p) {
  const Vec3 n = mesh.normal(face);
  const double height = mesh.height(face, p);
  Foot foot{height, n, p - height * n, face};
  double least = std::numeric_limits<double>::infinity();
  const FaceEdges edges(mesh, face);
  for (int edge = edges.first; edge <= edges.last; ++edge) {
    const Vec3& a = corner(mesh, edge);
    const Vec3 along = corner(mesh, edges.after(edge)) - a;
    if (along.cross(n).dot(p - a) <= 0) continue;
    const double share = std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
    const Vec3 on = a + share * along;
    const double square = (p - on).squaredNorm();
    if (square >= least) continue;
    least = square;
    foot = {0, n, on, face, share < 1 ? edge : edges.after(edge), share <= 0 || share >= 1};
  }
  if (foot.edge < 0) return foot;
  foot.distance = std::sqrt(least);
  // A point on the surface has no direction towards it.
  if (foot.distance > 1e-9 * mesh.reach) foot.normal = (p - foot.at) / foot.distance;
  return foot;
}

/// A face below p that leads from a foot on the rim of another nearer to p, or -1.
int nearer_face(const ConvexMesh& mesh, const Foot& foot, const Vec3& p) {
  const auto below = [&](int face) { return mesh.height(face, p) > 0; };
  const Vec3 away = p - foot.at;
  int best = -1;
  if (!foot.corner) {
    const int beside = across(mesh, foot.edge);
    return below(beside) && mesh.normal(beside).cross(side(mesh, foot.edge)).dot(away) < 0 ? beside : -1;
  }
  double most = 0;
  around(mesh, foot.edge, [&](int edge) {
    const Vec3 along = side(mesh, edge);
    const double rise = along.dot(away) / along.norm();
    const int left = mesh.owners[as_index(edge)], right = across(mesh, edge);
    if (rise <= most || !(below(left) || below(right))) return;
    most = rise;
    best = left != foot.face && below(left) ? left : right;
  });
  return best;
}

}  // namespace

Foot nearest_foot(const ConvexMesh& mesh, const Vec3& p, int hint) {
  // Any face below p serves; inside there is none, and the highest is nearest.
  int start = hint;
  for (int f = 0; f < mesh.face_count() && !(mesh.height(start, p) > 0); ++f)
    if (mesh.height(f, p) > mesh.height(start, p)) start = f;
  const double height = mesh.height(start, p);
  if (!(height > 0)) return {height, mesh.normal(start), p - height * mesh.normal(start), start};
  Foot foot = foot_on(mesh, start, p);
  while (foot.edge >= 0) {
    const int nearer = nearer_face(mesh, foot, p);
    if (nearer < 0) break;
    const Foot next = foot_on(mesh, nearer, p);
    if (!(next.distance < foot.distance)) break;
    foot = next;
  }
  return foot;
}

std::pair<double, double> cell_of(const ConvexMesh& mesh, const Foot& foot, const Vec3& start,
                                  const Vec3& along) {
  double low = 0, high = 1;
  // Keeps what lies on the inner side of n . (x - at) = 0.
  const auto keep = [&](const Vec3& n, const Vec3& at) {
    const double height = n.dot(start - at), rise = n.dot(along);
    if (rise > 0) high = std::min(high, -height / rise);
    if (rise < 0) low = std::max(low, -height / rise);
  };
  if (foot.edge < 0) {
    const FaceEdges edges(mesh, foot.face);
    for (int edge = edges.first; edge <= edges.last; ++edge)
      keep(side(mesh, edge).cross(mesh.normal(foot.face)), corner(mesh, edge));
  } else if (foot.corner) {
    around(mesh, foot.edge, [&](int edge) { keep(side(mesh, edge), foot.at); });
  } else {
    const Vec3 edge = side(mesh, foot.edge);
    const Vec3& end = corner(mesh, foot.edge);
    keep(-edge, end);
    keep(edge, end + edge);
    keep(mesh.normal(mesh.owners[as_index(foot.edge)]).cross(edge), end);
    keep(edge.cross(mesh.normal(across(mesh, foot.edge))), end);
  }
  return {low, high};
}

}  // namespace handsim::engine
