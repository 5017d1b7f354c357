// Places the vertices of every body where they are and where they were one frame before, both as this frame is jittered:
// what did not move then is at the very same place, to the bit.
const int BODIES_PER_ROW = 1024;

uniform sampler2D matrices;  // as in scene.vert.glsl
uniform sampler2D before;    // the same, of the frame before
uniform bool is_piece;       // vertices are in this frame's clip space, nearly: `carried` takes it to that of the one before
uniform mat4 carried;
uniform float piece_surface;

in vec3 position;
in vec2 texcoord;
in int body;

out vec4 place_now;
out vec4 place_before;
out vec2 coordinate;
flat out float surface;      // a number of its own for everything that moves alike, negative if it moves at all

mat4 matrix_of(sampler2D from) {
    ivec2 at = ivec2(4 * (body % BODIES_PER_ROW), body / BODIES_PER_ROW);
    return mat4(
        texelFetch(from, at, 0),
        texelFetch(from, at + ivec2(1, 0), 0),
        texelFetch(from, at + ivec2(2, 0), 0),
        texelFetch(from, at + ivec2(3, 0), 0));
}

void main() {
    mat4 now = matrix_of(matrices);
    place_now = now * vec4(position, 1.0);
    if (is_piece) {
        place_before = carried * place_now;
        surface = piece_surface;
    } else {
        mat4 then = matrix_of(before);
        place_before = then * vec4(position, 1.0);
        // depths may be in other units
        bool moves = false;
        for (int k = 0; k < 4; ++k) {
            moves = moves || now[k].xyw != then[k].xyw;
        }
        surface = moves ? -float(body + 1) : float(body + 1);
    }
    coordinate = texcoord;
    gl_Position = place_now;
}
