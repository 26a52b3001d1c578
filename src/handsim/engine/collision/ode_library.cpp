#include "handsim/engine/collision/ode_library.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <mutex>

#include <ode/ode.h>

namespace handsim::engine {

namespace {

thread_local int lcp_failure_count = 0;

[[noreturn]] void throw_fault(int number, const char* format, va_list arguments) {
  std::array<char, 512> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw OdeFault{number, text.data()};
}

extern "C" void handsim_ode_fault(int number, const char* format, va_list arguments) {
  throw_fault(number, format, arguments);
}

extern "C" void handsim_ode_message(int number, const char* /*format*/, va_list /*arguments*/) {
  if (number == d_ERR_LCP) ++lcp_failure_count;
}

/// ODE does not test what it is given.
extern "C" void* handsim_ode_allocate(dsizeint size) {
  void* block = std::malloc(size);
  if (block == nullptr) throw OdeFault{kNoMemory, "out of memory"};
  return block;
}

extern "C" void* handsim_ode_reallocate(void* block, dsizeint /*old_size*/, dsizeint size) {
  void* larger = std::realloc(block, size);
  if (larger == nullptr) throw OdeFault{kNoMemory, "out of memory"};
  return larger;
}

void initialise_process() {
  dSetAllocHandler(handsim_ode_allocate);
  dSetReallocHandler(handsim_ode_reallocate);
  dInitODE2(0);
  dSetErrorHandler(handsim_ode_fault);
  dSetDebugHandler(handsim_ode_fault);
  dSetMessageHandler(handsim_ode_message);
}

struct ThreadData {
  ThreadData() {
    static std::mutex mutex;
    static bool initialised = false;
    const std::lock_guard lock(mutex);
    if (!initialised) initialise_process();
    initialised = true;
    // ODE frees it with the thread. Debian's build has one set for all threads, which none may clean up.
    dAllocateODEDataForThread(static_cast<unsigned>(dAllocateMaskAll));
  }
};

}  // namespace

void enter_ode() {
  thread_local const ThreadData data;
  static_cast<void>(data);
}

int lcp_failures() { return lcp_failure_count; }

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
