
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
