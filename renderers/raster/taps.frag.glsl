// Any filter: the weighted sum of single samples, (dx, dy, sample, weight) each, counted from the pixel's first sample.
#if SAMPLES > 1
uniform sampler2DMS source;
#else
uniform sampler2D source;
#endif
uniform sampler2D taps;
uniform int count;
uniform int margin;              // drawn pixels that the target is larger than the picture, on each side

out vec4 radiance;

void main() {
    ivec2 at = SSAA * ivec2(gl_FragCoord.xy) + margin;
    vec4 sum = vec4(0.0);
    for (int k = 0; k < count; ++k) {
        vec4 tap = texelFetch(taps, ivec2(k & 1023, k >> 10), 0);
#if SAMPLES > 1
        sum += tap.w * texelFetch(source, at + ivec2(tap.xy), int(tap.z));
#else
        sum += tap.w * texelFetch(source, at + ivec2(tap.xy), 0);
#endif
    }
    radiance = sum;
}
