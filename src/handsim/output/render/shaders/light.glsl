#version 330 core
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
