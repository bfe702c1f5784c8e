vec4 hook() {
    ivec2 at = ivec2(PLACE * FRAME) - AREA.xy;
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, AREA.zw))) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    Pixel pixel = pixel_of(at);
    vec4 codes = vec4(1.0);
    for (int colour = 0; colour < 3; colour++) {
        int channel = channel_of(colour);
        uint light = gain_at(pixel, channel) * light_at(pixel, colour);
        int direct = int((light + (1u << GAIN_FRACTION >> 1u)) >> GAIN_FRACTION);
        int correction = correction_at(pixel, colour) >> CORRECTION_GUARD_BITS;
        int drive = clamp(direct - correction, 0, DRIVE_ONE);
        codes[colour] = ILTM_CODES_at(in_list(channel * (DRIVE_ONE + 1) + drive)).x;
    }
    return codes;
}
