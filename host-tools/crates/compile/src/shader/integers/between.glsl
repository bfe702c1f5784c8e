int NAME_along(Place place, int col, int channel) {
    int before = NAME_value(ivec2(col, place.before), channel);
    int after = NAME_value(ivec2(col, place.after), channel);
    return before + scaled_down(after - before, place.share);
}

int NAME_between(Place place, int x, int channel) {
    int value = NAME_along(place, max(place.piece, 1) - 1, channel);
    if (place.piece == 0 || place.piece == COUNT) {
        return value;
    }
    int rise = NAME_along(place, place.piece, channel) - value;
    if (STEP != 0u) {
        rise = scaled(rise, STEP);
    }
    return value + scaled_down(rise, place.past) + rise * (x - place.first);
}
