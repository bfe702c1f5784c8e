vec4 PASS() {
    ivec2 texel = kept_at(PLACE);
    int index = texel.y * CELLS.x + texel.x;
    vec4 box = ILTM_FUNCTIONS_at(in_list(2 * index));
    vec4 split = ILTM_FUNCTIONS_at(in_list(2 * index + 1));
    vec4 steps = ILTM_STEPS_at(in_list(index));
    vec3 sum = vec3(0.0);
    for (int row = 0; row < int(box.z); row++) {
        vec3 line = vec3(0.0);
        for (int col = 0; col < int(box.w); col++) {
            float along = col < int(split.y) ? 1.0 : steps.y;
            line += along * ILTM_CELLS_at(ivec2(int(box.y) + col, int(box.x) + row)).rgb;
        }
        sum += (row < int(split.x) ? 1.0 : steps.x) * line;
    }
    return keep(0.5 + 0.5 * steps.z * sum, PLACE);
}
