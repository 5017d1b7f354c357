// Any filter: the weighted sum of single samples, (dx, dy, sample, weight) each, counted from the pixel's first sample.
// Taps from `first` to `after` only: drivers may end a shader's loops after 65535 turns, and say nothing. In rows, so
// that rounding grows with their length and not with the number of taps.
#if SAMPLES > 1
uniform sampler2DMS source;
#else
uniform sampler2D source;
#endif
uniform sampler2D taps;
uniform int first;
uniform int after;
uniform int margin;              // drawn pixels that the target is larger than the picture, on each side

out vec4 radiance;

void main() {
    ivec2 at = SSAA * ivec2(gl_FragCoord.xy) + margin;
    vec4 sum = vec4(0.0);
    for (int k = first; k < after;) {
        int end = min(k + 64, after);
        vec4 line = vec4(0.0);
        for (; k < end; ++k) {
            vec4 tap = texelFetch(taps, ivec2(k & 1023, k >> 10), 0);
#if SAMPLES > 1
            line += tap.w * texelFetch(source, at + ivec2(tap.xy), int(tap.z));
#else
            line += tap.w * texelFetch(source, at + ivec2(tap.xy), 0);
#endif
        }
        sum += line;
    }
    radiance = sum;
}
