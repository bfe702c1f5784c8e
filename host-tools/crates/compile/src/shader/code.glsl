float code_of_channel(float drive, int channel) {
    float bits = drive * 32768.0;
    float at = bits < DENSE ? bits : DENSE + (bits - DENSE) / 16.0;
    int knot = int(min(floor(at), LAST));
    int next = int(min(floor(at) + 1.0, LAST));
    float below = ILTM_CODES_at(in_list(knot))[channel];
    float above = ILTM_CODES_at(in_list(next))[channel];
    return mix(below, above, clamp(at - float(knot), 0.0, 1.0));
}

vec3 code_of(vec3 drive) {
    return vec3(code_of_channel(drive.r, 0), code_of_channel(drive.g, 1), code_of_channel(drive.b, 2));
}
