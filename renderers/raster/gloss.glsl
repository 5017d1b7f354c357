// Gloss; comes after surface.glsl, before which GLOSS (a glossy polygon is drawn) or MIRRORED (what it mirrors) is set.
uniform vec4 mirror_plane;
uniform vec3 mirror_half;

#ifdef MIRRORED
void bounce(inout vec3 origin, inout vec3 along) {
    float way = (mirror_plane.w - dot(mirror_plane.xyz, origin)) / dot(mirror_plane.xyz, along);
    origin += way * along;
    along -= 2.0 * dot(along, mirror_half) * mirror_half;
}
#endif

#ifdef GLOSS
uniform sampler2D mirror;
uniform float roughness;

float slant(float cosine) {
    float square = roughness * roughness;
    return sqrt(square + (1.0 - square) * cosine * cosine);
}

// Facets are drawn with density D cos_h; BRDF times cos_o over the density of o is G2 (i.h) / (cos_i cos_h).
vec3 gloss_at(vec3 along) {
    vec3 i = -normalize(along);
    float cos_i = dot(i, mirror_plane.xyz), cos_h = dot(mirror_half, mirror_plane.xyz), turned = dot(i, mirror_half);
    float cos_o = dot(2.0 * turned * mirror_half - i, mirror_plane.xyz);
    if (!(cos_i > 0.0 && turned > 0.0 && cos_o > 0.0)) {
        return vec3(0.0);
    }
    float weight = 2.0 * cos_o * turned / ((slant(cos_i) * cos_o + slant(cos_o) * cos_i) * cos_h);
    return weight * texelFetch(mirror, ivec2(gl_FragCoord.xy), 0).rgb;
}
#endif
