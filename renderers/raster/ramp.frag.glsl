// White, with every alpha once, in an order in which neighbours differ (`alpha_coverage`).
uniform int side;

out vec4 radiance;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    int number = (at.y * side + at.x) * 1777 % (side * side);
    radiance = vec4(vec3(1.0), (float(number) + 0.5) / float(side * side));
}
