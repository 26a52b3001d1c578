#include "handsim/engine/collision/polytope.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace handsim::engine {

namespace {

using model::ConvexMesh;

/// A face is the contact unless another feature is nearer by this share of the smaller solid (rounding).
constexpr double kPrefer = 1e-4;
/// Pads: edges stand for the contact where nearer than this share of the faces' overlap within each other's
/// outline. Corners beyond it may be deeper: an edge along a face would flip between one point and two.
constexpr double kEdgeShare = 0.8;

struct Point {
  Vec3 position;  ///< on the solid that is clipped
  double depth = 0;
};

/// Four that span the most: the deepest, the farthest from it, and the farthest on either side of that line.
Manifold reduced(std::vector<Point>& points, const Vec3& normal) {
  Manifold out;
  const auto take = [&](const auto& value) {
    const Point* best = nullptr;
    double most = 0;
    for (const Point& point : points)
      if (const double v = value(point); v > most) most = v, best = &point;
    if (best == nullptr) return;
    ManifoldPoint& kept = out.points[static_cast<std::size_t>(out.count++)];
    kept = {best->position, normal, best->depth};
  };
  take([](const Point& p) { return p.depth; });
  if (out.count == 0) return out;
  const Vec3 first = out.points[0].position;
  take([&](const Point& p) { return (p.position - first).norm() - 1e-9; });
  if (out.count == 1) return out;
  const Vec3 across = (out.points[1].position - first).cross(normal).normalized();
  for (const double side : {1.0, -1.0})
    take([&](const Point& p) { return side * across.dot(p.position - first) - 1e-9; });
  return out;
}

/// Points are on the one solid; contacts lie midway between the two.
Manifold midway(Manifold manifold, const Vec3& outward) {
  for (int i = 0; i < manifold.count; ++i) {
    ManifoldPoint& point = manifold.points[static_cast<std::size_t>(i)];
    point.position += 0.5 * point.depth * outward;
  }
  return manifold;
}

/// The other solid's mesh in the frame of the first, without what walks over a surface need.
ConvexMesh seen_from(const ConvexMesh& mesh, const Pose& pose) {
  ConvexMesh out;
  out.loops = mesh.loops;
  out.loop_starts = mesh.loop_starts;
  out.edges = mesh.edges;
  out.reach = mesh.reach;
  out.inner = mesh.inner;
  for (const Vec3& vertex : mesh.vertices) out.vertices.emplace_back(pose * vertex);
  for (const Eigen::Vector4d& plane : mesh.planes) {
    const Vec3 n = pose.q * Vec3(plane.head<3>());
    out.planes.emplace_back(n.x(), n.y(), n.z(), plane.w() + n.dot(pose.p));
  }
  return out;
}

struct FaceGap {
  int face = 0;
  double value = -std::numeric_limits<double>::infinity();  ///< negative: penetration
};

/// @param centre the other's centroid
FaceGap face_gap(const ConvexMesh& of, const ConvexMesh& other, const Vec3& centre) {
  FaceGap best;
  for (int f = 0; f < of.face_count(); ++f) {
    // The sphere in the other shows that its gap is smaller.
    if (of.height(f, centre) - other.inner <= best.value) continue;
    const double gap = -other.support(-of.normal(f)) - of.planes[static_cast<std::size_t>(f)].w();
    if (gap > best.value) best = {f, gap};
    if (gap > 0) break;
  }
  return best;
}

struct EdgeGap {
  double value = -std::numeric_limits<double>::infinity();
  Vec3 normal = Vec3::Zero();  ///< out of the first
  Vec3 on_first = Vec3::Zero(), on_second = Vec3::Zero();
};

/// Do the arcs that two edges are on the Gauss maps of a and of -b cross? Only such pairs can be nearest.
bool arcs_cross(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 bxa = b.cross(a);
  const Vec3 dxc = d.cross(c);
  const double cba = c.dot(bxa), dba = d.dot(bxa), adc = a.dot(dxc), bdc = b.dot(dxc);
  return cba * dba < 0 && adc * bdc < 0 && cba * bdc > 0;
}

/// The largest gap between edges of both if it exceeds a value, else that value.
EdgeGap edge_gap(const ConvexMesh& a, const ConvexMesh& b, const Vec3& centre, double least) {
  EdgeGap best{.value = least};
  for (const ConvexMesh::Edge& e : a.edges) {
    // The axis lies between the normals of the edge's faces, and the sphere within b bounds its gap.
    const double height = std::max({0.0, a.height(e.left, centre), a.height(e.right, centre)});
    const double cosine = a.normal(e.left).dot(a.normal(e.right));
    if (height * std::sqrt(2 / (1 + cosine)) - b.inner <= best.value) continue;
    const Vec3& p = a.vertices[static_cast<std::size_t>(e.from)];
    const Vec3 along_a = a.vertices[static_cast<std::size_t>(e.to)] - p;
    for (const ConvexMesh::Edge& g : b.edges) {
      if (!arcs_cross(a.normal(e.left), a.normal(e.right), -b.normal(g.left), -b.normal(g.right))) continue;
      const Vec3& q = b.vertices[static_cast<std::size_t>(g.from)];
      const Vec3 along_b = b.vertices[static_cast<std::size_t>(g.to)] - q;
      Vec3 n = along_a.cross(along_b);
      const double size = n.norm();
      if (size < 1e-6 * along_a.norm() * along_b.norm()) continue;
      n /= size;
      // The centroid of a is the origin.
      if (n.dot(p) < 0) n = -n;
      const double gap = n.dot(q - p);
      if (gap <= best.value) continue;
      best.value = gap;
      best.normal = n;
      const Vec3 r = q - p;
      best.on_first = p + r.cross(along_b).dot(along_a.cross(along_b)) / (size * size) * along_a;
      best.on_second = q + r.cross(along_a).dot(along_a.cross(along_b)) / (size * size) * along_b;
    }
  }
  return best;
}

/// What of a polygon lies on the inner side of n . x = d.
void clip(std::vector<Vec3>& polygon, const Vec3& n, double d, std::vector<Vec3>& scratch) {
  scratch.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& from = polygon[i];
    const Vec3& to = polygon[(i + 1) % polygon.size()];
    const double start = n.dot(from) - d, end = n.dot(to) - d;
    if (start <= 0) scratch.push_back(from);
    if ((start < 0 && end > 0) || (start > 0 && end < 0))
      scratch.push_back(from + start / (start - end) * (to - from));
  }
  polygon.swap(scratch);
}

