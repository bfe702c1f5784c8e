int input_at(int col, int colour) {
    int row = col / CELLS.x;
    return int(word_of(ILTM_INPUTS_at(ivec2(CELLS.x * colour + col - CELLS.x * row, row))));
}

vec4 hook() {
    ivec3 cell = cell_at(PLACE, CELLS.y);
    int index = cell.y * CELLS.x + cell.x;
    int channel = channel_of(cell.z);
    int sum = index == CELLS.x * CELLS.y - 1 ? CORRECTION_HALF : 0;
    // Of all channels, and of this one.
    for (int part = 0; part < 2; part++) {
        int row = 2 * (2 * (channel * CELLS.x * CELLS.y + index) + part);
        int first = int(word_of(ILTM_ROWS_at(in_list(row))));
        int about = int(word_of(ILTM_ROWS_at(in_list(row + 1))));
        int products = 0;
        for (int pair = first; pair < first + (about & 0xffff); pair++) {
            int col = int(word_of(ILTM_PAIRS_at(in_list(2 * pair))));
            int values = int(word_of(ILTM_PAIRS_at(in_list(2 * pair + 1))));
            products += ((values << 16) >> 16) * input_at(col, cell.z);
            products += (values >> 16) * input_at(col + 1, cell.z);
        }
        sum += scaled_down(products, SCALES[channel]) >> (about >> 16);
    }
    return texel_of(uint(sum));
}
