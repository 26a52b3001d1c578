#include "handsim/engine/collision/surface_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace handsim::engine {

namespace {

using model::ConvexMesh;

/// How far within the next cell its foot is sought, as a share of the line.
constexpr double kNextCell = 1e-9;
constexpr int kJumps = 40;

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
    const Eigen::Vector4d& rim = mesh.rims[as_index(edge)];
    if (rim.head<3>().dot(p) <= rim.w()) continue;
    const Vec3& a = corner(mesh, edge);
    const Vec3 along = corner(mesh, edges.after(edge)) - a;
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
  int start = mesh.face_towards(p);
  if (mesh.height(hint, p) > mesh.height(start, p)) start = hint;
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
      keep(mesh.rims[as_index(edge)].head<3>(), corner(mesh, edge));
  } else if (foot.corner) {
    around(mesh, foot.edge, [&](int edge) { keep(side(mesh, edge), foot.at); });
  } else {
    const Vec3 edge = side(mesh, foot.edge);
    const Vec3& end = corner(mesh, foot.edge);
    keep(-edge, end);
    keep(edge, end + edge);
    // Beyond the rims of both its faces.
    keep(-mesh.rims[as_index(foot.edge)].head<3>(), end);
    keep(-mesh.rims[as_index(mesh.twins[as_index(foot.edge)])].head<3>(), end);
  }
  return {low, high};
}

std::optional<double> least_in_cell(const ConvexMesh& mesh, const Foot& foot, const Vec3& start,
                                    const Vec3& along) {
  if (foot.edge < 0) return std::nullopt;
  Vec3 way = along, from = start - foot.at;
  if (!foot.corner) {
    const Vec3 edge = side(mesh, foot.edge).normalized();
    way -= edge.dot(way) * edge;
    from -= edge.dot(from) * edge;
  }
  const double square = way.squaredNorm();
  if (!(square > 0)) return std::nullopt;
  const double least = -from.dot(way) / square;
  const auto [low, high] = cell_of(mesh, foot, start, along);
  if (!(least >= low && least <= high)) return std::nullopt;
  return least;
}

namespace {

/// Beyond the edge of a cell; where rounding leaves it in the same cell, further.
double past(double edge, bool forward, int tries) {
  return edge + (forward ? 1 : -1) * kNextCell * std::pow(4, tries);
}

/// Of two cells beside each other: one of a face, the other not, or of another face.
bool is_bend(const Foot& a, const Foot& b) {
  return std::min(a.edge, b.edge) < 0 && (a.edge != b.edge || a.face != b.face);
}

}  // namespace

Bends bends_from(const ConvexMesh& mesh, const Vec3& start, const Vec3& along, const LineFoot& nearest,
                 double reach, bool forward) {
  Bends out;
  LineFoot at = nearest;
  double far = forward ? 1 : 0;
  const auto edge_of = [&](bool outwards) {
    const auto [low, high] = cell_of(mesh, at.foot, start, along);
    return outwards == forward ? std::max(high, at.t) : std::min(low, at.t);
  };
  const auto go_to = [&](double t) {
    const Foot next = nearest_foot(mesh, start + t * along, at.foot.face);
    if (next.distance <= reach) at = {t, next};
    return next.distance - reach;
  };
  const auto before_far = [&](double t) { return forward ? t < far : t > far; };
  double edge = edge_of(true), next = past(edge, forward, 0);
  if (!before_far(next)) return out;
  out.end_off = go_to(next) > 0;
  if (out.end_off) return out;
  if (is_bend(nearest.foot, at.foot)) out.inner = edge;
  // Into the outermost cell within reach: by false position, over the cells between.
  double above = go_to(far);
  out.end_off = above > 0;
  for (int i = 0, tries = 0; i < kJumps && above > 0; ++i) {
    edge = edge_of(true);
    tries = edge == at.t ? tries + 1 : 0;
    next = past(edge, forward, tries);
    if (!before_far(next)) break;
    const double below = go_to(next);
    if (below > 0) break;
    const double jump = (at.t * above - far * below) / (above - below);
    if (!before_far(jump) || (forward ? jump <= at.t : jump >= at.t)) continue;
    if (const double value = go_to(jump); value > 0) far = jump, above = value;
  }
  // Back from there.
  for (int tries = 0; forward ? at.t > nearest.t : at.t < nearest.t;) {
    edge = edge_of(false);
    if (forward ? edge <= nearest.t : edge >= nearest.t) break;
    tries = edge == at.t ? tries + 1 : 0;
    next = past(edge, !forward, tries);
    const Foot foot = nearest_foot(mesh, start + next * along, at.foot.face);
    if (is_bend(foot, at.foot)) {
      out.outer = edge;
      break;
    }
    at = {next, foot};
  }
  return out;
}

}  // namespace handsim::engine
