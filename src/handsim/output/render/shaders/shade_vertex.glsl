#version 330 core
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
