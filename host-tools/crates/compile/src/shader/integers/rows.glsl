// Of a row of pixels, the light in each column of cells times how much of a pixel is in it. Rows and
// their sum are two passes: they are many and short then.
vec4 hook() {
    ivec3 cell = cell_at(PLACE, AREA.w);
    // A pixel is as many units as there are columns of cells, and those as many as there are pixels.
    int from = cell.x * AREA.z;
    int to = from + AREA.z;
    uint sum = 0u;
    for (int x = from / CELLS.x; x * CELLS.x < to; x++) {
        int overlap = min((x + 1) * CELLS.x, to) - max(x * CELLS.x, from);
        sum += uint(overlap) * light_at(pixel_of(ivec2(x, cell.y)), cell.z);
    }
    return texel_of(sum);
}
