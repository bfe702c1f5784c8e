vec4 hook() {
    ivec2 texel = kept_at(HOOKED_pos);
    int index = 3 * (texel.y * CELLS.x + texel.x);
    vec4 box = texelFetch(ILTM_FUNCTIONS, ivec2(index % LINE, index / LINE), 0);
    index++;
    vec4 split = texelFetch(ILTM_FUNCTIONS, ivec2(index % LINE, index / LINE), 0);
    index++;
    float value = texelFetch(ILTM_FUNCTIONS, ivec2(index % LINE, index / LINE), 0).r;
    vec3 sum = vec3(0.0);
    for (int row = 0; row < int(box.z); row++) {
        vec3 line = vec3(0.0);
        for (int col = 0; col < int(box.w); col++) {
            float along = col < int(split.y) ? 1.0 : split.w;
            line += along * kept(ILTM_CELLS_raw, ivec2(int(box.y) + col, int(box.x) + row));
        }
        sum += (row < int(split.x) ? 1.0 : split.z) * line;
    }
    return keep(0.5 + 0.5 * value * sum, HOOKED_pos);
}
