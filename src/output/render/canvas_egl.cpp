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
  // The core profile is EGL's default.
  constexpr EGLint kVersion[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 3, EGL_NONE};
  // The kind of the contexts is a setting of the thread.
  if (display == EGL_NO_DISPLAY || eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) return EGL_NO_CONTEXT;
  return eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kVersion);
}

}  // namespace

std::unique_ptr<Canvas> make_egl_canvas() {
  const EGLDisplay display = surfaceless_display();
  const EGLContext context = new_context(display);
  if (context == EGL_NO_CONTEXT)
    throw input_error("rendering", "no OpenGL 3.3 context of EGL without a surface",
                      "a Mesa with EGL (Debian packages libegl1 and libgl1-mesa-dri), or --gl osmesa");
  const auto make_current = [display](EGLContext of) {
    return eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, of) == EGL_TRUE;
  };
  const auto take = [=] {
    eglBindAPI(EGL_OPENGL_API);
    return eglGetCurrentContext() == context || make_current(context);
  };
  const auto free = [=] {
    if (eglGetCurrentContext() == context) make_current(EGL_NO_CONTEXT);
    eglDestroyContext(display, context);
  };
  return std::make_unique<Canvas>(take, free, eglGetProcAddress);
}

}  // namespace handsim::output
