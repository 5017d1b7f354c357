// Places the vertices of every body: a body's matrix takes its float32 vertices, which are relative to its own origin,
// straight to the clip space of this pass. The product of all matrices was made in float64.
const int BODIES_PER_ROW = 1024;

uniform sampler2D matrices;  // four texels a body: the columns of its matrix

in vec3 position;
in vec2 texcoord;
in vec3 color;
in int body;

flat out vec3 surface_color;
out vec2 center_coordinate;
centroid out vec4 centroid_place;
#ifdef PLACED
in int triangle;
flat out int surface_triangle;
#ifdef SAMPLES
centroid out vec4 clip_place;
#endif
#endif

void main() {
    ivec2 at = ivec2(4 * (body % BODIES_PER_ROW), body / BODIES_PER_ROW);
    mat4 clip_from_body = mat4(
        texelFetch(matrices, at, 0),
        texelFetch(matrices, at + ivec2(1, 0), 0),
        texelFetch(matrices, at + ivec2(2, 0), 0),
        texelFetch(matrices, at + ivec2(3, 0), 0));
    gl_Position = clip_from_body * vec4(position, 1.0);
    surface_color = color;
    center_coordinate = texcoord;
    // 1 in a way that no compiler knows, or it would not be interpolated
    centroid_place = vec4(texcoord, body < 0 ? 0.0 : 1.0, gl_Position.w);
#ifdef PLACED
    surface_triangle = triangle;
#ifdef SAMPLES
    clip_place = gl_Position;
#endif
#endif
}
