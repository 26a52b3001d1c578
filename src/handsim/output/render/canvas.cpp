#include "handsim/output/render/canvas.h"

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/output/render/gl_functions.h"

namespace handsim::output {

const char* name_of(Gl gl) { return gl == Gl::egl ? "egl" : "osmesa"; }

std::vector<Gl> built_gls() {
  std::vector<Gl> out;
#ifdef HANDSIM_OSMESA
  out.push_back(Gl::osmesa);
#endif
#ifdef HANDSIM_EGL
  out.push_back(Gl::egl);
#endif
  return out;
}

void require_pictures() {
  bool found = false;
#ifdef HANDSIM_OSMESA
  found = found || finds_osmesa();
#endif
#ifdef HANDSIM_EGL
  found = found || finds_egl();
#endif
  if (!found)
    throw input_error("pictures", "no OpenGL on this system",
                      "Mesa's EGL or OSMesa (Debian packages libegl1 and libgl1-mesa-dri)");
}

std::unique_ptr<Canvas> make_canvas(std::optional<Gl> gl) {
  // A build that has both takes what the system has.
  if (!gl && built_gls().size() > 1) try {
      return make_canvas(built_gls().front());
    } catch (const Error&) {
      return make_canvas(built_gls().back());
    }
  const Gl wanted = gl.value_or(built_gls().front());
  std::unique_ptr<Canvas> out;
#ifdef HANDSIM_OSMESA
  if (wanted == Gl::osmesa) out = make_osmesa_canvas();
#endif
#ifdef HANDSIM_EGL
  if (wanted == Gl::egl) out = make_egl_canvas();
#endif
  if (!out)
    throw input_error("--gl", name_of(wanted),
                      fmt::format("{}, which this build has", name_of(built_gls().front())));
  out->make_current();
  return out;
}

void Canvas::make_current() {
  if (!take_())
    throw input_error("rendering", "an off-screen OpenGL context that cannot be made current",
                      "one thread at a time for each Renderer");
  const char* missing = nullptr;
#define HANDSIM_LOAD(TYPE, NAME)                                        \
  gl##NAME = reinterpret_cast<PFNGL##TYPE##PROC>(address_("gl" #NAME)); \
  if (!gl##NAME) missing = "gl" #NAME;
  HANDSIM_GL_FUNCTIONS(HANDSIM_LOAD)
#undef HANDSIM_LOAD
  if (missing)
    throw input_error("rendering", fmt::format("an OpenGL driver without {}", missing), "OpenGL 3.3");
}

}  // namespace handsim::output
