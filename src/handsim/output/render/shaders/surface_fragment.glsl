#version 330 core
in vec3 world_normal;
in vec3 world_point;
in float of_finger;
layout(location = 0) out vec4 point;
layout(location = 1) out vec4 normal;
void main() {
  point = vec4(world_point, 1.0);
  normal = vec4(world_normal, of_finger);
}
