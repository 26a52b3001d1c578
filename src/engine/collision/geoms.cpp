#include "handsim/engine/collision/geoms.h"

namespace handsim::engine {

dGeomID make_geom(dSpaceID space, const model::Shape& shape, std::size_t index) {
  dGeomID geom = nullptr;
  switch (shape.kind) {
    case model::ShapeKind::box:
      geom = dCreateBox(space, shape.edges.x(), shape.edges.y(), shape.edges.z());
      break;
    case model::ShapeKind::capsule:
      geom = dCreateCapsule(space, shape.radius, shape.length);
      break;
    case model::ShapeKind::cylinder:
      geom = dCreateCylinder(space, shape.radius, shape.length);
      break;
    case model::ShapeKind::sphere:
      geom = dCreateSphere(space, shape.radius);
      break;
    case model::ShapeKind::convex_mesh: {
      // ODE keeps the pointers, which it does not write to.
      const model::ConvexMesh& mesh = *shape.mesh;
      geom = dCreateConvex(space, mesh.planes.front().data(), static_cast<unsigned>(mesh.planes.size()),
                           mesh.vertices.front().data(), static_cast<unsigned>(mesh.vertices.size()),
                           mesh.loops.data());
      break;
    }
    case model::ShapeKind::plane:
      geom = dCreatePlane(space, 0, 0, 1, 0);
      break;
  }
  dGeomSetData(geom, reinterpret_cast<void*>(index));
  return geom;
}

void fix_geom(dGeomID geom, const model::Shape& shape, dBodyID body) {
  const dQuaternion q = {shape.pose.q.w(), shape.pose.q.x(), shape.pose.q.y(), shape.pose.q.z()};
  dGeomSetBody(geom, body);
  dGeomSetOffsetPosition(geom, shape.pose.p.x(), shape.pose.p.y(), shape.pose.p.z());
  dGeomSetOffsetQuaternion(geom, q);
}

void place_geom(dGeomID geom, const model::Shape& shape, const Pose& x_WB) {
  place_shape(geom, shape, x_WB * shape.pose);
}

void place_shape(dGeomID geom, const model::Shape& shape, const Pose& x_WS) {
  if (shape.kind == model::ShapeKind::plane) {
    const Vec3 normal = x_WS.q * Vec3::UnitZ();
    dGeomPlaneSetParams(geom, normal.x(), normal.y(), normal.z(), normal.dot(x_WS.p));
    return;
  }
  const dQuaternion q = {x_WS.q.w(), x_WS.q.x(), x_WS.q.y(), x_WS.q.z()};
  dGeomSetPosition(geom, x_WS.p.x(), x_WS.p.y(), x_WS.p.z());
  dGeomSetQuaternion(geom, q);
}

}  // namespace handsim::engine
