#version 330 core
layout(location = 0) in vec3 core;
layout(location = 1) in vec3 normal;
layout(location = 2) in float finger;
uniform mat4 view_projection;
uniform mat3 rotation;
uniform vec3 origin;
uniform vec3 half_size;
uniform float rounding;
out vec3 world_normal;
out vec3 world_point;
out float of_finger;
void main() {
  world_point = origin + rotation * (core * half_size + rounding * normal);
  world_normal = rotation * normal;
  of_finger = finger;
  gl_Position = view_projection * vec4(world_point, 1.0);
}
