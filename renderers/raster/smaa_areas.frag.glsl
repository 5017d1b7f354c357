// SMAA, second step (Jimenez et al. 2012, section 3; orthogonal patterns and sharp corners, 4.2): the shape that an edge
// is a stair of, and what it covers of the pixels on both sides. For the edge above a pixel: the share of the pixel that
// belongs to the other side (r) and of the pixel above that belongs to this side (g); the same for the edge to its left.
//
// The edge runs from where it starts to where it ends, `size` pixels; where it turns at an end, the true outline passes
// the middle of the turn, half a pixel off, and it crosses the stair in the middle:
//     height(x) = start (1 - 2 x / size) up to size / 2, end (2 x / size - 1) from there; start, end in {-.5, 0, .5}.
// With opposite turns that is one straight line, with equal ones a roof, with one turn half of that. Where it turns to
// both sides at once, a line crosses, and it is taken to go the way that makes a straight line with the other end.
uniform sampler2D source;  // edges

out vec4 areas;

const int FARTHEST = 64;         // how far ends are looked for; an edge that goes on has no turn there
const float CORNER = 0.25;       // what is kept of the area at a corner: a turn of two pixels or more

ivec2 last;

float edge(ivec2 at, int channel) {
    return any(greaterThan(at, last)) || any(lessThan(at, ivec2(0))) ? 0.0 : texelFetch(source, at, 0)[channel];
}

// The end of the edge in direction `along` or against it: how many more pixels it has, and the turns at its end to the
// other side and to this one (0 none, 1 a turn, CORNER a corner).
vec3 find_end(ivec2 at, ivec2 along, int towards, ivec2 across, int channel) {
    int k = 0;
    vec2 turns = vec2(0.0);
    ivec2 border = towards > 0 ? at + along : at;
    while (k < FARTHEST) {
        turns = vec2(edge(border - across, 1 - channel), edge(border, 1 - channel));
        at += towards * along;
        if (turns.x + turns.y > 0.0 || edge(at, channel) == 0.0) {
            break;
        }
        border += towards * along;
        ++k;
    }
    if (k == FARTHEST) {
        return vec3(k, 0.0, 0.0);
    }
    turns.x *= edge(border - 2 * across, 1 - channel) > 0.0 ? CORNER : 1.0;
    turns.y *= edge(border + across, 1 - channel) > 0.0 ? CORNER : 1.0;
    return vec3(k, turns);
}

// The integral of 1 - 2 x / size over the pixel at `distance` from the end, as far as it is positive.
float triangle(float distance, float size) {
    vec2 x = min(vec2(distance, distance + 1.0), 0.5 * size);
    vec2 integral = x - x * x / size;
    return integral.y - integral.x;
}

// The height at an end, as the turns there and at the other end say.
float height(vec2 turns, vec2 others) {
    if (turns.x > 0.0 && turns.y > 0.0) {
        return others.x > 0.0 && others.y > 0.0 ? 0.0 : 0.5 * (sign(others.y) * turns.x - sign(others.x) * turns.y);
    }
    return 0.5 * (turns.x - turns.y);
}

vec2 area(ivec2 at, ivec2 along, ivec2 across, int channel) {
    if (edge(at, channel) == 0.0) {
        return vec2(0.0);
    }
    vec3 back = find_end(at, along, -1, across, channel);
    vec3 forth = find_end(at, along, 1, across, channel);
    float size = back.x + forth.x + 1.0;
    vec2 found = vec2(
        height(back.yz, forth.yz) * triangle(back.x, size), height(forth.yz, back.yz) * triangle(forth.x, size));
    vec2 below = max(-found, 0.0), above = max(found, 0.0);
    return vec2(below.x + below.y, above.x + above.y);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    last = textureSize(source, 0) - 1;
    areas = vec4(area(at, ivec2(1, 0), ivec2(0, 1), 1), area(at, ivec2(0, 1), ivec2(1, 0), 0));
}
