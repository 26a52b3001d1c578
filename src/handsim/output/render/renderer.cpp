#include "handsim/output/render/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <span>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/output/render/canvas.h"
#include "handsim/output/render/gl.h"
#include "handsim/output/render/lighting.h"
#include "handsim/output/render/parts.h"
#include "handsim/output/render/shaders.h"

namespace handsim::output {

namespace {

constexpr int kSmallest = 16;
constexpr int kLargest = 8192;
/// Pictures larger than this are drawn in tiles, which bounds the memory [pixels].
constexpr int kTile = 2048;
constexpr int kSamples = 4;
/// Depth below the ground up to which a surface is no part of the picture's edges [m].
constexpr double kSunk = 1e-4;
/// Edge of the ground's shade texture [texels]; it need not be finer than the picture.
int shade_size(int height) { return std::clamp(height * 2 / 3, 64, 512); }

int checked_size(int size, const char* what) {
  if (size < kSmallest || size > kLargest)
    throw input_error(what, fmt::format("{}", size), fmt::format("{}..{} pixels", kSmallest, kLargest));
  return size;
}

Program shaded_program(std::string_view vertex, std::string_view forms, std::string_view fragment) {
  const std::string constants = shader_constants();
  return {vertex, {shaders::light_glsl, forms, constants, shaders::occlusion_glsl, fragment}};
}

/// A part of the picture; x and y of its lower left corner.
struct Tile {
  int x, y, width, height;
};

Eigen::Vector3f vector_of(const Colour& colour) { return {colour.r, colour.g, colour.b}; }

/// Grey of the ground in a gap that is narrower than a pixel.
constexpr std::uint8_t kShaded = 150;

/// Component of sRGB, 0..255, of a linear one in average light.
std::uint8_t dimmed(float linear) {
  const float c = 0.75F * linear;
  return static_cast<std::uint8_t>(255 *
                                   (c < 0.0031F ? 12.92F * c : 1.055F * std::pow(c, 1 / 2.4F) - 0.055F));
}

}  // namespace

struct Renderer::Impl {
  Impl(int picture_width, int picture_height, std::optional<Gl> gl);

  Image draw(const DrawList& list, const Camera& camera);

  void draw_shade(const LitScene& scene);
  void draw_tile(const LitScene& scene, const std::vector<Part>& parts, const Tile& tile);
  void draw_background();
  void draw_surfaces(const std::vector<Part>& parts, std::size_t begin, std::size_t end);
  void draw_light(const LitScene& scene, std::span<const Part> parts, const Eigen::Matrix4f& projection);
  void draw_ground(const LitScene& scene, const Eigen::Matrix4f& projection);
  void draw_ids(const LitScene& scene, const std::vector<Part>& parts, const Eigen::Matrix4f& projection);
  void resolve(const std::vector<Part>& parts, const Tile& tile);
  void place(const Program& program, const Part& part);
  void draw(const Buffer& buffer) {
    glBindVertexArray(buffer.array);
    glDrawElements(GL_TRIANGLES, buffer.count, GL_UNSIGNED_INT, nullptr);
  }
  void draw_quad() {
    glBindVertexArray(empty);
    glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  }
  void read(const Tile& tile, Image& image);

