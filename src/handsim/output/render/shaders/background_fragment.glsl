
out vec4 pixel;
void main() { pixel = vec4(background(), 0.0); }
