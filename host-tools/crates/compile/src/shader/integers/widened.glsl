int NAME_value(ivec2 at, int channel) {
    return int(halfword_of(NAME_at(ivec2(at.x, HEIGHT * channel + at.y)))) << GAIN_GUARD_BITS;
}
