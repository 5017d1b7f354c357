// Places vertices where a glossy plane shows them, were all its facets turned like this pass's: see gloss.py.
uniform mat4 clip_from_pass;
uniform vec4 mirror_plane;       // unit normal on the viewer's side, and offset
uniform vec3 mirror_half;        // the facets' normal
uniform vec3 eye;
uniform vec3 parallel_shift;     // of a point at height 1 over the plane, under parallel rays
uniform float eye_height;        // over the plane; 0 under parallel rays

in vec3 position;                // in the pass's coordinates, not below the plane
in vec2 texcoord;
in vec3 color;
in float nearer;
in int triangle;

flat out vec3 surface_color;
out vec2 center_coordinate;
centroid out vec4 centroid_place;
flat out int surface_triangle;

void main() {
    float height = max(dot(mirror_plane.xyz, position) - mirror_plane.w, 0.0);
    vec3 shift;
    if (eye_height > 0.0) {
        float slope = dot(mirror_plane.xyz, mirror_half);
        float c = eye_height - height - 2.0 * slope * dot(mirror_half, eye - position);
        float root = sqrt(c * c + 4.0 * eye_height * height);
        // of two expressions for one root that which does not cancel
        float along = c > 0.0 ? 0.5 * (c + root) : 2.0 * eye_height * height / max(root - c, 1e-30);
        shift = -(height + along) / slope * mirror_half;
    } else {
        shift = height * parallel_shift;
    }
    gl_Position = clip_from_pass * vec4(position + shift, 1.0);
    gl_Position.z *= nearer;
    surface_color = color;
    center_coordinate = texcoord;
    centroid_place = vec4(texcoord, triangle < 0 ? 0.0 : 1.0, gl_Position.w);  // as in scene.vert.glsl
    surface_triangle = triangle;
}
