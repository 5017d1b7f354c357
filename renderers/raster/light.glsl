// Light that arrives at a diffuse surface from the pass's points on the lights; comes after surface.glsl. Of every point
// there is a row: its place and how many groups of occluders it has; what it brings; the normal of its light; the groups'
// cones; their triangles, three texels each; and cut-out triangles, four each.
//
// A triangle a, b, c hides a point P from the light's point L where P lies beyond it in the pyramid over it, whose tip
// is L: P - L = x (a - L) + y (b - L) + z (c - L) with x, y, z >= 0, and x + y + z > 1. The texels have what takes
// P - L to x, y and z, made in float64. 1 / (x + y + z) is where on the way from L it is.
uniform sampler2D lights;
uniform int light_points;

#if SHADOWS == EXACT
bool is_hidden(int row, int groups, vec3 back, float most, vec3 normal) {
    float far = length(back);
    for (int g = 0; g < groups; g++) {
        vec4 cone = texelFetch(lights, ivec2(FIRST_GROUP + g, row), 0);
        int at = FIRST_TRIANGLE + 3 * GROUP * g;
        int end = dot(cone.xyz, back) >= cone.w * far ? at + 3 * GROUP : at;
        for (; at < end; at += 3) {
            float x = dot(texelFetch(lights, ivec2(at, row), 0).xyz, back);
            float y = dot(texelFetch(lights, ivec2(at + 1, row), 0).xyz, back);
            float z = dot(texelFetch(lights, ivec2(at + 2, row), 0).xyz, back);
            float sum = x + y + z;
            if (min(min(x, y), z) >= 0.0 && sum > 1.0 && sum < most) {
                return true;
            }
        }
    }
    return is_behind_cutouts(row, back, most);
}
#else
uniform sampler2D shadow_map;
const float STEEPEST = 64.0;     // a surface seen more edge-on than that is hardly lit

bool is_hidden(int row, int faces, vec3 back, float most, vec3 normal) {
    for (int f = 0; f < faces; f++) {
        int at = FIRST_GROUP + FACE_TEXELS * f;
        vec4 x = texelFetch(lights, ivec2(at, row), 0), y = texelFetch(lights, ivec2(at + 1, row), 0);
        vec4 z = texelFetch(lights, ivec2(at + 2, row), 0), cell = texelFetch(lights, ivec2(at + 3, row), 0);
        float depth = dot(z.xyz, back);
        vec2 width = vec2(1.0 / z.w, 1.0 / cell.z);
        vec2 place = (vec2(dot(x.xyz, back), dot(y.xyz, back)) / depth - vec2(x.w, y.w)) / width;
        if (depth > 0.0 && all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, vec2(1.0)))) {
            float stored = texelFetch(shadow_map, ivec2(cell.xy + floor(place * cell.w)), 0).x;
            // a plane n . X = k has depth k / (n . d) along d = z + s x + t y, which changes with s by
            // -depth (n . x) / (n . d); a texel's middle is at most half of it away
            vec2 texel = width / cell.w;
            float towards = max(abs(dot(normal, back)) / depth, 1e-6);
            float slope = dot(abs(vec2(dot(normal, x.xyz), dot(normal, y.xyz))), texel) / towards;
            float bias = 0.5 * (min(slope, STEEPEST * max(texel.x, texel.y)) + max(texel.x, texel.y));
            return stored < depth * (1.0 - bias);
        }
    }
    return false;
}
#endif

vec3 light_at(Place place) {
    float off = OFF_SURFACE * max(place.reach, largest(place.point));
    vec3 sum = vec3(0.0);
    for (int row = 0; row < light_points; row++) {
        vec4 point = texelFetch(lights, ivec2(0, row), 0);
        vec3 way = point.xyz - place.point;
        float square = dot(way, way);
        float here = dot(way, place.normal);
        float there = -dot(way, texelFetch(lights, ivec2(2, row), 0).xyz);
        if (here > 0.0 && there > 0.0) {
            // far from where coordinates start, the light's own surface may lie before it by rounding
            float unsure = (off + OFF_SURFACE * largest(point.xyz)) * inversesqrt(square);
            vec3 back = place.point + off * place.normal - point.xyz;
            if (!is_hidden(row, int(point.w), back, 1.0 / max(BEFORE_LIGHT, unsure), place.normal)) {
                sum += texelFetch(lights, ivec2(1, row), 0).xyz * ((here / square) * (there / square));
            }
        }
    }
    return sum;
}