  int width, height;
  std::unique_ptr<Canvas> canvas;
  /// Programs for capsules as the only occluders are faster than those for all forms.
  Program capsule_lit = shaded_program(shaders::rectangle_vertex_glsl, "", shaders::solid_fragment_glsl);
  Program solid_lit =
      shaded_program(shaders::rectangle_vertex_glsl, kWithSolids, shaders::solid_fragment_glsl);
  Program capsule_shade = shaded_program(shaders::shade_vertex_glsl, "", shaders::shade_fragment_glsl);
  Program solid_shade = shaded_program(shaders::shade_vertex_glsl, kWithSolids, shaders::shade_fragment_glsl);
  Program ground_program{shaders::ground_vertex_glsl, {shaders::light_glsl, shaders::ground_fragment_glsl}};
  Program background_program{shaders::background_vertex_glsl,
                             {shaders::light_glsl, shaders::background_fragment_glsl}};
  Program surface_program{shaders::solid_vertex_glsl, {shaders::surface_fragment_glsl}};
  Program id_program{shaders::solid_vertex_glsl, {shaders::id_fragment_glsl}};
  Program ground_id_program{shaders::ground_vertex_glsl, {shaders::id_fragment_glsl}};
  Program resolve_program{shaders::background_vertex_glsl, {shaders::resolve_fragment_glsl}};
  // Light and shadows cost most and are computed once a pixel; edges get their samples from cheap numbers.
  Target surfaces, drawn, ids, resolved, shade;
  GLuint palette = 0;
  Meshes meshes;
  GLuint empty = 0;
  std::vector<std::uint8_t> pixels;
};

Renderer::Impl::Impl(int picture_width, int picture_height, std::optional<Gl> gl)
    : width(checked_size(picture_width, "picture.width")),
      height(checked_size(picture_height, "picture.height")),
      canvas(make_canvas(gl)),
      surfaces(Target::surfaces(std::min(width, kTile), std::min(height, kTile))),
      drawn(Target::sampled(surfaces.width, surfaces.height)),
      ids(Target::multisampled(drawn.width, drawn.height, kSamples)),
      resolved(Target::sampled(drawn.width, drawn.height)),
      shade(Target::sampled(shade_size(height), shade_size(height))) {
  drawn.share_depth(surfaces);
  glGenVertexArrays(1, &empty);
  glGenTextures(1, &palette);
  glBindTexture(GL_TEXTURE_2D, palette);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  pixels.resize(4UL * as_index(drawn.width) * as_index(drawn.height));
}

Image Renderer::Impl::draw(const DrawList& list, const Camera& camera) {
  const LitScene scene(list, camera, static_cast<double>(width) / height);
  canvas->make_current();
  if (scene.ground) draw_shade(scene);
  Image image{width, height, {}};
  const std::vector<Part> parts = meshes.parts(scene, height);
  image.rgb.resize(3UL * as_index(width) * as_index(height));
  for (int y = 0; y < height; y += drawn.height)
    for (int x = 0; x < width; x += drawn.width) {
      const Tile tile = {x, y, std::min(drawn.width, width - x), std::min(drawn.height, height - y)};
      draw_tile(scene, parts, tile);
      read(tile, image);
    }
  return image;
}

void Renderer::Impl::draw_shade(const LitScene& scene) {
  shade.bind(shade.width, shade.height);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glClearColor(1, 1, 1, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  // Key light: the minimum, because solids that a joint connects overlap. Sky: the product.
  glEnable(GL_BLEND);
  glBlendEquationSeparate(GL_MIN, GL_FUNC_ADD);
  glBlendFuncSeparate(GL_ONE, GL_ONE, GL_DST_ALPHA, GL_ZERO);
  for (const Program* program : {&capsule_shade, &solid_shade}) {
    program->use();
    program->set("to_key", scene.to_key);
    program->set("region", scene.ground->region);
    program->set("ground_height", scene.ground->height);
    for (const Shade& part : scene.ground->shades) {
      if ((part.occluder.solids.count == 0) != (program == &capsule_shade)) continue;
      program->set("quad", part.quad);
      program->set("capsules", part.occluder.capsules.rows);
      program->set("solids", part.occluder.solids.rows);
      draw_quad();
    }
  }
  glDisable(GL_BLEND);
}

void Renderer::Impl::draw_tile(const LitScene& scene, const std::vector<Part>& parts, const Tile& tile) {
  // Scales the tile's part of the picture to the viewport.
  Eigen::Matrix4f part = Eigen::Matrix4f::Identity();
  part(0, 0) = static_cast<float>(width) / static_cast<float>(tile.width);
  part(1, 1) = static_cast<float>(height) / static_cast<float>(tile.height);
  part(0, 3) = part(0, 0) - 1 - 2 * static_cast<float>(tile.x) / static_cast<float>(tile.width);
  part(1, 3) = part(1, 1) - 1 - 2 * static_cast<float>(tile.y) / static_cast<float>(tile.height);
  const Eigen::Matrix4f projection = part * scene.view_projection;
  const Eigen::Vector2f origin(static_cast<float>(tile.x), static_cast<float>(tile.y));
  const Eigen::Vector2f size(static_cast<float>(width), static_cast<float>(height));
  for (const Program* program : {&background_program, &ground_program}) {
    program->use();
    program->set("picture_origin", origin);
    program->set("picture_size", size);
  }
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LEQUAL);
  glClearColor(0, 0, 0, 0);
  ids.bind(tile.width, tile.height);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  draw_ids(scene, parts, projection);
  surface_program.use();
  surface_program.set("view_projection", projection);
  // The stencil has the numbers of so many parts; all parts hide.
  glStencilOp(GL_KEEP, GL_KEEP, GL_REPLACE);
  for (std::size_t begin = 0; begin < parts.size(); begin += kIds) {
    const std::size_t end = std::min(begin + kIds, parts.size());
    glEnable(GL_STENCIL_TEST);
    surfaces.bind(tile.width, tile.height);
    glClear(GL_DEPTH_BUFFER_BIT | GL_STENCIL_BUFFER_BIT);
    draw_surfaces(parts, begin, end);
    drawn.bind(tile.width, tile.height);
    draw_light(scene, std::span(parts).subspan(begin, end - begin), projection);
    glDisable(GL_STENCIL_TEST);
  }
  drawn.bind(tile.width, tile.height);
  if (parts.empty()) glClear(GL_DEPTH_BUFFER_BIT);
  draw_ground(scene, projection);
  draw_background();
  glDisable(GL_DEPTH_TEST);
  resolve(parts, tile);
}

void Renderer::Impl::place(const Program& program, const Part& part) {
  // A piece of skin is in the world already.
  const bool skin = part.lit && part.lit->skin;
  const Solid solid = skin ? Solid{Core::hull, {}, 0, {}, {}} : part.solid;
  program.set("rotation", Eigen::Matrix3f(solid.pose.q.toRotationMatrix().cast<float>()));
  program.set("origin", Eigen::Vector3f(solid.pose.p.cast<float>()));
  program.set("half_size", solid.core == Core::hull ? Eigen::Vector3f(1, 1, 1)
                                                    : Eigen::Vector3f(solid.half.cast<float>()));
  program.set("rounding", static_cast<float>(solid.round));
  program.set("id", part.id);
  glDepthFunc(part.on_top ? GL_ALWAYS : GL_LEQUAL);
}

void Renderer::Impl::draw_surfaces(const std::vector<Part>& parts, std::size_t begin, std::size_t end) {
  glEnable(GL_CULL_FACE);
  surface_program.use();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const bool counts = i >= begin && i < end;
    glStencilFunc(GL_ALWAYS, counts ? static_cast<GLint>(i - begin + 1) : 0, 0xFF);
    place(surface_program, parts[i]);
    draw(parts[i].buffer);
  }
  glDepthFunc(GL_LEQUAL);
}

