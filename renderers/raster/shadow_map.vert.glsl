// Places occluders as a point on a light sees them; depth is reversed: near / depth.
uniform vec3 point;
uniform vec3 axis_x, axis_y, axis_z;
uniform vec4 bounds;             // left, bottom, and 1 / width, 1 / height of the picture at depth 1
uniform float near;

in vec3 position;
in vec2 texcoord;

out float depth;
out vec2 coordinate;

void main() {
    vec3 way = position - point;
    depth = dot(axis_z, way);
    vec2 place = vec2(dot(axis_x, way), dot(axis_y, way)) - bounds.xy * depth;
    gl_Position = vec4(2.0 * bounds.zw * place - depth, near, depth);
    coordinate = texcoord;
}
