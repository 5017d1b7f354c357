// The mean of SSAA x SSAA pixels. Rows first, so that rounding grows with the side and not with the number of pixels.
uniform sampler2D source;

out vec4 radiance;

void main() {
    ivec2 corner = SSAA * ivec2(gl_FragCoord.xy);
    vec4 sum = vec4(0.0);
    for (int row = 0; row < SSAA; ++row) {
        vec4 line = vec4(0.0);
        for (int column = 0; column < SSAA; ++column) {
            line += texelFetch(source, corner + ivec2(column, row), 0);
        }
        sum += line;
    }
    radiance = sum / float(SSAA * SSAA);
}
