vec4 PASS() {
    ivec2 texel = kept_at(PLACE);
    int cell = texel.y * CELLS.x + texel.x;
    vec3 sum = vec3(0.0);
    for (int at = MOST * cell; at < MOST * (cell + 1); at++) {
        vec4 entry = ILTM_COVERING_at(in_list(at));
        int index = int(entry.x);
        int row = index / CELLS.x;
        vec3 part = ILTM_OUTPUTS_at(ivec2(index - row * CELLS.x, row)).rgb;
        sum += entry.y * (2.0 * part - 1.0);
    }
    return keep(0.5 + 0.5 * sum, PLACE);
}
