// Draw list in, picture out, with no display: OSMesa behind one class. Lit shapes, a ground with a grid
// and soft shadows, anti-aliased. Building a Renderer creates the OpenGL context; nothing else does.
#pragma once

#include <memory>

#include "handsim/output/draw_list.h"
#include "handsim/output/image.h"

namespace handsim::output {

class Renderer {
 public:
  /// @throws Error (input) where no off-screen context can be made or the size is out of 16..8192.
  Renderer(int width, int height);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  Image draw(const DrawList& list, const Camera& camera);

  /// How many contexts this process has created (a run without pictures leaves it alone).
  static int contexts_created();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace handsim::output
