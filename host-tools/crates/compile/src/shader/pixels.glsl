vec4 hook() {
    vec4 area = area_of(HOOKED_size);
    vec2 part = (HOOKED_pos * HOOKED_size - area.xy) / area.zw;
    if (any(lessThan(part, vec2(0.0))) || any(greaterThan(part, vec2(1.0)))) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    vec3 light = ABOVE_AMBIENT(light_of(HOOKED_tex(HOOKED_pos).rgb), part);
    vec3 drive = clamp(GAIN(part) * light - CORRECTION, 0.0, 1.0);
    return vec4(CODE(drive), 1.0);
}
