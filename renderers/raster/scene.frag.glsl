// Colour times texture. KIND says what the texture is and MODE how an image is filtered; both are set before this text.
// Texture coordinates are those of the mip chain (an analytic texture repeats in them with period 1, a zone plate's are
// uv minus its centre), so that shaders and levels agree.

flat in vec3 surface_color;
in vec2 center_coordinate;       // at the pixel's centre: has the right derivatives, but may lie outside the surface
centroid in vec2 coordinate;     // inside the surface wherever part of a pixel is covered

out vec4 radiance;

#if KIND == IMAGE
uniform sampler2D image;
uniform float alpha_cutoff;
uniform float lod_bias;

vec4 texture_value() {
    vec2 size = vec2(textureSize(image, 0));
#if MODE == POINT
    vec2 texel = floor(coordinate * size);
    return texelFetch(image, ivec2(texel - size * floor(texel / size)), 0);
#elif MODE == LINEAR
    return textureLod(image, coordinate, 0.0);
#else
    // OpenGL's ideal scale factor, in full precision: a driver's own may be low by several hundredths
    vec2 right = dFdx(center_coordinate) * size;
    vec2 down = dFdy(center_coordinate) * size;
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

void main() {
#if KIND == PLAIN
    radiance = vec4(surface_color, 1.0);
#else
    vec4 value = texture_value();
#if KIND == IMAGE
    if (value.a < alpha_cutoff) {
        discard;
    }
#endif
    radiance = vec4(surface_color * value.rgb, 1.0);
#endif
}
