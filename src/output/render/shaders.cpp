#include "handsim/output/render/shaders.h"

#include <fmt/format.h>

namespace handsim::output {

std::string shader_constants() {
  return fmt::format("const int kMaxOccluders = {};\nconst float kLightSize = {}, kSkyReach = {};\n",
                     kMaxOccluders, kLightSize, kSkyReach);
}

const char* const kLightFunctions = R"(#version 330 core
const vec3 kKey = vec3(1.00, 0.96, 0.90) * 0.80;
const vec3 kSky = vec3(0.92, 0.96, 1.00) * 0.40;
const vec3 kBounce = vec3(1.00, 0.97, 0.94) * 0.17;

uniform vec3 to_key;

vec3 to_srgb(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

uniform vec2 picture_origin;
uniform vec2 picture_size;

vec3 background() {
  vec2 at = (gl_FragCoord.xy + picture_origin) / picture_size;
  return mix(vec3(0.845, 0.862, 0.882), vec3(0.972, 0.978, 0.984), smoothstep(-0.1, 1.0, at.y));
}
)";

const char* const kOcclusionFunctions = R"(
// No branches: llvmpipe runs both sides of every `if`. No large tables: it loads every component separately.

// Share of the key light that passes a solid at distance s along the ray, with this gap between ray and solid.
float passing(float gap, float s, float thickness) {
  float blur = 0.04 * thickness;
  return smoothstep(-1.0, 1.0, (gap + blur) / (kLightSize * s + blur));
}

// Share of the sky that is visible, from the gaps at one third of the reach and at the full reach.
float open_sky(float near_gap, float far_gap, float reach) {
  float close = clamp(1.0 - near_gap / (0.33 * reach), 0.0, 1.0);
  float wide = clamp(1.0 - far_gap / reach, 0.0, 1.0);
  return 1.0 - 0.44 * close - 0.41 * wide;
}

float segment_gap(vec3 w, vec3 ab, float inverse, float r) {
  return length(w - clamp(dot(w, ab) * inverse, 0.0, 1.0) * ab) - r;
}

// Share of the key light at p that passes a capsule; start (a, r), span b - a.
float key_past_capsule(vec3 p, vec4 start, vec3 span) {
  vec3 w = p - start.xyz;
  float square = max(dot(span, span), 1e-12);
  float across = dot(to_key, span);
  float along = dot(to_key, w);
  // Closest approach of the ray p + s to_key, s >= 0, to the segment.
  float t = clamp((dot(span, w) - across * along) / max(square - across * across, 1e-6 * square), 0.0, 1.0);
  float s = max(t * across - along, 0.0);
  return passing(segment_gap(w + s * to_key, span, 1.0 / square, start.w), s, start.w);
}

// Share of the sky at p with normal n that passes it.
float sky_past_capsule(vec3 p, vec3 n, vec4 start, vec3 span) {
  vec3 w = p - start.xyz;
  float inverse = 1.0 / max(dot(span, span), 1e-12);
  float reach = kSkyReach * start.w;
  return open_sky(segment_gap(w + 0.33 * reach * n, span, inverse, start.w),
                  segment_gap(w + reach * n, span, inverse, start.w), reach);
}

vec3 unrotated(vec4 q, vec3 v) {
  vec3 u = 2.0 * cross(v, q.xyz);
  return v + q.w * u + cross(u, q.xyz);
}

float core_distance(vec3 p, vec3 size, bool cylinder) {
  vec3 q = cylinder ? vec3(length(p.xy) - size.x, abs(p.z) - size.z, -1e9) : abs(p) - size;
  return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0);
}

// The same for a rounded box or cylinder; place (centre, radius), quaternion q_WS, size (half extents, core).
float key_past_solid(vec3 p, vec4 place, vec4 q, vec4 size) {
  float thickness = place.w + min(size.x, min(size.y, size.z));
  vec3 o = unrotated(q, p - place.xyz);
  vec3 d = unrotated(q, to_key);
  // The ray point closest to the edge between the last slab it enters and the first one it leaves.
  d += vec3(1e-5) * (step(0.0, d) * 2.0 - 1.0);
  vec3 m = 1.0 / d;
  vec3 enter = -m * o - abs(m) * size.xyz;
  vec3 leave = -m * o + abs(m) * size.xyz;
  float t_enter = max(enter.x, max(enter.y, enter.z));
  float t_leave = min(leave.x, min(leave.y, leave.z));
  float w_enter = t_enter == enter.x ? d.x : t_enter == enter.y ? d.y : d.z;
  float w_leave = t_leave == leave.x ? d.x : t_leave == leave.y ? d.y : d.z;
  w_enter *= w_enter;
  w_leave *= w_leave;
  float s = max((w_enter * t_enter + w_leave * t_leave) / (w_enter + w_leave), 0.0);
  return passing(core_distance(o + s * d, size.xyz, size.w > 0.5) - place.w, s, thickness);
}

