// How light each pixel looks: its clamped luminance, sRGB encoded. What is brighter than white looks white.
uniform sampler2D source;
uniform float scale;

out float luma;

void main() {
    vec3 color = scale * texelFetch(source, ivec2(gl_FragCoord.xy), 0).rgb;
    float light = clamp(dot(color, vec3(0.2126, 0.7152, 0.0722)), 0.0, 1.0);
    luma = light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1.0 / 2.4) - 0.055;
}
