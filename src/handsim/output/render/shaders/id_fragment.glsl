#version 330 core
uniform float id;
out vec4 pixel;
void main() { pixel = vec4(id); }