float sky_past_solid(vec3 p, vec3 n, vec4 place, vec4 q, vec4 size) {
  bool cylinder = size.w > 0.5;
  vec3 o = unrotated(q, p - place.xyz);
  vec3 up = unrotated(q, n);
  float reach = kSkyReach * (place.w + min(size.x, min(size.y, size.z)));
  return open_sky(core_distance(o + 0.33 * reach * up, size.xyz, cylinder) - place.w,
                  core_distance(o + reach * up, size.xyz, cylinder) - place.w, reach);
}
)";

const char* const kSolidVertex = R"(#version 330 core
layout(location = 0) in vec3 core;
layout(location = 1) in vec3 normal;
uniform mat4 view_projection;
uniform mat3 rotation;
uniform vec3 origin;
uniform vec3 half_size;
uniform float rounding;
out vec3 world_normal;
out vec3 world_point;
void main() {
  world_point = origin + rotation * (core * half_size + rounding * normal);
  world_normal = rotation * normal;
  gl_Position = view_projection * vec4(world_point, 1.0);
}
)";

const char* const kSurfaceFragment = R"(#version 330 core
in vec3 world_normal;
in vec3 world_point;
layout(location = 0) out vec4 point;
layout(location = 1) out vec4 normal;
void main() {
  point = vec4(world_point, 1.0);
  normal = vec4(world_normal, 0.0);
}
)";

const char* const kRectangleVertex = R"(#version 330 core
uniform vec4 rectangle;  // low and high corner, -1 to 1
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  gl_Position = vec4(mix(rectangle.xy, rectangle.zw, corner), 0.0, 1.0);
}
)";

const char* const kSolidFragment = R"(
uniform sampler2D points, normals;
uniform vec3 colour;
uniform float id;
uniform vec3 eye;
uniform vec3 to_fill;
uniform vec3 sky_up;
// Of each form: end of those that hide the key light, begin and end of those that hide the sky.
uniform int capsule_key_end, capsule_sky_begin, capsule_count;
uniform vec4 capsules[2 * kMaxOccluders];
#ifdef WITH_SOLIDS
uniform int solid_key_end, solid_sky_begin, solid_count;
uniform vec4 solids[3 * kMaxOccluders];
#endif
uniform vec2 ground;  // height, and distance within which it hides sky; 0: no ground
out vec4 pixel;

void main() {
  vec3 world_point = texelFetch(points, ivec2(gl_FragCoord.xy), 0).xyz;
  vec3 n = normalize(texelFetch(normals, ivec2(gl_FragCoord.xy), 0).xyz);
  vec3 v = normalize(eye - world_point);
  float key = 1.0;
  float sky = 1.0;
  float facing = max(dot(n, to_key), 0.0);
  // Where a whole block of pixels faces away from the light, llvmpipe leaves out the loop.
  int lit = facing > 0.0 ? 1 : 0;
  for (int i = 0; i < lit * capsule_key_end; ++i)
    key = min(key, key_past_capsule(world_point, capsules[2 * i], capsules[2 * i + 1].xyz));
  for (int i = capsule_sky_begin; i < capsule_count; ++i)
    sky *= sky_past_capsule(world_point, n, capsules[2 * i], capsules[2 * i + 1].xyz);
#ifdef WITH_SOLIDS
  for (int i = 0; i < lit * solid_key_end; ++i)
    key = min(key, key_past_solid(world_point, solids[3 * i], solids[3 * i + 1], solids[3 * i + 2]));
  for (int i = solid_sky_begin; i < solid_count; ++i)
    sky *= sky_past_solid(world_point, n, solids[3 * i], solids[3 * i + 1], solids[3 * i + 2]);
#endif
  float open = ground.y > 0.0 ? clamp((world_point.z - ground.x) / ground.y, 0.0, 1.0) : 1.0;
  sky *= mix(0.85 - 0.55 * max(-n.z, 0.0), 1.0, open);
  float up = 0.5 + 0.5 * dot(n, sky_up);
  float fill = 0.20 * max(dot(n, to_fill), 0.0) * (0.4 + 0.6 * sky);
  vec3 light = kKey * facing * key + mix(kBounce, kSky, up) * sky + fill;
  float rim = 1.0 - max(dot(n, v), 0.0);
  rim *= rim;
  float glance = max(dot(n, normalize(to_key + v)), 0.0);
  float shine = 0.13 * pow(glance, 36.0) * key * step(1e-4, facing) + 0.10 * rim * rim * sky * up;
  pixel = vec4(to_srgb(colour * light + shine), id);
}
)";

const char* const kShadeVertex = R"(#version 330 core
uniform vec4 region;  // of the ground: x, y of its low corner, width, depth
uniform vec4 quad;    // the part to draw, in the same form
uniform float ground_height;
out vec3 point;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec2 at = quad.xy + corner * quad.zw;
  point = vec3(at, ground_height);
  gl_Position = vec4(2.0 * (at - region.xy) / region.zw - 1.0, 0.0, 1.0);
}
)";

