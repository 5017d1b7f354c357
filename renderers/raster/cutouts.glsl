// Whether cut-out triangles of one texture hide a point from a light (see light.glsl): a function for each texture, as
// GLSL cannot choose among samplers. The three last components of a triangle's texels are u at its corners, the fourth
// texel is v; a hole is where the texture's alpha, at full resolution, is below its cutoff.
uniform sampler2D IMAGE_NAME;

bool FUNCTION_NAME(int row, vec3 back, float most) {
    for (int at = FIRST_TEXEL; at < END_TEXEL; at += 4) {
        vec4 a = texelFetch(lights, ivec2(at, row), 0);
        vec4 b = texelFetch(lights, ivec2(at + 1, row), 0);
        vec4 c = texelFetch(lights, ivec2(at + 2, row), 0);
        vec3 share = vec3(dot(a.xyz, back), dot(b.xyz, back), dot(c.xyz, back));
        float sum = share.x + share.y + share.z;
        if (min(min(share.x, share.y), share.z) >= 0.0 && sum > 1.0 && sum < most) {
            vec3 v = texelFetch(lights, ivec2(at + 3, row), 0).xyz;
            vec2 uv = vec2(dot(vec3(a.w, b.w, c.w), share), dot(v, share)) / sum;
#if TEXEL_MODE == POINT
            vec2 size = vec2(textureSize(IMAGE_NAME, 0));
            vec2 texel = floor(uv * size);
            float alpha = texelFetch(IMAGE_NAME, ivec2(texel - size * floor(texel / size)), 0).a;
#else
            float alpha = textureLod(IMAGE_NAME, uv, 0.0).a;
#endif
            if (alpha >= CUTOFF) {
                return true;
            }
        }
    }
    return false;
}
