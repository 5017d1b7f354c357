// The depth of what a point on a light sees; MODE is POINT, LINEAR or MIPMAP where it has holes.
in float depth;
in vec2 coordinate;
out vec4 nearest;

#ifdef HOLES
uniform sampler2D image;
uniform float alpha_cutoff;
#endif

void main() {
#ifdef HOLES
#if MODE == POINT
    vec2 size = vec2(textureSize(image, 0));
    vec2 texel = floor(coordinate * size);
    float alpha = texelFetch(image, ivec2(texel - size * floor(texel / size)), 0).a;
#else
    float alpha = textureLod(image, coordinate, 0.0).a;
#endif
    if (alpha < alpha_cutoff) {
        discard;
    }
#endif
    nearest = vec4(depth);
}
