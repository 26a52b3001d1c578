#version 330 core
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
