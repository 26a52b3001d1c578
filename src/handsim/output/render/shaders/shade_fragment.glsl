
#ifdef WITH_SOLIDS
uniform vec4 solids[3];
#else
uniform vec4 capsules[2];
#endif
in vec3 point;
out vec4 shade;
void main() {
  vec3 n = vec3(0.0, 0.0, 1.0);
#ifdef WITH_SOLIDS
  float key = key_past_solid(point, solids[0], solids[1], solids[2]);
  float sky = sky_past_solid(point, n, solids[0], solids[1], solids[2]);
#else
  float key = key_past_capsule(point, capsules[0], capsules[1].xyz);
  float sky = sky_past_capsule(point, n, capsules[0], capsules[1].xyz);
#endif
  shade = vec4(key, key, key, sky);
}