/// The light of pixels that show one of the parts, each computed once.
void Renderer::Impl::draw_light(const LitScene& scene, std::span<const Part> parts,
                                const Eigen::Matrix4f& projection) {
  glDisable(GL_CULL_FACE);
  glDisable(GL_DEPTH_TEST);
  glActiveTexture(GL_TEXTURE1);
  glBindTexture(GL_TEXTURE_2D, surfaces.normals);
  glActiveTexture(GL_TEXTURE0);
  glBindTexture(GL_TEXTURE_2D, surfaces.texture);
  for (const Program* program : {&solid_lit, &capsule_lit}) {
    program->use();
    program->set("points", 0);
    program->set("normals", 1);
    program->set("to_key", scene.to_key);
    program->set("to_fill", scene.to_fill);
    program->set("sky_up", scene.sky_up);
    program->set("eye", scene.eye);
  }
  const Occluders none;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Part& part = parts[i];
    const Occluders& from = part.lit ? part.lit->occluders : none;
    const Program& program = from.solids.count == 0 ? capsule_lit : solid_lit;
    program.use();
    program.set("rectangle", rectangle_of(part.solid, projection));
    program.set("id", part.id);
    program.set("colour", vector_of(part.colour));
    program.set("finger", vector_of(part.lit ? part.lit->finger : part.colour));
    program.set("flesh", part.lit && part.lit->skin ? 1.0F : 0.0F);
    Eigen::Vector2f ground_shade(0, 0);
    if (scene.ground && part.lit)
      ground_shade << scene.ground->height, 3 * static_cast<float>(part.solid.thickness());
    program.set("ground", ground_shade);
    program.set("capsule_key_end", from.capsules.key_end);
    program.set("capsule_sky_begin", from.capsules.sky_begin);
    program.set("capsule_count", from.capsules.count);
    program.set("capsules", from.capsules.rows);
    program.set("solid_key_end", from.solids.key_end);
    program.set("solid_sky_begin", from.solids.sky_begin);
    program.set("solid_count", from.solids.count);
    program.set("solids", from.solids.rows);
    glStencilFunc(GL_EQUAL, static_cast<GLint>(i + 1), 0xFF);
    draw_quad();
  }
  glEnable(GL_DEPTH_TEST);
}

