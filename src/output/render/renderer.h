// Draw list in, picture out, with no display: OSMesa behind one class. Lit shapes, a ground with a grid
// and soft shadows, anti-aliased. Building a Renderer creates the OpenGL context; nothing else does.
#pragma once

#include <memory>

#include "handsim/output/render/draw_list.h"
#include "handsim/output/render/image.h"

namespace handsim::output {

class Renderer {
 public:
  /// @throws Error (input) where no off-screen context can be made or the size is out of 16..8192.
  Renderer(int width, int height);
  ~Renderer();

  /// The picture of the list. The key light stands over the camera's left shoulder, high above a ground; a
  /// ground seen from below is left out; its coarse grid lines are a power of ten apart (0.1 m about a
  /// hand) with five cells between. The same list and camera give the same bytes on the same machine.
  /// @throws Error (input) for a camera without a direction or with a field of view out of 0..3 rad.
  Image draw(const DrawList& list, const Camera& camera);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace handsim::output
