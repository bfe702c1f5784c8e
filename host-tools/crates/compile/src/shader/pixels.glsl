vec4 PASS() {
    vec4 area = area_of(FRAME);
    vec2 part = (PLACE * FRAME - area.xy) / area.zw;
    if (any(lessThan(part, vec2(0.0))) || any(greaterThan(part, vec2(1.0)))) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    vec3 light = above_ambient(light_of(FILM(PLACE).rgb), part);
    vec3 drive = clamp(gain_of(part) * light - CORRECTION, 0.0, 1.0);
    return vec4(code_of(drive), 1.0);
}
