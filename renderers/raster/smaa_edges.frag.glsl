// SMAA, first step (Jimenez et al. 2012, sections 3 and 4.1): which pixels differ from the one to the left (r) and above
// (g). An edge beside one of more than twice its contrast is none: it would not be seen. What is beside it is looked at
// on both of its sides, so that the same edges are found in a mirrored picture.
uniform sampler2D source;  // lumas

out vec2 edges;

const float LEAST_CONTRAST = 0.05;
const float ADAPTATION = 2.0;

ivec2 last;

float luma(ivec2 at) {
    return texelFetch(source, clamp(at, ivec2(0), last), 0).r;
}

// Whether there is an edge between a pixel and the one at -across.
float edge(ivec2 at, ivec2 across) {
    float own = luma(at), other = luma(at - across);
    float contrast = abs(own - other);
    if (contrast < LEAST_CONTRAST) {
        return 0.0;
    }
    ivec2 along = across.yx;
    float most = max(abs(own - luma(at + across)), abs(other - luma(at - 2 * across)));
    most = max(most, max(abs(own - luma(at - along)), abs(own - luma(at + along))));
    most = max(most, max(abs(other - luma(at - across - along)), abs(other - luma(at - across + along))));
    return ADAPTATION * contrast < most ? 0.0 : 1.0;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    last = textureSize(source, 0) - 1;
    edges = vec2(edge(at, ivec2(1, 0)), edge(at, ivec2(0, 1)));
}
