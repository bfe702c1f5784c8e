vec4 PASS() {
    ivec2 texel = kept_at(PLACE);
    vec4 ends = ILTM_ROWS_at(in_list(texel.y * CELLS.x + texel.x));
    vec3 sum = vec3(0.0);
    for (int at = int(ends.x); at < int(ends.y); at++) {
        vec4 entry = ILTM_ENTRIES_at(in_list(at));
        int col = int(entry.x);
        int row = col / CELLS.x;
        vec3 light = ILTM_INPUTS_at(ivec2(col - row * CELLS.x, row)).rgb;
        sum += entry.yzw * (2.0 * light - 1.0);
    }
    return keep(0.5 + 0.5 * sum, PLACE);
}
