// The wrappers of OpenGL that the renderer needs; a Canvas's context frees all its OpenGL objects.
#pragma once

#include <Eigen/Core>
#include <string_view>
#include <vector>

#include "handsim/output/render/gl_functions.h"

namespace handsim::output {

/// OpenGL continues after errors, also when memory runs out. @throws Error if there was an error.
void require_no_error();

/// A linked vertex and fragment shader.
class Program {
 public:
  /// The parts of the fragment shader are concatenated. @throws Error if the driver rejects the source.
  Program(std::string_view vertex, const std::vector<std::string_view>& fragment);

  void use() const;
  /// Sets a uniform of the program in use.
  void set(const char* name, int value) const;
  void set(const char* name, float value) const;
  /// @param value a vector or a square matrix
  void set(const char* name, const Eigen::Ref<const Eigen::MatrixXf>& value) const;
  void set(const char* name, const std::vector<Eigen::Vector4f>& values) const;

 private:
  GLint location(const char* name) const;
  GLuint id_ = 0;
};

/// A frame buffer to draw into: colour, and possibly depth.
struct Target {
  GLuint framebuffer = 0;
  GLuint texture = 0;
  GLuint normals = 0;  ///< of surfaces
  GLuint depth = 0;    ///< with stencil, of surfaces
  int width = 0;
  int height = 0;

  /// Several samples a pixel of one component in a texture of this kind, with depth.
  /// @throws Error if the driver has no memory for it.
  static Target multisampled(int width, int height, int samples);
  /// One RGBA sample a pixel in a texture, 8 bits a component, without depth. @throws Error as above.
  static Target sampled(int width, int height);
  /// A float point (32 bits) and a normal (16 bits) a pixel in textures, with depth and stencil.
  static Target surfaces(int width, int height);
  /// Uses the depth and stencil of another target of this size, too.
  void share_depth(const Target& of) const;
  /// Draws into the lower left part of this size.
  void bind(int part_width, int part_height) const;
};

}  // namespace handsim::output
