#include "handsim/output/shaders.h"

namespace handsim::output {

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
  vec3 c = mix(vec3(0.845, 0.862, 0.882), vec3(0.972, 0.978, 0.984), smoothstep(-0.1, 1.0, at.y));
  vec2 off = at - 0.5;
  return c - 0.05 * dot(off, off);
}
)";

const char* const kOcclusionFunctions = R"(
const float kLightSize = 0.11;  // tangent of the angle of half the key light
const int kCylinder = 1;


float core_distance(vec3 p, vec3 half_size, int core) {
  if (core == kCylinder) {
    vec2 q = vec2(length(p.xy), abs(p.z)) - half_size.xz;
    return length(max(q, 0.0)) + min(max(q.x, q.y), 0.0);
  }
  vec3 q = abs(p) - half_size;
  return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0);
}

// Closest approach of the ray o + s d, s >= 0, to the core: (distance, s).
vec2 closest_to_segment(vec3 o, vec3 d, float half_length) {
  float along = dot(o, d);
  float t = clamp((o.z - d.z * along) / max(1.0 - d.z * d.z, 1e-6), -half_length, half_length);
  float s = max(t * d.z - along, 0.0);
  t = clamp(o.z + s * d.z, -half_length, half_length);
  return vec2(length(o + s * d - vec3(0.0, 0.0, t)), s);
}

// The distance from a convex solid is convex along a ray: halve the interval on the sign of its slope.
vec2 closest_to_solid(vec3 o, vec3 d, vec3 half_size, int core) {
  float middle = -dot(o, d);
  float extent = length(half_size);
  float low = max(middle - extent, 0.0);
  float high = max(middle + extent, 0.0);
  float step_size = 1e-3 * extent;
  for (int i = 0; i < 8; ++i) {
    float s = 0.5 * (low + high);
    vec3 p = o + s * d;
    if (core_distance(p + step_size * d, half_size, core) > core_distance(p, half_size, core)) high = s;
    else low = s;
  }
  float s = 0.5 * (low + high);
  return vec2(core_distance(o + s * d, half_size, core), s);
}

// Share of the key light that passes the solid, 0..1.
float key_share(vec3 o, vec3 d, vec4 size, float thickness, int core) {
  bool segment = size.x <= 0.0 && size.y <= 0.0;
  vec2 near = segment ? closest_to_segment(o, d, size.z) : closest_to_solid(o, d, size.xyz, core);
  float blur = 0.04 * thickness;
  return smoothstep(-1.0, 1.0, (near.x - size.w + blur) / (kLightSize * near.y + blur));
}

// Share of the sky about the normal n that the solid leaves open, from distances at three heights.
float sky_share(vec3 o, vec3 n, vec4 size, float thickness, int core) {
  float height = 2.6 * thickness;
  float closed = 0.0;
  closed += 0.34 * clamp(1.0 - (core_distance(o + 0.15 * height * n, size.xyz, core) - size.w) / (0.15 * height), 0.0, 1.0);
  closed += 0.33 * clamp(1.0 - (core_distance(o + 0.45 * height * n, size.xyz, core) - size.w) / (0.45 * height), 0.0, 1.0);
  closed += 0.33 * clamp(1.0 - (core_distance(o + height * n, size.xyz, core) - size.w) / height, 0.0, 1.0);
  return 1.0 - 0.85 * closed;
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

static_assert(kMaxOccluders == 24, "the size of `occluders` below");
const char* const kSolidFragment = R"(
uniform vec3 colour;
uniform vec3 eye;
uniform vec3 to_fill;
uniform vec3 sky_up;
uniform int occluder_count;
uniform vec4 occluders[5 * 24];  // three rows of X_SW, half extents and radius, (core, thickness)
uniform vec2 ground;             // (height, reach of its shade), reach 0: no ground
in vec3 world_normal;
in vec3 world_point;
out vec4 pixel;

void main() {
  vec3 n = normalize(world_normal);
  vec3 v = normalize(eye - world_point);
  float key = 1.0;
  float sky = 1.0;
  float facing = dot(n, to_key);
  for (int i = 0; i < occluder_count; ++i) {
    vec4 x = occluders[5 * i], y = occluders[5 * i + 1], z = occluders[5 * i + 2];
    vec4 size = occluders[5 * i + 3];
    vec4 more = occluders[5 * i + 4];
    vec4 p = vec4(world_point, 1.0);
    vec3 o = vec3(dot(x, p), dot(y, p), dot(z, p));
    vec3 n_s = vec3(dot(x.xyz, n), dot(y.xyz, n), dot(z.xyz, n));
    vec3 d_s = vec3(dot(x.xyz, to_key), dot(y.xyz, to_key), dot(z.xyz, to_key));
    if (facing > 0.0) key = min(key, key_share(o, d_s, size, more.y, int(more.x)));
    sky *= sky_share(o, n_s, size, more.y, int(more.x));
  }
  if (ground.y > 0.0) {
    float open = clamp((world_point.z - ground.x) / ground.y, 0.0, 1.0);
    sky *= mix(1.0 - 0.55 * max(-n.z, 0.0) - 0.15, 1.0, open);
  }
  float up = 0.5 + 0.5 * dot(n, sky_up);
  vec3 light = kKey * max(facing, 0.0) * key + mix(kBounce, kSky, up) * sky + 0.20 * max(dot(n, to_fill), 0.0) * (0.4 + 0.6 * sky);
  vec3 h = normalize(to_key + v);
  float fresnel = pow(1.0 - max(dot(n, v), 0.0), 4.0);
  float shine = 0.13 * pow(max(dot(n, h), 0.0), 36.0) * key * step(0.0, facing) + 0.10 * fresnel * sky * up;
  pixel = vec4(to_srgb(colour * light + shine), 1.0);
}
)";

const char* const kShadeVertex = R"(#version 330 core
uniform vec4 region;  // of the ground: x, y of its low corner, width, depth
uniform vec4 quad;    // the same of the part to draw
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
uniform vec4 occluders[5];
in vec3 point;
out vec4 shade;
void main() {
  vec4 x = occluders[0], y = occluders[1], z = occluders[2], size = occluders[3], more = occluders[4];
  vec4 p = vec4(point, 1.0);
  vec3 o = vec3(dot(x, p), dot(y, p), dot(z, p));
  vec3 n_s = vec3(x.z, y.z, z.z);
  vec3 d_s = vec3(dot(x.xyz, to_key), dot(y.xyz, to_key), dot(z.xyz, to_key));
  float key = key_share(o, d_s, size, more.y, int(more.x));
  shade = vec4(key, key, key, sky_share(o, n_s, size, more.y, int(more.x)));
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

// Share of the pixel's footprint that lies on lines one apart and `width` wide: the integral of the line
// pattern over a box, so it never aliases (Inigo Quilez, "filterable procedurals").
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
  pixel = vec4(mix(background(), to_srgb(albedo * light), shown), 1.0);
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
void main() { pixel = vec4(background(), 1.0); }
)";

}  // namespace handsim::output
