#include <GL/osmesa.h>

#include <array>

#include "handsim/core/error.h"
#include "handsim/output/render/canvas.h"

namespace handsim::output {

namespace {

OSMesaContext new_context() {
  // Pairs of name and value; by default RGBA without depth, stencil and accumulation.
  constexpr int kCore[] = {OSMESA_PROFILE,
                           OSMESA_CORE_PROFILE,
                           OSMESA_CONTEXT_MAJOR_VERSION,
                           3,
                           OSMESA_CONTEXT_MINOR_VERSION,
                           3,
                           0};
  return OSMesaCreateContextAttribs(kCore, nullptr);
}

class OsmesaCanvas final : public Canvas {
 public:
  OsmesaCanvas() : context_(new_context()) {
    if (!context_)
      throw input_error("rendering", "no off-screen OpenGL 3.3 context",
                        "a Mesa with OSMesa and llvmpipe (Debian package libosmesa6), or --gl egl");
  }
  ~OsmesaCanvas() override {
    // A context must not be current when it is destroyed.
    if (OSMesaGetCurrentContext() == context_) OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
    OSMesaDestroyContext(context_);
  }
  OsmesaCanvas(const OsmesaCanvas&) = delete;
  OsmesaCanvas& operator=(const OsmesaCanvas&) = delete;

  void make_current() override {
    if (OSMesaGetCurrentContext() != context_ &&
        OSMesaMakeCurrent(context_, buffer_.data(), GL_UNSIGNED_BYTE, kEdge, kEdge) != GL_TRUE)
      throw input_error("rendering", "an off-screen OpenGL context that cannot be made current",
                        "one thread at a time for each Renderer");
    load_functions(OSMesaGetProcAddress);
  }

 private:
  /// The context wants a buffer of its own, which is never shown.
  static constexpr int kEdge = 16;
  std::array<unsigned char, 4UL * kEdge * kEdge> buffer_{};
  OSMesaContext context_;
};

}  // namespace

std::unique_ptr<Canvas> make_osmesa_canvas() {
  auto canvas = std::make_unique<OsmesaCanvas>();
  canvas->make_current();
  return canvas;
}

}  // namespace handsim::output
