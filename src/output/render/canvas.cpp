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

std::unique_ptr<Canvas> make_canvas(std::optional<Gl> gl) {
  // A wheel has both and takes what the system has.
  if (!gl && built_gls().size() > 1) try {
      return make_canvas(built_gls().front());
    } catch (const Error&) {
      return make_canvas(built_gls().back());
    }
  const Gl wanted = gl.value_or(built_gls().front());
#ifdef HANDSIM_OSMESA
  if (wanted == Gl::osmesa) return make_osmesa_canvas();
#endif
#ifdef HANDSIM_EGL
  if (wanted == Gl::egl) return make_egl_canvas();
#endif
  throw input_error("--gl", name_of(wanted),
                    fmt::format("{}, which this build has", name_of(built_gls().front())));
}

void load_functions(GlAddress address) {
  const char* missing = nullptr;
#define HANDSIM_LOAD(TYPE, NAME)                                       \
  gl##NAME = reinterpret_cast<PFNGL##TYPE##PROC>(address("gl" #NAME)); \
  if (!gl##NAME) missing = "gl" #NAME;
  HANDSIM_GL_FUNCTIONS(HANDSIM_LOAD)
#undef HANDSIM_LOAD
  if (missing)
    throw input_error("rendering", fmt::format("an OpenGL driver without {}", missing), "OpenGL 3.3");
}

}  // namespace handsim::output
