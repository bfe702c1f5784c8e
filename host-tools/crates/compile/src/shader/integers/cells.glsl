// A sum of light times overlaps over the area of a cell in the same units, to nearest: below 2^16.
uint mean_of(uvec2 sum) {
    uint area = uint(AREA.z) * uint(AREA.w);
    uvec2 rest = add(sum, uvec2(area / 2u, 0u));
    uint mean = 0u;
    for (uint bit = 16u; bit-- > 0u;) {
        uvec2 part = uvec2(area << bit, bit == 0u ? 0u : area >> (32u - bit));
        if (rest.y > part.y || rest.y == part.y && rest.x >= part.x) {
            rest = uvec2(rest.x - part.x, rest.y - part.y - (rest.x < part.x ? 1u : 0u));
            mean |= 1u << bit;
        }
    }
    return mean;
}

vec4 hook() {
    ivec3 cell = cell_at(PLACE, CELLS.y);
    int from = cell.y * AREA.w;
    int to = from + AREA.w;
    uvec2 sum = uvec2(0u);
    for (int y = from / CELLS.y; y * CELLS.y < to; y++) {
        int overlap = min((y + 1) * CELLS.y, to) - max(y * CELLS.y, from);
        uint along = word_of(ILTM_ALONG_at(ivec2(CELLS.x * cell.z + cell.x, y)));
        sum = add(sum, product(along, uint(overlap)));
    }
    return texel_of(mean_of(sum));
}
