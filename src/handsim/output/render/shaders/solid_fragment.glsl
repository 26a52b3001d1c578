
uniform sampler2D points, normals;
uniform vec3 colour, finger;
uniform float flesh;  // 1 for skin: light comes out beside where it falls in, red most
uniform float id;
uniform vec3 eye;
uniform vec3 to_fill;
uniform vec3 sky_up;
// Of each form: end of those that hide the key light, begin and end of those that hide the sky.
uniform int capsule_key_end, capsule_sky_begin, capsule_count;
uniform vec4 capsules[2 * kMaxOccluders];
#ifdef WITH_SOLIDS
uniform int solid_key_end, solid_sky_begin, solid_count;
uniform vec4 solids[3 * kMaxOccluders];
#endif
uniform vec2 ground;  // height, and distance within which it hides sky; 0: no ground
out vec4 pixel;

const float kSkinLift = 0.006;  // [m]
// What comes out of skin in the shade is redder than what falls in.
const vec3 kUnderSkin = vec3(1.22, 0.95, 0.86);

void main() {
  vec3 world_point = texelFetch(points, ivec2(gl_FragCoord.xy), 0).xyz;
  vec4 surface = texelFetch(normals, ivec2(gl_FragCoord.xy), 0);
  vec3 n = normalize(surface.xyz);
  vec3 v = normalize(eye - world_point);
  float key = 1.0;
  float sky = 1.0;
  float facing = max(dot(n, to_key), 0.0);
  // Shapes reach out of skin where a palm is hollow: what is this near on the way to the light does not count. Along the
  // normal the point would come into the shadow of the next finger.
  vec3 above = world_point + flesh * kSkinLift * to_key;
  // Where a whole block of pixels faces away from the light, llvmpipe leaves out the loop.
  int lit = facing > 0.0 ? 1 : 0;
  for (int i = 0; i < lit * capsule_key_end; ++i)
    key = min(key, key_past_capsule(above, capsules[2 * i], capsules[2 * i + 1].xyz));
  for (int i = capsule_sky_begin; i < capsule_count; ++i)
    sky *= sky_past_capsule(world_point, n, capsules[2 * i], capsules[2 * i + 1].xyz);
#ifdef WITH_SOLIDS
  for (int i = 0; i < lit * solid_key_end; ++i)
    key = min(key, key_past_solid(above, solids[3 * i], solids[3 * i + 1], solids[3 * i + 2]));
  for (int i = solid_sky_begin; i < solid_count; ++i)
    sky *= sky_past_solid(world_point, n, solids[3 * i], solids[3 * i + 1], solids[3 * i + 2]);
#endif
  float open = ground.y > 0.0 ? clamp((world_point.z - ground.x) / ground.y, 0.0, 1.0) : 1.0;
  sky *= mix(0.85 - 0.55 * max(-n.z, 0.0), 1.0, open);
  float up = 0.5 + 0.5 * dot(n, sky_up);
  float fill = 0.20 * max(dot(n, to_fill), 0.0) * (0.4 + 0.6 * sky);
  vec3 reach = flesh * vec3(0.20, 0.09, 0.06);
  vec3 out_again = max((dot(n, to_key) + reach) / (1.0 + reach), 0.0) - facing;
  vec3 light = kKey * (facing * key + out_again * sky) + mix(kBounce, kSky, up) * sky * mix(vec3(1.0), kUnderSkin, flesh) + fill;
  float rim = 1.0 - max(dot(n, v), 0.0);
  rim *= rim;
  float glance = max(dot(n, normalize(to_key + v)), 0.0);
  float shine = 0.13 * pow(glance, 36.0) * key * step(1e-4, facing) + 0.10 * rim * rim * sky * up;
  vec3 own = mix(colour, finger, flesh * smoothstep(0.28, 0.32, surface.w));
  pixel = vec4(to_srgb(own * light + shine), id);
}
