uint function_at(int index, int part) {
    return word_of(ILTM_FUNCTIONS_at(in_list(8 * index + part)));
}

uvec2 times(int value, uint light) {
    uvec2 magnitude = product(uint(abs(value)), light);
    return value < 0 ? add(~magnitude, uvec2(1u, 0u)) : magnitude;
}

vec4 hook() {
    ivec3 cell = cell_at(PLACE, CELLS.y);
    int index = cell.y * CELLS.x + cell.x;
    // Each has two halves of rows and of columns, one of which may be empty.
    ivec3 place = ivec3(function_at(index, 0), function_at(index, 1), function_at(index, 2));
    ivec3 rows = place >> 16;
    ivec3 cols = place & 0xffff;
    uvec4 quarters = uvec4(0u);
    for (int row = 0; row < rows.y; row++) {
        for (int col = 0; col < cols.y; col++) {
            ivec2 at = ivec2(CELLS.x * cell.z + cols.x + col, rows.x + row);
            int quarter = (row < rows.z ? 0 : 2) + (col < cols.z ? 0 : 1);
            quarters[quarter] += word_of(ILTM_CELLS_at(at));
        }
    }
    // Shifted right, to nearest, halves upwards.
    uint shift = function_at(index, 3);
    uvec2 sum = shift > 32u ? uvec2(0u, 1u << (shift - 33u)) : uvec2(1u << (shift - 1u), 0u);
    for (int quarter = 0; quarter < 4; quarter++) {
        sum = add(sum, times(int(function_at(index, 4 + quarter)), quarters[quarter]));
    }
    if (shift >= 32u) {
        return texel_of(uint(int(sum.y) >> (shift - 32u)));
    }
    return texel_of(sum.y << (32u - shift) | sum.x >> shift);
}
