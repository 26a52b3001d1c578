// OpenGL 3.3 without a display, by OSMesa or by EGL without a surface; each has a file of its own.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "handsim/output/render/image.h"

namespace handsim::output {

/// Address of a function of OpenGL by its name.
using GlAddress = void (*(*)(const char*))();

/// An off-screen OpenGL 3.3 core context that frees its OpenGL objects. Drawing goes to frame buffer objects.
class Canvas {
 public:
  /// @param take makes the context this thread's; false if another thread has it
  Canvas(std::function<bool()> take, std::function<void()> free, GlAddress address)
      : take_(std::move(take)), free_(std::move(free)), address_(address) {}
  ~Canvas() { free_(); }
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  /// Sends this thread's OpenGL calls (gl_functions.h) here.
  /// @throws Error (input) if another thread has it, or a function is missing.
  void make_current();

 private:
  std::function<bool()> take_;
  std::function<void()> free_;
  GlAddress address_;
};

/// A context that is current. @param gl absent: the first of those that this build has.
/// @throws Error (input) if this build has not this kind, or no context can be created.
std::unique_ptr<Canvas> make_canvas(std::optional<Gl> gl);

/// One of the kinds; a build may lack one. @throws Error (input) if no context can be created.
std::unique_ptr<Canvas> make_osmesa_canvas();
std::unique_ptr<Canvas> make_egl_canvas();

/// Whether the system has the library, which these functions load.
bool finds_osmesa();
bool finds_egl();

}  // namespace handsim::output
