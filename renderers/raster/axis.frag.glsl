// One axis of a separable filter: the weighted sum of TAPS drawn pixels for each pixel of the picture. Across, pixels are
// as many as the picture's columns and rows as drawn; down, rows too become the picture's.
uniform sampler2D source;
uniform sampler2D weights;

out vec4 radiance;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    at[AXIS] *= SSAA;
    vec4 sum = vec4(0.0);
    for (int tap = 0; tap < TAPS; ++tap) {
        sum += texelFetch(weights, ivec2(tap, 0), 0).r * texelFetch(source, at, 0);
        ++at[AXIS];
    }
    radiance = sum;
}
