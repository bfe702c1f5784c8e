vec4 hook() {
    ivec2 texel = kept_at(HOOKED_pos);
    int cell = texel.y * CELLS.x + texel.x;
    vec3 sum = vec3(0.0);
    for (int at = MOST * cell; at < MOST * (cell + 1); at++) {
        vec4 entry = texelFetch(ILTM_COVERING, ivec2(at % LINE, at / LINE), 0);
        int row = int(entry.x);
        vec3 part = kept(ILTM_OUTPUTS_raw, ivec2(row % CELLS.x, row / CELLS.x));
        sum += entry.y * (2.0 * part - 1.0);
    }
    return keep(0.5 + 0.5 * sum, HOOKED_pos);
}
