#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <cstring>

#include "handsim/core/error.h"
#include "handsim/output/render/canvas.h"

namespace handsim::output {

namespace {

/// The process has one display, which is never closed: contexts of other canvases may live in it.
EGLDisplay surfaceless_display() {
  static const EGLDisplay display = [] {
    const char* known = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    if (!known || !std::strstr(known, "EGL_MESA_platform_surfaceless")) return EGL_NO_DISPLAY;
    const EGLDisplay found =
        eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    return found != EGL_NO_DISPLAY && eglInitialize(found, nullptr, nullptr) == EGL_TRUE ? found
                                                                                         : EGL_NO_DISPLAY;
  }();
  return display;
}

EGLContext new_context(EGLDisplay display) {
  constexpr EGLint kCore[] = {EGL_CONTEXT_MAJOR_VERSION,
                              3,
                              EGL_CONTEXT_MINOR_VERSION,
                              3,
                              EGL_CONTEXT_OPENGL_PROFILE_MASK,
                              EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                              EGL_NONE};
  // The kind of the contexts is a setting of the thread.
  if (display == EGL_NO_DISPLAY || eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) return EGL_NO_CONTEXT;
  return eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kCore);
}

class EglCanvas final : public Canvas {
 public:
  EglCanvas() : display_(surfaceless_display()), context_(new_context(display_)) {
    if (context_ == EGL_NO_CONTEXT)
      throw input_error("rendering", "no OpenGL 3.3 context of EGL without a surface",
                        "a Mesa with EGL (Debian packages libegl1 and libgl1-mesa-dri), or --gl osmesa");
  }
  ~EglCanvas() override {
    if (eglGetCurrentContext() == context_)
      eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_, context_);
  }
  EglCanvas(const EglCanvas&) = delete;
  EglCanvas& operator=(const EglCanvas&) = delete;

  void make_current() override {
    eglBindAPI(EGL_OPENGL_API);
    if (eglGetCurrentContext() != context_ &&
        eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE)
      throw input_error("rendering", "an EGL context that cannot be made current",
                        "one thread at a time for each Renderer");
    load_functions(eglGetProcAddress);
  }

 private:
  EGLDisplay display_;
  EGLContext context_;
};

}  // namespace

std::unique_ptr<Canvas> make_egl_canvas() {
  auto canvas = std::make_unique<EglCanvas>();
  canvas->make_current();
  return canvas;
}

}  // namespace handsim::output
