#include <GL/osmesa.h>

#include <vector>

#include "handsim/core/error.h"
#include "handsim/output/render/canvas.h"
#include "handsim/output/render/system_library.h"

namespace handsim::output {

namespace {

struct Osmesa {
  SystemLibrary library{"libOSMesa.so.8"};
  HANDSIM_SYSTEM_FUNCTION(OSMesaCreateContextAttribs);
  HANDSIM_SYSTEM_FUNCTION(OSMesaGetCurrentContext);
  HANDSIM_SYSTEM_FUNCTION(OSMesaMakeCurrent);
  HANDSIM_SYSTEM_FUNCTION(OSMesaDestroyContext);
  HANDSIM_SYSTEM_FUNCTION(OSMesaGetProcAddress);
};

/// OSMesa of the system, loaded at the first call.
const Osmesa& osmesa() {
  static const Osmesa out;
  return out;
}

OSMesaContext new_context() {
  // Pairs of name and value; by default RGBA without depth, stencil and accumulation.
  constexpr int kCore[] = {OSMESA_PROFILE,
                           OSMESA_CORE_PROFILE,
                           OSMESA_CONTEXT_MAJOR_VERSION,
                           3,
                           OSMESA_CONTEXT_MINOR_VERSION,
                           3,
                           0};
  return osmesa().library.found() ? osmesa().OSMesaCreateContextAttribs(kCore, nullptr) : nullptr;
}

}  // namespace

bool finds_osmesa() { return osmesa().library.found(); }

std::unique_ptr<Canvas> make_osmesa_canvas() {
  const OSMesaContext context = new_context();
  if (!context)
    throw input_error("rendering", "no off-screen OpenGL 3.3 context",
                      "a Mesa with OSMesa and llvmpipe (Debian package libosmesa6), or --gl egl");
  // The context wants a buffer of its own, which is never shown.
  constexpr int kEdge = 16;
  const auto take = [context, buffer = std::vector<unsigned char>(4UL * kEdge * kEdge)]() mutable {
    return osmesa().OSMesaGetCurrentContext() == context ||
           osmesa().OSMesaMakeCurrent(context, buffer.data(), GL_UNSIGNED_BYTE, kEdge, kEdge) == GL_TRUE;
  };
  // A context must not be current when it is destroyed.
  const auto free = [context] {
    if (osmesa().OSMesaGetCurrentContext() == context)
      osmesa().OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
    osmesa().OSMesaDestroyContext(context);
  };
  return std::make_unique<Canvas>(take, free, osmesa().OSMesaGetProcAddress);
}

}  // namespace handsim::output
