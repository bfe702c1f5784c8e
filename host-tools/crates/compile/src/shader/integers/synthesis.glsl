vec4 hook() {
    ivec3 cell = cell_at(PLACE, CELLS.y);
    int first = MOST * (cell.y * CELLS.x + cell.x);
    int sum = 0;
    for (int at = first; at < first + MOST; at++) {
        int index = int(word_of(ILTM_COVERING_at(in_list(2 * at))));
        int value = int(word_of(ILTM_COVERING_at(in_list(2 * at + 1))));
        int row = index / CELLS.x;
        ivec2 output_at = ivec2(CELLS.x * cell.z + index - CELLS.x * row, row);
        sum += value * int(word_of(ILTM_OUTPUTS_at(output_at)));
    }
    return texel_of(uint(sum));
}
