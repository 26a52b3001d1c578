// The meshes of a picture: of each solid, point and arrow the triangles, place, number and bounds.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <vector>

#include "handsim/output/render/gl_functions.h"
#include "handsim/output/render/lighting.h"

namespace handsim::output {

/// A mesh in the driver's memory.
struct Buffer {
  GLuint array = 0;
  std::array<GLuint, 2> data{};
  GLsizei count = 0;
};

/// A mesh in its place, what shades it, and its number in the picture.
struct Part {
  Solid solid;
  Colour colour;
  Buffer buffer;
  const LitSolid* lit = nullptr;  ///< of the scene; absent: nothing shades it
  bool on_top = false;
  float id = 0;  ///< 1/255 to 1
};

/// Parts with different numbers.
inline constexpr std::size_t kIds = 255;

/// Bounds of the solid in the picture: low and high corner, -1 to 1.
Eigen::Vector4f rectangle_of(const Solid& solid, const Eigen::Matrix4f& projection);

class Meshes {
 public:
  /// Makes the meshes in the OpenGL context that is current.
  Meshes();

  /// Solids of the scene nearest first, then points and arrows. @param height of the picture [pixels]
  std::vector<Part> parts(const LitScene& scene, int height);

 private:
  /// Numbers of sides of round meshes. Unneeded sides cost time.
  static constexpr std::array<int, 4> kSides = {20, 32, 56, 128};
  using RoundBuffers = std::array<Buffer, kSides.size()>;

  static RoundBuffers upload_round(struct Mesh (*make)(int));
  void add_annotations(const LitScene& scene, std::vector<Part>& parts) const;
  Buffer buffer_of(const LitScene& scene, const DrawShape& shape, int height);
  Buffer upload_skin(const Mesh& mesh);
  /// The coarsest mesh whose outline is wrong by less than a quarter of a pixel.
  static Buffer fitting(const RoundBuffers& buffers, const LitScene& scene, const DrawShape& shape,
                        int height);

  RoundBuffers capsule_, cylinder_;
  Buffer box_, cone_, ring_;
  /// Buffers of the polyhedra drawn so far; the keys keep the polyhedra alive.
  std::map<std::shared_ptr<const model::ConvexMesh>, Buffer> hulls_;
  /// Pieces of skin of one picture; the next one uses the buffers again.
  std::vector<Buffer> skins_;
  std::size_t used_skins_ = 0;
};

}  // namespace handsim::output
