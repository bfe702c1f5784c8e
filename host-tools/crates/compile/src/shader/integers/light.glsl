// Light of a pixel, without the room's.
uint light_at(Pixel pixel, int colour) {
    float film = FILM_at(AREA.xy + pixel.at)[colour];
    int code = int(65535.0 * clamp(film, 0.0, 1.0) + 0.5);
    uint light = halfword_of(ILTM_LIGHT_at(in_list(code)));
    return light - min(light, ambient_at(pixel, channel_of(colour)));
}
