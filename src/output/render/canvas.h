// An off-screen OpenGL 3.3 core context: the one class that knows where OpenGL comes from (OSMesa). Drawing
// goes to frame buffer objects; the context's own buffer is never shown.
#pragma once

#include <memory>

namespace handsim::output {

class Canvas {
 public:
  /// Creates the context and makes it current. @throws Error (input) where there is none to be had.
  Canvas();
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  /// Sends the OpenGL calls of this thread to this context.
  void make_current();

  /// How many contexts this process has created.
  static int created();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace handsim::output
