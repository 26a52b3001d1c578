// Renders a draw list to a picture without a display (OSMesa or EGL): lit shapes and a ground with a grid and
// soft shadows, anti-aliased. Only the constructor of a Renderer creates an OpenGL context.
#pragma once

#include <memory>
#include <optional>

#include "handsim/output/render/draw_list.h"
#include "handsim/output/render/image.h"

namespace handsim::output {

class Renderer {
 public:
  /// @param gl absent: the default of this build.
  /// @throws Error (input) if no off-screen context can be created or the size is out of 16..8192 [pixels].
  Renderer(int width, int height, std::optional<Gl> gl = {});
  ~Renderer();

  /// The picture of the list. The key light comes from above and behind the left of the camera. The ground is
  /// drawn only if the camera is above it; the distance of its coarse grid lines is a power of ten (0.1 m for
  /// a hand), with five fine cells between two of them. The same list and camera give the same bytes on the
  /// same machine.
  /// @throws Error (input) for a camera without a direction or with a field of view out of 0..3 rad.
  Image draw(const DrawList& list, const Camera& camera);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace handsim::output
