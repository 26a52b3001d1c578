#version 330 core
uniform mat4 view_projection;
uniform vec4 disc;  // centre, radius
out vec2 at;
void main() {
  vec2 corner = 2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0;
  at = disc.xy + disc.w * corner;
  gl_Position = view_projection * vec4(at, disc.z, 1.0);
}
