// Where what is seen in a pixel was one frame before: how many pixels to the right and down, and its depth there.
uniform vec2 half_size;

in vec4 place_now;
in vec4 place_before;
in vec2 coordinate;
flat in float surface;

layout(location = 0) out vec4 motion;       // right, down, depth before
layout(location = 1) out vec2 seen;         // surface, depth

const float NOWHERE = 1e9;                  // behind the camera

#if KIND == IMAGE
uniform sampler2D image;
uniform float alpha_cutoff;
#endif

void main() {
#if KIND == IMAGE
    vec2 size = vec2(textureSize(image, 0));
    vec2 texel = floor(coordinate * size);
    if (texelFetch(image, ivec2(texel - size * floor(texel / size)), 0).a < alpha_cutoff) {
        discard;
    }
#endif
    vec2 moved = vec2(NOWHERE);
    float depth = 0.0;
    if (place_before.w > 0.0) {
        moved = half_size * (place_before.xy / place_before.w - place_now.xy / place_now.w);
        depth = place_before.z / place_before.w;
    }
    motion = vec4(moved, depth, 1.0);
    seen = vec2(surface, gl_FragCoord.z);
}
