// Light of an sRGB code, with black as bright as the table makes it. Films have codes beyond
// black and white beside hard edges.
vec3 light_of(vec3 code) {
    code = clamp(code, 0.0, 1.0);
    vec3 low = code / 12.92;
    vec3 high = pow((code + 0.055) / 1.055, vec3(2.4));
    return BLACK + (1.0 - BLACK) * mix(high, low, vec3(lessThanEqual(code, vec3(0.04045))));
}

// The pixels that cells cover: left, top, width, height. As `placement` of the runtime.
vec4 area_of(vec2 frame) {
    vec2 border = floor(BORDER * frame / PROJECTOR + 0.5);
    return vec4(border, frame - 2.0 * border);
}

// Two neighbours on each axis and the share of the later one, for a place in parts of all.
void neighbours(vec2 part, ivec2 size, out ivec2 before, out ivec2 after, out vec2 share) {
    vec2 last = vec2(size) - 1.0;
    vec2 at = clamp(part * vec2(size) - 0.5, vec2(0.0), last);
    before = ivec2(floor(at));
    after = ivec2(min(floor(at) + 1.0, last));
    share = at - floor(at);
}

// Where an element of a list lies.
ivec2 in_list(int index) {
    int line = index / LINE;
    return ivec2(index - LINE * line, line);
}

// Players keep results of passes in 16 bits, half of them in floating point. A value from 0 to 1
// has two texels side by side: its 255ths, and the part of one that is left.
ivec2 kept_at(vec2 place) {
    ivec2 texel = ivec2(place * vec2(2 * CELLS.x, CELLS.y));
    return ivec2(texel.x / 2, texel.y);
}

vec4 keep(vec3 value, vec2 place) {
    vec3 steps = 255.0 * clamp(value, 0.0, 1.0);
    int texel = int(place.x * float(2 * CELLS.x));
    return vec4(2 * (texel / 2) == texel ? floor(steps) / 255.0 : fract(steps), 1.0);
}
