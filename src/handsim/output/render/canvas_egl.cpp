#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <cstring>

#include "handsim/core/error.h"
#include "handsim/output/render/canvas.h"
#include "handsim/output/render/system_library.h"

namespace handsim::output {

namespace {

struct Egl {
  SystemLibrary library{"libEGL.so.1"};
  HANDSIM_SYSTEM_FUNCTION(eglQueryString);
  HANDSIM_SYSTEM_FUNCTION(eglGetPlatformDisplay);
  HANDSIM_SYSTEM_FUNCTION(eglInitialize);
  HANDSIM_SYSTEM_FUNCTION(eglBindAPI);
  HANDSIM_SYSTEM_FUNCTION(eglCreateContext);
  HANDSIM_SYSTEM_FUNCTION(eglGetCurrentContext);
  HANDSIM_SYSTEM_FUNCTION(eglMakeCurrent);
  HANDSIM_SYSTEM_FUNCTION(eglDestroyContext);
  HANDSIM_SYSTEM_FUNCTION(eglGetProcAddress);
};

/// EGL of the system, loaded at the first call.
const Egl& egl() {
  static const Egl out;
  return out;
}

/// The process has one display, which is never closed: contexts of other canvases may live in it.
EGLDisplay surfaceless_display() {
  static const EGLDisplay display = [] {
    if (!egl().library.found()) return EGL_NO_DISPLAY;
    const char* known = egl().eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    if (!known || !std::strstr(known, "EGL_MESA_platform_surfaceless")) return EGL_NO_DISPLAY;
    const EGLDisplay found =
        egl().eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    return found != EGL_NO_DISPLAY && egl().eglInitialize(found, nullptr, nullptr) == EGL_TRUE
               ? found
               : EGL_NO_DISPLAY;
  }();
  return display;
}

EGLContext new_context(EGLDisplay display) {
  // The core profile is EGL's default.
  constexpr EGLint kVersion[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 3, EGL_NONE};
  // The kind of the contexts is a setting of the thread.
  if (display == EGL_NO_DISPLAY || egl().eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) return EGL_NO_CONTEXT;
  return egl().eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kVersion);
}

}  // namespace

bool finds_egl() { return egl().library.found(); }

std::unique_ptr<Canvas> make_egl_canvas() {
  const EGLDisplay display = surfaceless_display();
  const EGLContext context = new_context(display);
  if (context == EGL_NO_CONTEXT)
    throw input_error("rendering", "no OpenGL 3.3 context of EGL without a surface",
                      "a Mesa with EGL (Debian packages libegl1 and libgl1-mesa-dri), or --gl osmesa");
  const auto make_current = [display](EGLContext of) {
    return egl().eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, of) == EGL_TRUE;
  };
  const auto take = [=] {
    egl().eglBindAPI(EGL_OPENGL_API);
    return egl().eglGetCurrentContext() == context || make_current(context);
  };
  const auto free = [=] {
    if (egl().eglGetCurrentContext() == context) make_current(EGL_NO_CONTEXT);
    egl().eglDestroyContext(display, context);
  };
  return std::make_unique<Canvas>(take, free, egl().eglGetProcAddress);
}

}  // namespace handsim::output
