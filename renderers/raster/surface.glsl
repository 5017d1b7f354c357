// Where a fragment lies and how its surface answers light; comes before scene.frag.glsl. Coordinates are relative to the
// camera's place at the begin of the frame, in the pass's unit. With hardware samples all this is asked once a pixel, at
// a place of it that the surface covers.
const float UNLIT = 0.0, LIGHT = 1.0, DIFFUSE = 2.0, GLOSSY = 3.0;  // as in surfaces.py
const int TRIANGLES_PER_ROW = 1024;
const float OFF_SURFACE = 2e-6, BEFORE_LIGHT = 1e-4;                // as in lights.py
const float FARTHEST = 1e9;      // in units; beyond lies nothing

flat in int surface_triangle;
#ifdef SAMPLES
centroid in vec4 clip_place;
#endif

uniform sampler2D planes;        // two texels a triangle: normal and offset; kind and largest coordinate
uniform vec3 eye, eye_across, eye_down;
uniform vec3 ray, ray_across, ray_down;
uniform vec2 middle;

struct Place {
    vec3 point, normal;          // turned to the viewer
    vec3 along;                  // where the viewer looks
    float kind, reach;
    bool is_front, is_sure;
};

float largest(vec3 v) {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

void look(out vec3 origin, out vec3 along) {
    vec2 at = gl_FragCoord.xy - middle;
#ifdef SAMPLES
    at += clamp(clip_place.xy / clip_place.w * middle - at, -0.5, 0.5);
#endif
    origin = eye + at.x * eye_across + at.y * eye_down;
    along = ray + at.x * ray_across + at.y * ray_down;
}

Place place_of() {
    ivec2 at = ivec2(2 * (surface_triangle % TRIANGLES_PER_ROW), surface_triangle / TRIANGLES_PER_ROW);
    vec4 plane = texelFetch(planes, at, 0);
    vec4 facts = texelFetch(planes, at + ivec2(1, 0), 0);
    vec3 origin, along;
    look(origin, along);
#ifdef MIRRORED
    bounce(origin, along);
#endif
    float facing = dot(plane.xyz, along);
    float distance = (plane.w - dot(plane.xyz, origin)) / facing;
    Place place;
    place.is_front = facing < 0.0;
    place.is_sure = abs(distance) * largest(along) < FARTHEST;
    place.point = origin + (place.is_sure ? distance : 0.0) * along;
    place.normal = facing > 0.0 ? -plane.xyz : plane.xyz;
    place.along = along;
    place.kind = facts.x;
    place.reach = facts.y;
    return place;
}