void Renderer::Impl::draw_ids(const LitScene& scene, const std::vector<Part>& parts,
                              const Eigen::Matrix4f& projection) {
  glEnable(GL_CULL_FACE);
  id_program.use();
  id_program.set("view_projection", projection);
  for (const Part& part : parts) {
    place(id_program, part);
    draw(part.buffer);
  }
  glDepthFunc(GL_LEQUAL);
  // The ground has number 0 as the background has; it matters where it hides what is below.
  if (!scene.ground || -support(*scene.list, -Vec3::UnitZ()) > scene.ground->height - kSunk) return;
  glDisable(GL_CULL_FACE);
  ground_id_program.use();
  ground_id_program.set("view_projection", projection);
  ground_id_program.set("disc", scene.ground->disc);
  ground_id_program.set("id", 0.0F);
  draw_quad();
}

void Renderer::Impl::resolve(const std::vector<Part>& parts, const Tile& tile) {
  std::array<std::uint8_t, 4UL * (kIds + 1)> colours{kShaded, kShaded, kShaded};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    std::uint8_t* entry = &colours[4 * (1 + i % kIds)];
    const Colour& colour = parts[i].colour;
    for (const float c : {colour.r, colour.g, colour.b}) *entry++ = dimmed(c);
  }
  resolved.bind(tile.width, tile.height);
  glDisable(GL_CULL_FACE);
  resolve_program.use();
  resolve_program.set("colours", 0);
  resolve_program.set("ids", 1);
  resolve_program.set("palette", 2);
  resolve_program.set(
      "last", Eigen::Vector2f(static_cast<float>(tile.width - 1), static_cast<float>(tile.height - 1)));
  glActiveTexture(GL_TEXTURE2);
  glBindTexture(GL_TEXTURE_2D, palette);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, kIds + 1, 1, 0, GL_RGBA, GL_UNSIGNED_BYTE, colours.data());
  glActiveTexture(GL_TEXTURE1);
  glBindTexture(GL_TEXTURE_2D_MULTISAMPLE, ids.texture);
  glActiveTexture(GL_TEXTURE0);
  glBindTexture(GL_TEXTURE_2D, drawn.texture);
  glBindVertexArray(empty);
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void Renderer::Impl::draw_ground(const LitScene& scene, const Eigen::Matrix4f& projection) {
  if (!scene.ground) return;
  glDisable(GL_CULL_FACE);
  ground_program.use();
  ground_program.set("view_projection", projection);
  ground_program.set("to_key", scene.to_key);
  ground_program.set("disc", scene.ground->disc);
  ground_program.set("region", scene.ground->region);
  ground_program.set("spacing", scene.ground->spacing);
  ground_program.set("line_width", scene.ground->line_width);
  glBindTexture(GL_TEXTURE_2D, shade.texture);
  draw_quad();
}

void Renderer::Impl::draw_background() {
  glDisable(GL_CULL_FACE);
  background_program.use();
  glBindVertexArray(empty);
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void Renderer::Impl::read(const Tile& tile, Image& image) {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved.framebuffer);
  glReadPixels(0, 0, tile.width, tile.height, GL_RGBA, GL_UNSIGNED_BYTE, pixels.data());
  require_no_error();
  // OpenGL stores the lowest row first, the image the highest.
  const std::uint8_t* from = pixels.data();
  for (int row = 0; row < tile.height; ++row) {
    const int line = image.height - 1 - tile.y - row;
    std::uint8_t* to = &image.rgb[3UL * (as_index(line) * as_index(image.width) + as_index(tile.x))];
    for (int x = 0; x < tile.width; ++x, from += 4, to += 3) std::memcpy(to, from, 3);
  }
}

Renderer::Renderer(int width, int height, std::optional<Gl> gl)
    : impl_(std::make_unique<Impl>(width, height, gl)) {}
Renderer::~Renderer() = default;
Image Renderer::draw(const DrawList& list, const Camera& camera) { return impl_->draw(list, camera); }

}  // namespace handsim::output
