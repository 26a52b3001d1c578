#include "handsim/scene/read/mesh_file.h"

extern "C" {
#include <libqhull_r/qhull_ra.h>
}

#include <algorithm>
#include <map>
#include <memory>

#include "handsim/core/error.h"

namespace handsim::scene {

namespace {

/// Frees Qhull's memory.
struct Release {
  void operator()(qhT* qh) const {
    qh_freeqhull(qh, !qh_ALL);
    int left = 0, blocks = 0;
    qh_memfreeshort(qh, &left, &blocks);
    delete qh;
  }
};

}  // namespace

Surface convex_hull(const std::vector<Vec3>& points) {
  std::unique_ptr<qhT, Release> owner(new qhT{});
  qhT* qh = owner.get();
  qh_zero(qh, nullptr);
  std::vector<Vec3> input = points;
  // Qhull merges coplanar facets into polygons. Its messages about bad input are discarded.
  char options[] = "qhull Pp";
  const std::unique_ptr<FILE, int (*)(FILE*)> silence(std::fopen("/dev/null", "w"), &std::fclose);
  const int status = qh_new_qhull(qh, 3, static_cast<int>(input.size()), input.front().data(), False, options,
                                  silence.get(), silence.get());
  if (status != 0) throw input_error("", "points that span no volume", "points of a solid body");

  Surface hull;
  std::map<int, int> index;
  facetT* facet = nullptr;
  FORALLfacets {
    std::vector<int>& face = hull.faces.emplace_back();
    setT* corners = qh_facet3vertex(qh, facet);
    vertexT* vertex = nullptr;
    vertexT** vertexp = nullptr;
    FOREACHvertex_(corners) {
      const int point = qh_pointid(qh, vertex->point);
      const auto [found, fresh] = index.emplace(point, static_cast<int>(hull.vertices.size()));
      if (fresh) hull.vertices.push_back(points[static_cast<std::size_t>(point)]);
      face.push_back(found->second);
    }
    qh_settempfree(qh, &corners);
    const auto at = [&](std::size_t i) { return hull.vertices[static_cast<std::size_t>(face[i])]; };
    Vec3 normal = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < face.size(); ++i) normal += (at(i) - at(0)).cross(at(i + 1) - at(0));
    if (normal.dot(Vec3(facet->normal[0], facet->normal[1], facet->normal[2])) < 0)
      std::reverse(face.begin(), face.end());
  }
  return hull;
}

}  // namespace handsim::scene
