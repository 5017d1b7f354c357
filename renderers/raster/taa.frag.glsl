// Temporal antialiasing (Karis 2014; variance clipping after Salvi 2016): the mean of this frame and of what was seen of
// the same surface before. The history's alpha counts the frames in it, so that the mean is a running one: 1 / (n + 1) of
// the n-th, down to a floor.
// Where nothing near a pixel moves or moved, the history is what it should be and is left alone: a still picture
// converges to the mean of its frames. Elsewhere it is fetched from where the nearest surface nearby was (so that an
// outline takes its antialiasing along), cut to what the neighbourhood now makes likely, and not kept for long. What was
// hidden before, or outside the picture, has no history.
uniform sampler2D source;
uniform sampler2D history;
uniform float scale;
#if STILL                           // the whole scene, or there is no history
uniform bool is_first;
#else
uniform sampler2D motions;          // right, down, depth before
uniform sampler2D surfaces;         // see motion.vert.glsl, 0 where nothing is; depth
uniform sampler2D surfaces_before;
uniform bool by_surface;            // whether what does not move itself is still when other things move
uniform bool larger_is_nearer;      // of depths
#endif

out vec4 radiance;

const float MOST_STILL = 31.0;      // frames that a history counts for: the floor is 1 / 32,
const float MOST_MOVING = 4.0;      // or 1 / 5: fetching between pixels blurs a little every time
const float WIDTH = 1.25;           // of the likely range, in standard deviations each way
const int SEARCHED = 17;            // pixels: samples lie up to a pixel apart in two frames, and outlines are followed one
const float DEPTH_TOLERANCE = 2e-3;
const mat3 TO_YCOCG = mat3(0.25, 0.5, -0.25, 0.5, 0.0, 0.5, 0.25, -0.5, -0.25);
const mat3 TO_RGB = mat3(1.0, 1.0, 1.0, 1.0, 0.0, -1.0, -1.0, 1.0, -1.0);
// nearest first: surfaces that turn move differently one pixel on
const ivec2 AROUND[9] = ivec2[](
    ivec2(0, 0), ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1),
    ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1));

ivec2 last;

ivec2 inside(ivec2 at) {
    return clamp(at, ivec2(0), last);
}

vec3 color(ivec2 at) {
    return scale * texelFetch(source, inside(at), 0).rgb;
}

// The mean with what was seen here before.
vec4 add_still(vec3 now, vec4 before) {
    float count = min(before.a, MOST_STILL);
    return vec4(before.rgb + (now - before.rgb) / (count + 1.0), count + 1.0);
}

#if !STILL
bool nearer(float a, float b) {
    return larger_is_nearer ? a > b : a < b;
}

// Whether everything around a pixel is where it was, now and in the frame before.
bool still_around(ivec2 at) {
    if (!by_surface) {
        return false;
    }
    for (int k = 0; k < 9; ++k) {
        ivec2 here = inside(at + AROUND[k]);
        if (min(texelFetch(surfaces, here, 0).r, texelFetch(surfaces_before, here, 0).r) <= 0.0) {
            return false;
        }
    }
    return true;
}

// Whether a surface was seen around a place in the frame before, at the depth that it had there.
bool seen_before(ivec2 at, float surface, float depth) {
    float least = 3e38, most = -3e38;
    for (int k = 0; k < SEARCHED; ++k) {
        ivec2 here = inside(at + (k < 9 ? AROUND[k] : 2 * AROUND[k - 8]));
        vec2 found = texelFetch(surfaces_before, here, 0).rg;
        if (abs(found.r) == abs(surface)) {
            least = min(least, found.g);
            most = max(most, found.g);
        }
    }
    float off = DEPTH_TOLERANCE * abs(depth);
    return least <= most && (surface == 0.0 || (depth >= least - off && depth <= most + off));
}

vec4 weights(float x) {
    // Catmull and Rom's cubic at the distances 1 + x, x, 1 - x, 2 - x
    return x * (x * (x * vec4(-0.5, 1.5, -1.5, 0.5) + vec4(1.0, -2.5, 2.0, -0.5)) + vec4(-0.5, 0.0, 0.5, 0.0))
        + vec4(0.0, 1.0, 0.0, 0.0);
}

vec3 fetch_history(vec2 place) {
    vec2 corner = floor(place - 0.5);
    vec2 off = place - 0.5 - corner;
    vec4 across = weights(off.x), down = weights(off.y);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 16; ++k) {
        ivec2 tap = ivec2(k & 3, k >> 2);
        sum += across[tap.x] * down[tap.y] * texelFetch(history, inside(ivec2(corner) + tap - 1), 0).rgb;
    }
    return sum;
}

#endif

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    last = textureSize(source, 0) - 1;
    vec3 now = color(at);
#if STILL
    radiance = is_first ? vec4(now, 1.0) : add_still(now, texelFetch(history, at, 0));
#else
    radiance = vec4(now, 1.0);
    if (still_around(at)) {
        radiance = add_still(now, texelFetch(history, at, 0));
        return;
    }
    vec3 mean = vec3(0.0), squares = vec3(0.0);
    float surface = 0.0, depth = 0.0;
    ivec2 followed = at;
    for (int k = 0; k < 9; ++k) {
        ivec2 here = inside(at + AROUND[k]);
        vec3 value = TO_YCOCG * (color(here) - now);
        mean += value / 9.0;
        squares += value * value / 9.0;
        vec2 found = texelFetch(surfaces, here, 0).rg;
        if (found.r != 0.0 && (surface == 0.0 || (found.r != surface && nearer(found.g, depth)))) {
            surface = found.r;
            depth = found.g;
            followed = here;
        }
    }
    // all 0 where nothing is
    vec4 motion = texelFetch(motions, followed, 0);
    vec2 place = vec2(at) + 0.5 + motion.xy;
    if (any(lessThan(place, vec2(0.0))) || any(greaterThan(place, vec2(last + 1)))) {
        return;
    }
    ivec2 pixel = inside(ivec2(floor(place)));
    if (!seen_before(pixel, surface, motion.z)) {
        return;
    }
    vec3 before = motion.xy == vec2(0.0) ? texelFetch(history, at, 0).rgb : fetch_history(place);
    // relative to this frame's value, so that what is as bright as before stays so to the bit
    vec3 off = TO_YCOCG * (before - now) - mean;
    vec3 reach = WIDTH * sqrt(max(squares - mean * mean, 0.0));
    vec3 excess = abs(off) / max(reach, vec3(1e-30));
    float most = max(excess.x, max(excess.y, excess.z));
    vec3 likely = TO_RGB * (mean + (most > 1.0 ? off / most : off));
    float count = min(texelFetch(history, pixel, 0).a, MOST_MOVING);
    radiance = vec4(now + likely * (count / (count + 1.0)), count + 1.0);
#endif
}
