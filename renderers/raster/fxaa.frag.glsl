// FXAA 3.11, quality preset 39 (Lottes): a pixel on an edge takes from the pixel across it, the more the nearer the end
// of the edge is. Walks along an edge look at the mean of the two pixels across it, further on at those of four.
// Sums are written so that turning or mirroring the picture only swaps their terms, and where two directions are equally
// good both are taken: the result then turns with the picture, and of a line one pixel wide neither side is preferred.
uniform sampler2D source;
uniform sampler2D lumas;
uniform float scale;

out vec4 radiance;

const float CONTRAST = 0.063;        // of the lightest pixel nearby, that makes an edge
const float LEAST_CONTRAST = 0.0312;
const float SUBPIXEL = 0.75;         // how much of what is smaller than a pixel is taken off
const int STOPS = 11;
const float STOP[STOPS] = float[](1.0, 2.0, 3.0, 4.0, 5.0, 6.5, 8.5, 10.5, 12.5, 14.5, 18.5);
const float BEYOND = 26.5;           // where an edge ends that is longer

ivec2 last;

float luma(ivec2 at) {
    return texelFetch(lumas, clamp(at, ivec2(0), last), 0).r;
}

vec3 color(ivec2 at) {
    return scale * texelFetch(source, clamp(at, ivec2(0), last), 0).rgb;
}

// How far away the edge between a pixel and its neighbour ends in one direction, and by how much it differs there.
vec2 edge_end(ivec2 at, ivec2 across, ivec2 along, float mean, float least) {
    float off = 0.0;
    for (int k = 0; k < STOPS; ++k) {
        int whole = int(STOP[k]);
        ivec2 here = at + whole * along;
        float found = 0.5 * (luma(here) + luma(here + across));
        if (float(whole) < STOP[k]) {
            found = 0.5 * (found + 0.5 * (luma(here + along) + luma(here + along + across)));
        }
        off = found - mean;
        if (abs(off) >= least) {
            return vec2(STOP[k], off);
        }
    }
    return vec2(BEYOND, off);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    last = textureSize(lumas, 0) - 1;
    vec3 own = color(at);
    float m = luma(at);
    float n = luma(at - ivec2(0, 1)), s = luma(at + ivec2(0, 1));
    float w = luma(at - ivec2(1, 0)), e = luma(at + ivec2(1, 0));
    float lightest = max(m, max(max(n, s), max(w, e)));
    float range = lightest - min(m, min(min(n, s), min(w, e)));
    radiance = vec4(own, 1.0);
    if (range < max(LEAST_CONTRAST, CONTRAST * lightest)) {
        return;
    }
    float nw = luma(at + ivec2(-1, -1)), ne = luma(at + ivec2(1, -1));
    float sw = luma(at + ivec2(-1, 1)), se = luma(at + ivec2(1, 1));

    float around = (2.0 * ((n + s) + (w + e)) + ((nw + se) + (ne + sw))) / 12.0;
    float single = smoothstep(0.0, 1.0, clamp(abs(around - m) / range, 0.0, 1.0));
    float least = SUBPIXEL * single * single;

    float rows = (abs(nw + sw - 2.0 * w) + abs(ne + se - 2.0 * e)) + 2.0 * abs(n + s - 2.0 * m);
    float columns = (abs(nw + ne - 2.0 * n) + abs(sw + se - 2.0 * s)) + 2.0 * abs(w + e - 2.0 * m);
    vec3 change = vec3(0.0);
    float directions = 0.0;
    for (int axis = 0; axis < 2; ++axis) {
        if (axis == 0 ? rows < columns : columns < rows) {
            continue;
        }
        directions += 1.0;
        ivec2 along = axis == 0 ? ivec2(1, 0) : ivec2(0, 1);
        vec2 beside = axis == 0 ? vec2(n, s) : vec2(w, e);
        vec2 steps = abs(beside - m);
        float share = steps.x == steps.y ? 0.5 : 1.0;
        vec3 taken = vec3(0.0);
        for (int side = 0; side < 2; ++side) {
            if (steps[side] < steps[1 - side]) {
                continue;
            }
            ivec2 across = (2 * side - 1) * along.yx;
            float mean = 0.5 * (m + beside[side]);
            vec2 back = edge_end(at, across, -along, mean, 0.25 * steps[side]);
            vec2 forth = edge_end(at, across, along, mean, 0.25 * steps[side]);
            vec2 near = back.x < forth.x ? back : forth;
            // the pixel is on the side of the edge that the end turns to
            bool turned = (near.y < 0.0) != (m < mean);
            float moved = max(turned ? 0.5 - near.x / (back.x + forth.x) : 0.0, least);
            taken += share * moved * (color(at + across) - own);
        }
        change += taken;
    }
    radiance = vec4(own + change / directions, 1.0);
}
