#include "handsim/output/render/canvas.h"

// Before Mesa's header, which else includes OpenGL's without its functions.
#include "handsim/output/render/gl.h"

#include <GL/osmesa.h>

#include <array>
#include <atomic>

#include "handsim/core/error.h"

namespace handsim::output {

namespace {

constexpr int kEdge = 16;

std::atomic<int>& counter() {
  static std::atomic<int> count = 0;
  return count;
}

OSMesaContext new_context() {
  constexpr std::array<int, 16> attributes = {OSMESA_FORMAT,
                                              OSMESA_RGBA,
                                              OSMESA_DEPTH_BITS,
                                              0,
                                              OSMESA_STENCIL_BITS,
                                              0,
                                              OSMESA_ACCUM_BITS,
                                              0,
                                              OSMESA_PROFILE,
                                              OSMESA_CORE_PROFILE,
                                              OSMESA_CONTEXT_MAJOR_VERSION,
                                              3,
                                              OSMESA_CONTEXT_MINOR_VERSION,
                                              3,
                                              0,
                                              0};
  return OSMesaCreateContextAttribs(attributes.data(), nullptr);
}

}  // namespace

struct Canvas::Impl {
  Impl() : context(new_context()) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (context == nullptr) return;
    // A context must not be current when it goes.
    if (OSMesaGetCurrentContext() == context) OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
    OSMesaDestroyContext(context);
  }

  OSMesaContext context = nullptr;
  std::array<unsigned char, 4UL * kEdge * kEdge> buffer{};
};

Canvas::Canvas() : impl_(std::make_unique<Impl>()) {
  if (impl_->context == nullptr)
    throw input_error("rendering", "no off-screen OpenGL 3.3 context",
                      "a Mesa with OSMesa and llvmpipe (Debian package libosmesa6)");
  make_current();
  ++counter();
}

Canvas::~Canvas() = default;

void Canvas::make_current() {
  if (OSMesaGetCurrentContext() == impl_->context) return;
  if (OSMesaMakeCurrent(impl_->context, impl_->buffer.data(), GL_UNSIGNED_BYTE, kEdge, kEdge) != GL_TRUE)
    throw input_error("rendering", "an off-screen OpenGL context that cannot be made current",
                      "one thread at a time for each Renderer");
}

int Canvas::created() { return counter(); }

}  // namespace handsim::output
