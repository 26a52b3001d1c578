// OpenGL 3.3 without a display, by OSMesa or by EGL without a surface; each has a file of its own.
#pragma once

#include <memory>
#include <optional>

#include "handsim/output/render/gl_choice.h"

namespace handsim::output {

/// An off-screen OpenGL 3.3 core context that frees its OpenGL objects. Drawing goes to frame buffer objects.
class Canvas {
 public:
  virtual ~Canvas() = default;
  /// Sends this thread's OpenGL calls (gl_functions.h) here. @throws Error (input) if another thread has it.
  virtual void make_current() = 0;
};

/// A context that is current. @param gl absent: the first of those that this build has.
/// @throws Error (input) if this build has not this kind, or no context can be created.
std::unique_ptr<Canvas> make_canvas(std::optional<Gl> gl);

/// One of the kinds; a build may lack one. @throws Error (input) if no context can be created.
std::unique_ptr<Canvas> make_osmesa_canvas();
std::unique_ptr<Canvas> make_egl_canvas();

/// Address of a function of OpenGL by its name.
using GlAddress = void (*(*)(const char*))();
/// Sets this thread's functions (gl_functions.h). @throws Error (input) if one is missing.
void load_functions(GlAddress address);

}  // namespace handsim::output
