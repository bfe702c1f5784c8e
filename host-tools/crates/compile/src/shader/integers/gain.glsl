Pixel pixel_of(ivec2 at) {
    return Pixel(at, CELLS_place(at), GAINS_place(at));
}

// Without the guard bits, to nearest.
int rounded(int value) {
    return (value + (1 << (GAIN_GUARD_BITS - 1))) >> GAIN_GUARD_BITS;
}

uint gain_at(Pixel pixel, int channel) {
    int gain = ILTM_GAINS_between(pixel.gains, pixel.at.x, channel);
    return uint(clamp(rounded(gain), 0, 65535));
}
