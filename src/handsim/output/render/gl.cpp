#include "handsim/output/render/gl.h"

#include <string>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::output {

namespace {

Error driver_error(const std::string& what) {
  return input_error(
      "rendering", what,
      "enough memory, and an off-screen OpenGL 3.3 driver (Debian package libosmesa6 or libegl1)");
}

GLuint compiled(GLenum kind, const std::vector<std::string_view>& parts) {
  std::string text;
  for (const std::string_view part : parts) text += part;
  const GLuint shader = glCreateShader(kind);
  const char* const whole = text.c_str();
  glShaderSource(shader, 1, &whole, nullptr);
  glCompileShader(shader);
  GLint done = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &done);
  if (done != GL_TRUE) {
    std::string log(2000, '\0');
    GLsizei length = 0;
    glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), &length, log.data());
    log.resize(static_cast<std::size_t>(length));
    throw driver_error("a shader that does not compile: " + log);
  }
  return shader;
}

/// A depth buffer of the frame buffer in use.
GLuint add_depth(int width, int height, int samples, GLenum format, GLenum attachment) {
  GLuint depth = 0;
  glGenRenderbuffers(1, &depth);
  glBindRenderbuffer(GL_RENDERBUFFER, depth);
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, width, height);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, attachment, GL_RENDERBUFFER, depth);
  return depth;
}

/// A texture as a colour of the frame buffer in use.
GLuint add_texture(int width, int height, GLenum format, GLenum type, GLenum attachment) {
  GLuint texture = 0;
  glGenTextures(1, &texture);
  glBindTexture(GL_TEXTURE_2D, texture);
  glTexImage2D(GL_TEXTURE_2D, 0, static_cast<GLint>(format), width, height, 0, GL_RGBA, type, nullptr);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  glFramebufferTexture2D(GL_FRAMEBUFFER, attachment, GL_TEXTURE_2D, texture, 0);
  return texture;
}

/// Without a texture; in use.
Target new_target(int width, int height) {
  Target target{0, 0, 0, 0, width, height};
  glGenFramebuffers(1, &target.framebuffer);
  glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer);
  return target;
}

void require_complete(const Target& target) {
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE || glGetError() != GL_NO_ERROR)
    throw driver_error(fmt::format("no frame buffer of {} x {} pixels", target.width, target.height));
}

}  // namespace

void require_no_error() {
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return;
  throw driver_error(error == GL_OUT_OF_MEMORY ? "too little memory to draw"
                                               : fmt::format("OpenGL error 0x{:04x}", error));
}

Program::Program(std::string_view vertex, const std::vector<std::string_view>& fragment)
    : id_(glCreateProgram()) {
  for (const GLuint shader : {compiled(GL_VERTEX_SHADER, {vertex}), compiled(GL_FRAGMENT_SHADER, fragment)}) {
    glAttachShader(id_, shader);
    glDeleteShader(shader);
  }
  glLinkProgram(id_);
  GLint done = 0;
  glGetProgramiv(id_, GL_LINK_STATUS, &done);
  if (done != GL_TRUE) throw driver_error("a shader that does not link");
}

GLint Program::location(const char* name) const { return glGetUniformLocation(id_, name); }

void Program::use() const { glUseProgram(id_); }
void Program::set(const char* name, int value) const { glUniform1i(location(name), value); }
void Program::set(const char* name, float value) const { glUniform1f(location(name), value); }
void Program::set(const char* name, const Eigen::Ref<const Eigen::MatrixXf>& value) const {
  const GLint at = location(name);
  if (value.cols() == 1)
    (value.rows() == 2 ? glUniform2fv : value.rows() == 3 ? glUniform3fv : glUniform4fv)(at, 1, value.data());
  else
    (value.rows() == 3 ? glUniformMatrix3fv : glUniformMatrix4fv)(at, 1, GL_FALSE, value.data());
}
void Program::set(const char* name, const std::vector<Eigen::Vector4f>& values) const {
  if (values.empty()) return;
  glUniform4fv(location(name), static_cast<GLsizei>(values.size()), values.front().data());
}

Target Target::multisampled(int width, int height, int samples) {
  Target target = new_target(width, height);
  glGenTextures(1, &target.texture);
  glBindTexture(GL_TEXTURE_2D_MULTISAMPLE, target.texture);
  glTexImage2DMultisample(GL_TEXTURE_2D_MULTISAMPLE, samples, GL_R8, width, height, GL_TRUE);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D_MULTISAMPLE, target.texture, 0);
  target.depth = add_depth(width, height, samples, GL_DEPTH_COMPONENT24, GL_DEPTH_ATTACHMENT);
  require_complete(target);
  return target;
}

Target Target::sampled(int width, int height) {
  Target target = new_target(width, height);
  target.texture = add_texture(width, height, GL_RGBA8, GL_UNSIGNED_BYTE, GL_COLOR_ATTACHMENT0);
  require_complete(target);
  return target;
}

Target Target::surfaces(int width, int height) {
  Target target = new_target(width, height);
  target.texture = add_texture(width, height, GL_RGBA32F, GL_FLOAT, GL_COLOR_ATTACHMENT0);
  target.normals = add_texture(width, height, GL_RGBA16F, GL_FLOAT, GL_COLOR_ATTACHMENT1);
  target.depth = add_depth(width, height, 0, GL_DEPTH24_STENCIL8, GL_DEPTH_STENCIL_ATTACHMENT);
  const GLenum both[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glDrawBuffers(2, both);
  require_complete(target);
  return target;
}

void Target::share_depth(const Target& of) const {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_STENCIL_ATTACHMENT, GL_RENDERBUFFER, of.depth);
  require_complete(*this);
}

void Target::bind(int part_width, int part_height) const {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  glViewport(0, 0, part_width, part_height);
}

}  // namespace handsim::output
