// The room's light at a pixel, which its gain has been taken out of.
uint ambient_at(Pixel pixel, int channel) {
    uint gain = gain_at(pixel, channel);
    int driven = rounded(ILTM_AMBIENT_between(pixel.cells, pixel.at.x, channel));
    uint light = uint(max(driven, 0)) << GAIN_FRACTION;
    return gain == 0u ? 0u : min((light + gain / 2u) / gain, 65535u);
}
