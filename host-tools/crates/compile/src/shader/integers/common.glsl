// A word of 32 bits is the four bytes of a texel, the lowest first.
uint word_of(vec4 texel) {
    uvec4 bytes = uvec4(255.0 * texel + 0.5);
    return bytes.x | bytes.y << 8u | bytes.z << 16u | bytes.w << 24u;
}

vec4 texel_of(uint word) {
    return vec4(uvec4(word, word >> 8u, word >> 16u, word >> 24u) & 255u) / 255.0;
}

uint halfword_of(vec4 texel) {
    return uint(65535.0 * texel.x + 0.5);
}

// Where an element of a list lies.
ivec2 in_list(int index) {
    int line = index / LINE;
    return ivec2(index - LINE * line, line);
}

// Of a pass over columns of cells, colour beside colour: column, row, colour.
ivec3 cell_at(vec2 place, int rows) {
    ivec2 texel = ivec2(place * vec2(3 * CELLS.x, rows));
    int colour = texel.x / CELLS.x;
    return ivec3(texel.x - CELLS.x * colour, texel.y, colour);
}

// Where a pixel lies between the values of two rows, and in a piece of a row.
struct Place {
    int before;
    int after;
    uint share;
    int piece;
    int first;
    uint past;
};

// A pixel of the area.
struct Pixel {
    ivec2 at;
    Place cells;
    Place gains;
};

int channel_of(int colour) {
    return min(colour, CHANNELS - 1);
}

// a + b: lower word, upper word.
uvec2 add(uvec2 a, uvec2 b) {
    uint low = a.x + b.x;
    return uvec2(low, a.y + b.y + (low < a.x ? 1u : 0u));
}

// a * b: lower word, upper word.
uvec2 product(uint a, uint b) {
#if __VERSION__ >= 400
    uvec2 words;
    umulExtended(a, b, words.y, words.x);
    return words;
#else
    uint low = (a & 0xffffu) * (b & 0xffffu);
    uint middle = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    uint other = (a & 0xffffu) * (b >> 16u) + (middle & 0xffffu);
    uint high = (a >> 16u) * (b >> 16u) + (middle >> 16u) + (other >> 16u);
    return uvec2((other << 16u) | (low & 0xffffu), high);
#endif
}

// (a * b) >> 32, rounded down.
int scaled_down(int a, uint b) {
    uvec2 magnitude = product(uint(abs(a)), b);
    uint up = magnitude.x != 0u ? 1u : 0u;
    return a < 0 ? -int(magnitude.y + up) : int(magnitude.y);
}

// (a * b) >> 32, to nearest, halves up.
int scaled(int a, uint b) {
    uvec2 magnitude = product(uint(abs(a)), b);
    uint up = magnitude.x >= 0x80000000u ? 1u : 0u;
    uint negative_up = magnitude.x > 0x80000000u ? 1u : 0u;
    return a < 0 ? -int(magnitude.y + negative_up) : int(magnitude.y + up);
}
