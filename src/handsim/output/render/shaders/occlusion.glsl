
// No branches: llvmpipe runs both sides of every `if`. No large tables: it loads every component separately.

// Share of the key light that passes a solid at distance s along the ray, with this gap between ray and solid.
float passing(float gap, float s, float thickness) {
  float blur = 0.04 * thickness;
  return smoothstep(-1.0, 1.0, (gap + blur) / (kLightSize * s + blur));
}

// Share of the sky that is visible, from the gaps at one third of the reach and at the full reach.
float open_sky(float near_gap, float far_gap, float reach) {
  float close = clamp(1.0 - near_gap / (0.33 * reach), 0.0, 1.0);
  float wide = clamp(1.0 - far_gap / reach, 0.0, 1.0);
  return 1.0 - 0.44 * close - 0.41 * wide;
}

float segment_gap(vec3 w, vec3 ab, float inverse, float r) {
  return length(w - clamp(dot(w, ab) * inverse, 0.0, 1.0) * ab) - r;
}

// Share of the key light at p that passes a capsule; start (a, r), span b - a.
float key_past_capsule(vec3 p, vec4 start, vec3 span) {
  vec3 w = p - start.xyz;
  float square = max(dot(span, span), 1e-12);
  float across = dot(to_key, span);
  float along = dot(to_key, w);
  // Closest approach of the ray p + s to_key, s >= 0, to the segment.
  float t = clamp((dot(span, w) - across * along) / max(square - across * across, 1e-6 * square), 0.0, 1.0);
  float s = max(t * across - along, 0.0);
  return passing(segment_gap(w + s * to_key, span, 1.0 / square, start.w), s, start.w);
}

// Share of the sky at p with normal n that passes it.
float sky_past_capsule(vec3 p, vec3 n, vec4 start, vec3 span) {
  vec3 w = p - start.xyz;
  float inverse = 1.0 / max(dot(span, span), 1e-12);
  float reach = kSkyReach * start.w;
  return open_sky(segment_gap(w + 0.33 * reach * n, span, inverse, start.w),
                  segment_gap(w + reach * n, span, inverse, start.w), reach);
}

vec3 unrotated(vec4 q, vec3 v) {
  vec3 u = 2.0 * cross(v, q.xyz);
  return v + q.w * u + cross(u, q.xyz);
}

float core_distance(vec3 p, vec3 size, bool cylinder) {
  vec3 q = cylinder ? vec3(length(p.xy) - size.x, abs(p.z) - size.z, -1e9) : abs(p) - size;
  return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0);
}

// The same for a rounded box or cylinder; place (centre, radius), quaternion q_WS, size (half extents, core).
float key_past_solid(vec3 p, vec4 place, vec4 q, vec4 size) {
  float thickness = place.w + min(size.x, min(size.y, size.z));
  vec3 o = unrotated(q, p - place.xyz);
  vec3 d = unrotated(q, to_key);
  // The ray point closest to the edge between the last slab it enters and the first one it leaves.
  d += vec3(1e-5) * (step(0.0, d) * 2.0 - 1.0);
  vec3 m = 1.0 / d;
  vec3 enter = -m * o - abs(m) * size.xyz;
  vec3 leave = -m * o + abs(m) * size.xyz;
  float t_enter = max(enter.x, max(enter.y, enter.z));
  float t_leave = min(leave.x, min(leave.y, leave.z));
  float w_enter = t_enter == enter.x ? d.x : t_enter == enter.y ? d.y : d.z;
  float w_leave = t_leave == leave.x ? d.x : t_leave == leave.y ? d.y : d.z;
  w_enter *= w_enter;
  w_leave *= w_leave;
  float s = max((w_enter * t_enter + w_leave * t_leave) / (w_enter + w_leave), 0.0);
  return passing(core_distance(o + s * d, size.xyz, size.w > 0.5) - place.w, s, thickness);
}

float sky_past_solid(vec3 p, vec3 n, vec4 place, vec4 q, vec4 size) {
  bool cylinder = size.w > 0.5;
  vec3 o = unrotated(q, p - place.xyz);
  vec3 up = unrotated(q, n);
  float reach = kSkyReach * (place.w + min(size.x, min(size.y, size.z)));
  return open_sky(core_distance(o + 0.33 * reach * up, size.xyz, cylinder) - place.w,
                  core_distance(o + reach * up, size.xyz, cylinder) - place.w, reach);
}
