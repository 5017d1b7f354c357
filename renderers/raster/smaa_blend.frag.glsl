// SMAA, third step (Jimenez et al. 2012, section 3): each pixel takes from the neighbours across its edges what they
// cover of it; across rows or across columns, whichever covers more, and both where they cover alike.
uniform sampler2D source;
uniform sampler2D areas;
uniform float scale;

out vec4 radiance;

vec3 color(ivec2 at) {
    return scale * texelFetch(source, clamp(at, ivec2(0), textureSize(source, 0) - 1), 0).rgb;
}

// What two opposite neighbours change: each by its share, and of both the mean, weighted by the shares.
vec3 change(vec2 share, vec3 own, ivec2 at, ivec2 across) {
    vec3 before = share.x > 0.0 ? share.x * share.x * (color(at - across) - own) : vec3(0.0);
    vec3 after = share.y > 0.0 ? share.y * share.y * (color(at + across) - own) : vec3(0.0);
    return (before + after) / max(share.x + share.y, 1e-6);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(areas, 0);
    vec4 own_areas = texelFetch(areas, at, 0);
    float below = at.y + 1 < size.y ? texelFetch(areas, at + ivec2(0, 1), 0).g : 0.0;
    float right = at.x + 1 < size.x ? texelFetch(areas, at + ivec2(1, 0), 0).a : 0.0;
    vec2 rows = vec2(own_areas.r, below), columns = vec2(own_areas.b, right);
    float most_rows = max(rows.x, rows.y), most_columns = max(columns.x, columns.y);
    vec3 own = color(at);
    radiance = vec4(own, 1.0);
    if (max(most_rows, most_columns) == 0.0) {
        return;
    }
    vec3 changes = vec3(0.0);
    if (most_rows >= most_columns) {
        changes += change(rows, own, at, ivec2(0, 1));
    }
    if (most_columns >= most_rows) {
        changes += change(columns, own, at, ivec2(1, 0));
    }
    radiance.rgb += most_rows == most_columns ? 0.5 * changes : changes;
}
