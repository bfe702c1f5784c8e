// Light of an sRGB code. Films have codes beyond black and white beside hard edges.
vec3 light_of(vec3 code) {
    code = clamp(code, 0.0, 1.0);
    vec3 low = code / 12.92;
    vec3 high = pow((code + 0.055) / 1.055, vec3(2.4));
    return mix(high, low, vec3(lessThanEqual(code, vec3(0.04045))));
}

// The pixels that cells cover: left, top, width, height. As `placement` of the runtime.
vec4 area_of(vec2 frame) {
    vec2 border = floor(BORDER * frame / PROJECTOR + 0.5);
    return vec4(border, frame - 2.0 * border);
}

// Two neighbours on each axis and the share of the later one, for a place in parts of all.
void neighbours(vec2 part, ivec2 size, out ivec2 before, out ivec2 after, out vec2 share) {
    vec2 at = clamp(part * vec2(size) - 0.5, vec2(0.0), vec2(size - 1));
    before = ivec2(floor(at));
    after = min(before + 1, size - 1);
    share = at - vec2(before);
}

// Players keep results of passes in 16 bits, half of them in floating point. A value from 0 to 1
// has two texels side by side: its 255ths, and the part of one that is left.
ivec2 kept_at(vec2 part) {
    ivec2 texel = ivec2(part * vec2(2 * CELLS.x, CELLS.y));
    return ivec2(texel.x / 2, texel.y);
}

vec4 keep(vec3 value, vec2 part) {
    vec3 steps = 255.0 * clamp(value, 0.0, 1.0);
    bool left = int(part.x * float(2 * CELLS.x)) % 2 == 0;
    return vec4(left ? floor(steps) / 255.0 : fract(steps), 1.0);
}

vec3 kept(sampler2D values, ivec2 at) {
    vec3 whole = round(255.0 * texelFetch(values, ivec2(2 * at.x, at.y), 0).rgb);
    return (whole + texelFetch(values, ivec2(2 * at.x + 1, at.y), 0).rgb) / 255.0;
}

vec3 kept_between(sampler2D values, vec2 part) {
    ivec2 a, b;
    vec2 t;
    neighbours(part, CELLS, a, b, t);
    vec3 top = mix(kept(values, a), kept(values, ivec2(b.x, a.y)), t.x);
    vec3 low = mix(kept(values, ivec2(a.x, b.y)), kept(values, b), t.x);
    return mix(top, low, t.y);
}

vec3 between(sampler2D values, ivec2 size, vec2 part) {
    ivec2 a, b;
    vec2 t;
    neighbours(part, size, a, b, t);
    vec3 top = mix(texelFetch(values, a, 0).rgb, texelFetch(values, ivec2(b.x, a.y), 0).rgb, t.x);
    vec3 low = mix(texelFetch(values, ivec2(a.x, b.y), 0).rgb, texelFetch(values, b, 0).rgb, t.x);
    return mix(top, low, t.y);
}
