// The mean of SSAA x SSAA pixels. Rows first, so that rounding grows with the side and not with the number of pixels.
// With BLOCK 2 the texture unit averages 2 x 2 of them: a look-up at their common corner, whose coordinates are exact in
// textures with sides that are powers of two, and a third quicker than four.
uniform sampler2D source;

out vec4 radiance;

void main() {
    ivec2 corner = SSAA * ivec2(gl_FragCoord.xy);
#if BLOCK == 2
    vec2 texel = 1.0 / vec2(textureSize(source, 0));
#endif
    vec3 sum = vec3(0.0);
    for (int row = 0; row < SSAA; row += BLOCK) {
        vec3 line = vec3(0.0);
        for (int column = 0; column < SSAA; column += BLOCK) {
#if BLOCK == 2
            line += textureLod(source, vec2(corner + ivec2(column + 1, row + 1)) * texel, 0.0).rgb;
#else
            line += texelFetch(source, corner + ivec2(column, row), 0).rgb;
#endif
        }
        sum += line;
    }
    radiance = vec4(sum / float(SSAA * SSAA / (BLOCK * BLOCK)), 1.0);
}
