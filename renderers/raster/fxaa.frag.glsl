// FXAA 3.11, quality preset 39 (Lottes): a pixel on an edge takes from the pixel across it, the more the nearer the end
// of the edge is. Walks along an edge look at the mean of the two pixels across it, further on at those of four.
// Sums are written so that turning or mirroring the picture only swaps their terms, and where two directions are equally
// good both are taken: the result then turns with the picture, and of a line one pixel wide neither side is preferred.
// Software devices run all that is in a branch, but leave a loop that nobody is in: what few pixels need is in loops, and
// their ends are uniforms so that compilers do not unroll them.
uniform sampler2D source;
uniform sampler2D lumas;
uniform float scale;
uniform int stops;                   // STOPS

out vec4 radiance;

const float CONTRAST = 0.063;        // of the lightest pixel nearby, that makes an edge
const float LEAST_CONTRAST = 0.0312;
const float SUBPIXEL = 0.75;         // how much of what is smaller than a pixel is taken off
// where walks look: 1, 2, 3, 4, 5, 6.5, 8.5, 10.5, 12.5, 14.5, 18.5 pixels away
float stop(int k) {
    return k < 5 ? float(k + 1) : k < 10 ? 2.0 * float(k) - 3.5 : 18.5;
}
const float BEYOND = 26.5;           // where an edge ends that is longer

ivec2 last;

float luma(ivec2 at) {
    return texelFetch(lumas, clamp(at, ivec2(0), last), 0).r;
}

vec3 color(ivec2 at) {
    return scale * texelFetch(source, clamp(at, ivec2(0), last), 0).rgb;
}

// By how much the edge between a pixel and its neighbour differs from `mean` at a distance in one direction.
float off_at(ivec2 at, ivec2 across, ivec2 along, float distance, float mean) {
    int whole = int(distance);
    ivec2 here = at + whole * along;
    // the next pixel too, where the distance is between two
    ivec2 next = float(whole) < distance ? here + along : here;
    float found = 0.5 * (luma(here) + luma(here + across)), further = 0.5 * (luma(next) + luma(next + across));
    return 0.5 * (found + further) - mean;
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
    bool is_edge = range >= max(LEAST_CONTRAST, CONTRAST * lightest);
    float nw = luma(at + ivec2(-1, -1)), ne = luma(at + ivec2(1, -1));
    float sw = luma(at + ivec2(-1, 1)), se = luma(at + ivec2(1, 1));

    float around = (2.0 * ((n + s) + (w + e)) + ((nw + se) + (ne + sw))) / 12.0;
    float single = smoothstep(0.0, 1.0, clamp(abs(around - m) / max(range, LEAST_CONTRAST), 0.0, 1.0));
    float least = SUBPIXEL * single * single;

    float rows = (abs(nw + sw - 2.0 * w) + abs(ne + se - 2.0 * e)) + 2.0 * abs(n + s - 2.0 * m);
    float columns = (abs(nw + ne - 2.0 * n) + abs(sw + se - 2.0 * s)) + 2.0 * abs(w + e - 2.0 * m);
    // directions to take from, up to four: above, below, left, right
    vec4 steps = abs(vec4(n, s, w, e) - m);
    bvec2 nearest_rows = bvec2(steps.x >= steps.y, steps.y >= steps.x);
    bvec2 nearest_columns = bvec2(steps.z >= steps.w, steps.w >= steps.z);
    bvec4 taken = bvec4(
        rows >= columns && nearest_rows.x, rows >= columns && nearest_rows.y,
        columns >= rows && nearest_columns.x, columns >= rows && nearest_columns.y);
    float axes = rows == columns ? 0.5 : 1.0;
    float share_rows = axes * (steps.x == steps.y ? 0.5 : 1.0), share_columns = axes * (steps.z == steps.w ? 0.5 : 1.0);
    vec3 change_rows = vec3(0.0), change_columns = vec3(0.0);
    int number = is_edge ? 0 : 4;
    while (number < 4 && stops > 0) {
        int k = number;
        ++number;
        if (!(k == 0 ? taken.x : k == 1 ? taken.y : k == 2 ? taken.z : taken.w)) {
            continue;
        }
        bool is_row = k < 2;
        ivec2 along = is_row ? ivec2(1, 0) : ivec2(0, 1);
        ivec2 across = (k & 1) == 0 ? -along.yx : along.yx;
        float step_here = k == 0 ? steps.x : k == 1 ? steps.y : k == 2 ? steps.z : steps.w;
        float beside = k == 0 ? n : k == 1 ? s : k == 2 ? w : e;
        float mean = 0.5 * (m + beside), enough = 0.25 * step_here;
        vec2 end = vec2(BEYOND), off = vec2(0.0);  // back and forth
        bvec2 found = bvec2(false);
        for (int stop_number = 0; stop_number < stops; ++stop_number) {
            float distance = stop(stop_number);
            vec2 here = vec2(off_at(at, across, -along, distance, mean), off_at(at, across, along, distance, mean));
            if (!found.x) {
                off.x = here.x;
                found.x = abs(here.x) >= enough;
                end.x = found.x ? distance : BEYOND;
            }
            if (!found.y) {
                off.y = here.y;
                found.y = abs(here.y) >= enough;
                end.y = found.y ? distance : BEYOND;
            }
            if (found.x && found.y) {
                break;
            }
        }
        vec2 near = end.x < end.y ? vec2(end.x, off.x) : vec2(end.y, off.y);
        // the pixel is on the side of the edge that the end turns to
        bool turned = (near.y < 0.0) != (m < mean);
        float moved = max(turned ? 0.5 - near.x / (end.x + end.y) : 0.0, least);
        vec3 change = moved * (color(at + across) - own);
        change_rows += is_row ? share_rows * change : vec3(0.0);
        change_columns += is_row ? vec3(0.0) : share_columns * change;
    }
    radiance = vec4(own + (change_rows + change_columns), 1.0);
}