/// The other's face that is most opposed, cut to the reference face's outline; points on it that are below.
Manifold face_contact(const ConvexMesh& reference, int face, const ConvexMesh& other) {
  const Vec3 n = reference.normal(face);
  int incident = 0;
  for (int f = 1; f < other.face_count(); ++f)
    if (n.dot(other.normal(f)) < n.dot(other.normal(incident))) incident = f;
  std::vector<Vec3> polygon, scratch;
  for (const unsigned corner : other.corners(incident)) polygon.push_back(other.vertex(corner));
  const auto outline = reference.corners(face);
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vec3& a = reference.vertex(outline[i]);
    const Vec3 out = (reference.vertex(outline[(i + 1) % outline.size()]) - a).cross(n).normalized();
    clip(polygon, out, out.dot(a), scratch);
  }
  std::vector<Point> points;
  for (const Vec3& point : polygon)
    if (const double height = reference.height(face, point); height < 0) points.push_back({point, -height});
  return midway(reduced(points, n), n);
}

}  // namespace

Manifold mesh_on_mesh(const ConvexMesh& a, const Pose& x_WA, const ConvexMesh& b, const Pose& x_WB,
                      bool pad) {
  if ((x_WA.p - x_WB.p).norm() > a.reach + b.reach) return {};
  const Pose x_AB = x_WA.inverse() * x_WB;
  const ConvexMesh other = seen_from(b, x_AB);
  const FaceGap of_a = face_gap(a, other, x_AB.p);
  if (of_a.value > 0) return {};
  const FaceGap of_b = face_gap(other, a, Vec3::Zero());
  if (of_b.value > 0) return {};
  const EdgeGap edges = edge_gap(a, other, x_AB.p, std::max(of_a.value, of_b.value));
  if (edges.value > 0) return {};
  const double prefer = kPrefer * std::min(a.reach, b.reach);
  // Normals of all three kinds leave a; out of b into a is what the caller wants.
  Manifold found;
  bool edges_meet = edges.value > std::max(of_a.value, of_b.value) + prefer;
  if (pad || !edges_meet) {
    if (of_b.value > of_a.value + prefer) {
      found = face_contact(other, of_b.face, a);
    } else {
      found = face_contact(a, of_a.face, other);
      for (ManifoldPoint& point : found.points) point.normal = -point.normal;
    }
  }
  // The first point is the deepest.
  if (pad) edges_meet = edges_meet && -edges.value <= kEdgeShare * found.points[0].depth;
  if (edges_meet) {
    found.count = 1;
    found.points[0] = {0.5 * (edges.on_first + edges.on_second), -edges.normal, -edges.value};
  }
  for (int i = 0; i < found.count; ++i) {
    ManifoldPoint& point = found.points[static_cast<std::size_t>(i)];
    point.position = x_WA * point.position;
    point.normal = x_WA.q * point.normal;
  }
  return found;
}

Manifold mesh_on_plane(const ConvexMesh& mesh, const Pose& x_WS, const Pose& x_WP) {
  const Vec3 n = x_WP.q * Vec3::UnitZ();
  std::vector<Point> points;
  if (n.dot(x_WS.p - x_WP.p) > mesh.reach) return {};
  for (const Vec3& vertex : mesh.vertices) {
    const Vec3 at = x_WS * vertex;
    if (const double height = n.dot(at - x_WP.p); height < 0) points.push_back({at, -height});
  }
  return midway(reduced(points, n), n);
}

}  // namespace handsim::engine
