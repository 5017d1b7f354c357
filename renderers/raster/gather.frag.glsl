// The mean of the samples that lie in a pixel, each taken from the pixel that the hardware drew it for.
uniform sampler2DMS source;
uniform ivec2 offsets[SAMPLES];  // from a pixel of the picture to the one of the larger target that holds sample k

out vec4 radiance;

void main() {
    vec4 sum = vec4(0.0);
    for (int k = 0; k < SAMPLES; ++k) {
        sum += texelFetch(source, ivec2(gl_FragCoord.xy) + offsets[k], k);
    }
    radiance = sum / float(SAMPLES);
}