const char* const kShadeFragment = R"(
#ifdef WITH_SOLIDS
uniform vec4 solids[3];
#else
uniform vec4 capsules[2];
#endif
in vec3 point;
out vec4 shade;
void main() {
  vec3 n = vec3(0.0, 0.0, 1.0);
#ifdef WITH_SOLIDS
  float key = key_past_solid(point, solids[0], solids[1], solids[2]);
  float sky = sky_past_solid(point, n, solids[0], solids[1], solids[2]);
#else
  float key = key_past_capsule(point, capsules[0], capsules[1].xyz);
  float sky = sky_past_capsule(point, n, capsules[0], capsules[1].xyz);
#endif
  shade = vec4(key, key, key, sky);
}
)";

const char* const kGroundVertex = R"(#version 330 core
uniform mat4 view_projection;
uniform vec4 disc;  // centre, radius
out vec2 at;
void main() {
  vec2 corner = 2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0;
  at = disc.xy + disc.w * corner;
  gl_Position = view_projection * vec4(at, disc.z, 1.0);
}
)";

const char* const kGroundFragment = R"(
uniform vec4 disc;
uniform vec4 region;
uniform float spacing;
uniform float line_width;
uniform sampler2D shade;
in vec2 at;
out vec4 pixel;

// Share of the pixel's footprint on lines of distance 1 and of this width: the integral of the line pattern
// over a box, which does not alias (Inigo Quilez, "filterable procedurals").
float lines(vec2 p, vec2 footprint, float width) {
  vec2 f = max(footprint, vec2(1e-5));
  vec2 q = p + 0.5 * width;
  vec2 a = q + 0.5 * f;
  vec2 b = q - 0.5 * f;
  vec2 i = (floor(a) * width + min(fract(a), width) - floor(b) * width - min(fract(b), width)) / f;
  return 1.0 - (1.0 - i.x) * (1.0 - i.y);
}

void main() {
  vec2 footprint = 1.2 * fwidth(at) / spacing;
  float far = length(at - disc.xy) / disc.w;
  float shown = 1.0 - smoothstep(0.25, 1.0, far);
  vec2 s = (at - region.xy) / region.zw;
  bool inside = all(greaterThan(s, vec2(0.0))) && all(lessThan(s, vec2(1.0)));
  vec4 open = inside ? texture(shade, s) : vec4(1.0);
  vec3 albedo = vec3(0.865, 0.865, 0.860);
  float fine = lines(5.0 * at / spacing, 5.0 * footprint, 5.0 * line_width);
  float coarse = lines(at / spacing, footprint, 1.7 * line_width);
  albedo *= 1.0 - max(0.16 * fine, 0.36 * coarse) * (1.0 - smoothstep(0.2, 0.8, far));
  vec3 light = kKey * to_key.z * open.r + kSky * 0.78 * (0.25 + 0.75 * open.a);
  pixel = vec4(mix(background(), to_srgb(albedo * light), shown), 0.0);
}
)";

const char* const kBackgroundVertex = R"(#version 330 core
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  gl_Position = vec4(4.0 * corner - 1.0, 1.0, 1.0);
}
)";

const char* const kBackgroundFragment = R"(
out vec4 pixel;
void main() { pixel = vec4(background(), 0.0); }
)";

const char* const kIdFragment = R"(#version 330 core
uniform float id;
out vec4 pixel;
void main() { pixel = vec4(id); }
)";

const char* const kResolveFragment = R"(#version 330 core
uniform sampler2D colours;   // and the number of the solid at the pixel's centre
uniform sampler2DMS ids;     // of its four samples
uniform sampler2D palette;   // by the number, for what is too thin to cover the centre of a pixel
uniform vec2 last;           // pixel
out vec4 pixel;

vec4 at(ivec2 p) { return texelFetch(colours, clamp(p, ivec2(0), ivec2(last)), 0); }

// The colour with weight, if it is of this solid; the sum of weights in alpha.
vec4 of(vec4 colour, float id, float weight) {
  return colour.a == id ? vec4(weight * colour.rgb, weight) : vec4(0.0);
}

void main() {
  ivec2 p = ivec2(gl_FragCoord.xy);
  vec4 own = at(p);
  vec4 four = vec4(texelFetch(ids, p, 0).r, texelFetch(ids, p, 1).r, texelFetch(ids, p, 2).r, texelFetch(ids, p, 3).r);
  // Where a whole block of pixels has no edge, llvmpipe leaves out the loop.
  int samples = four == vec4(own.a) ? 0 : 4;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < samples; ++i) {
    float id = texelFetch(ids, p, i).r;
    vec4 found = of(own, id, 100.0);
    for (int k = 0; k < 4; ++k) {
      ivec2 side = ivec2((k & 1) * 2 - 1, 0);
      ivec2 corner = ivec2(side.x, (k & 2) - 1);
      if (k > 1) side = side.yx;
      found += of(at(p + side), id, 1.0) + of(at(p + corner), id, 0.1);
    }
    if (found.a == 0.0) found = vec4(texelFetch(palette, ivec2(int(255.0 * id + 0.5), 0), 0).rgb, 1.0);
    sum += 0.25 * found.rgb / found.a;
  }
  pixel = vec4(samples > 0 ? sum : own.rgb, 1.0);
}
)";

}  // namespace handsim::output
