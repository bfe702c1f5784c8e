Place NAME_place(ivec2 pixel) {
    uint rows = word_of(NAME_ROWS_at(in_list(2 * pixel.y)));
    uint share = word_of(NAME_ROWS_at(in_list(2 * pixel.y + 1)));
    uint columns = word_of(NAME_COLUMNS_at(in_list(2 * pixel.x)));
    uint past = word_of(NAME_COLUMNS_at(in_list(2 * pixel.x + 1)));
    ivec4 parts = ivec4(rows & 0xffffu, rows >> 16u, columns & 0xffffu, columns >> 16u);
    return Place(parts.x, parts.y, share, parts.z, parts.w, past);
}
