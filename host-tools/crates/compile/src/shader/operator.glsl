vec4 hook() {
    ivec2 texel = kept_at(HOOKED_pos);
    int row = texel.y * CELLS.x + texel.x;
    vec4 ends = texelFetch(ILTM_ROWS, ivec2(row % LINE, row / LINE), 0);
    vec3 sum = vec3(0.0);
    for (int at = int(ends.x); at < int(ends.y); at++) {
        vec4 entry = texelFetch(ILTM_ENTRIES, ivec2(at % LINE, at / LINE), 0);
        int col = int(entry.x);
        vec3 light = kept(ILTM_INPUTS_raw, ivec2(col % CELLS.x, col / CELLS.x));
        sum += entry.yzw * (2.0 * light - 1.0);
    }
    return keep(0.5 + 0.5 * sum, HOOKED_pos);
}
