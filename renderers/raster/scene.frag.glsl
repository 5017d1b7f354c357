// Colour times texture. KIND says what the texture is and MODE how an image is filtered; both are set before this text.
// Texture coordinates are those of the mip chain (an analytic texture repeats in them with period 1, a zone plate's are
// uv minus its centre), so that shaders and levels agree.

flat in vec3 surface_color;
in vec2 center_coordinate;       // at the pixel's centre: differs as it should, but may lie outside the surface
centroid in vec4 centroid_place; // inside the surface wherever part of a pixel is covered: coordinate, 1, clip-space w

out vec4 radiance;

// Mesa's software device interpolates centroid inputs over w, but multiplies by the w of the pixel's centre. The same
// factor is in the interpolated 1, so that the quotient is right on every device.
vec2 coordinate;
float coordinate_w;

#if KIND == IMAGE
uniform sampler2D image;
uniform float alpha_cutoff;
uniform float ramp_width;        // pixels
uniform float coverage_excess;   // what the device adds to alpha on average
uniform float lod_bias;

#if MODE == MIPMAP || MODE == ANISOTROPIC
// How a surface's texture coordinate changes to the right and down, in columns. Coordinates over w are affine on screen:
// their differences are exact whichever pixels of its 2 x 2 a driver takes, and the quotient rule does the rest. Plain
// differences of coordinates are off by .2 levels near a horizon, and the same for both pixels.
mat2 footprint() {
    vec2 affine = center_coordinate * gl_FragCoord.w;
    vec2 right = dFdx(affine) - coordinate * dFdx(gl_FragCoord.w);
    vec2 down = dFdy(affine) - coordinate * dFdy(gl_FragCoord.w);
    return coordinate_w * mat2(right, down);
}
#endif

#if MODE == ANISOTROPIC
uniform int anisotropy;

// Trilinear taps along the longer axis of the footprint (GL_EXT_texture_filter_anisotropic's numbers), whose axes are
// those of the ellipse that a pixel's disc becomes: the singular values of the footprint. The extension's example takes
// the longer of the two columns, which is no axis where they are not at right angles: some hundredths more error on
// floors, and up to a third on a sheared one. The bias shrinks the whole footprint: taps keep to a sample's own share of the pixel.
vec4 anisotropic_value(vec2 size) {
    mat2 axes = footprint();
    // along a side of one texel nothing changes
    vec2 texels = exp2(lod_bias) * mix(vec2(0.0), size, greaterThan(size, vec2(1.5)));
    vec2 right = axes[0] * texels;
    vec2 down = axes[1] * texels;
    // squares of squares stay within float32
    vec2 most = max(abs(right), abs(down));
    float unit = clamp(max(most.x, most.y), 1e-15, 1e15);
    right /= unit;
    down /= unit;
    float xx = right.x * right.x + down.x * down.x;
    float yy = right.y * right.y + down.y * down.y;
    float xy = right.x * right.y + down.x * down.y;
    float apart = sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
    float longer = sqrt(0.5 * (xx + yy) + apart);
    float shorter = abs(right.x * down.y - right.y * down.x) / max(longer, 1e-15);
    vec2 along = xx > yy ? vec2(0.5 * (xx - yy) + apart, xy) : vec2(xy, 0.5 * (yy - xx) + apart);
    along = apart > 1e-9 ? normalize(along) : vec2(0.0);
    longer *= unit;
    // below a texel level 0 blurs by itself; and a ratio that is whole but for rounding is whole
    shorter = max(shorter * unit, 1.0);
    float taps = clamp(ceil(longer / shorter - 1e-3), 1.0, float(anisotropy));
    float lod = log2(max(longer / taps, 1e-15));
    vec2 span = along * longer / size;
    vec4 sum = vec4(0.0);
    for (float tap = 0.5; tap < taps; ++tap) {
        sum += textureLod(image, coordinate + (tap / taps - 0.5) * span, lod);
    }
    return sum / taps;
}
#endif

vec4 texture_value() {
    vec2 size = vec2(textureSize(image, 0));
#if MODE == POINT
    vec2 texel = floor(coordinate * size);
    return texelFetch(image, ivec2(texel - size * floor(texel / size)), 0);
#elif MODE == LINEAR
    return textureLod(image, coordinate, 0.0);
#elif MODE == ANISOTROPIC
    return anisotropic_value(size);
#else
    // OpenGL's ideal scale factor, in full precision: a driver's own may be low by several hundredths
    mat2 axes = footprint();
    vec2 right = axes[0] * size;
    vec2 down = axes[1] * size;
    float lod = 0.5 * log2(max(max(dot(right, right), dot(down, down)), 1e-30)) + lod_bias;
    return textureLod(image, coordinate, lod);
#endif
}

#elif KIND != PLAIN
uniform vec3 low;
uniform vec3 high;

#if KIND == CHECKER
float share() {
    vec2 square = floor(2.0 * coordinate);
    float sum = square.x + square.y;
    return sum - 2.0 * floor(0.5 * sum);
}
#elif KIND == SINE
float share() {
    return 0.5 + 0.5 * cos(6.283185307179586 * (coordinate.x - floor(coordinate.x + 0.5)));
}
#elif KIND == SQUARE
float share() {
    return abs(coordinate.x - floor(coordinate.x + 0.5)) < 0.25 ? 1.0 : 0.0;
}
#elif KIND == ZONE_PLATE
uniform float turns_per_unit;    // k / (2 pi)
uniform float phase_turns;
float share() {
    float turns = turns_per_unit * dot(coordinate, coordinate) + phase_turns;
    return 0.5 + 0.5 * cos(6.283185307179586 * (turns - floor(turns + 0.5)));
}
#endif

vec4 texture_value() {
    return vec4(low + share() * (high - low), 1.0);
}
#endif

#ifdef PLACED
// without lights only gloss needs to know where it is
vec3 answer() {
    Place place = place_of();
    if (place.kind == LIGHT) {
        return vec3(place.is_front ? 1.0 : 0.0);
    }
#ifdef GLOSS
    return gloss_at(place.along);
#endif
    if (place.kind == GLOSSY) {
        return vec3(0.0);
    }
#ifdef LIT
    if (place.kind == DIFFUSE) {
        return place.is_sure ? light_at(place) : vec3(0.0);
    }
#endif
    return vec3(1.0);
}
#endif

void main() {
    vec4 color = vec4(surface_color, 1.0);
#if KIND != PLAIN
    coordinate = centroid_place.xy / centroid_place.z;
    coordinate_w = centroid_place.w / centroid_place.z;
    vec4 value = texture_value();
#if KIND == IMAGE
#if COVERAGE == 1
    // Castano's ramp: as wide about the border as a pass's share of the pixel, whatever the texture's own slope is there
    float slope = ramp_width * fwidth(value.a);
    float present = value.a < alpha_cutoff ? 0.0 : 1.0;
    value.a = slope > 1e-6 ? clamp((value.a - alpha_cutoff) / slope + 0.5 - coverage_excess, 0.0, 1.0) : present;
#else
    if (value.a < alpha_cutoff) {
        discard;
    }
    value.a = 1.0;
#endif
#endif
    color *= value;
#endif
#ifdef PLACED
    color.rgb *= answer();
#endif
    radiance = color;
}
