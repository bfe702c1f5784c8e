vec3 NAME_between(vec2 part) {
    ivec2 a, b;
    vec2 t;
    neighbours(part, ivec2(WIDTH, HEIGHT), a, b, t);
    vec3 top = mix(NAME_at(a).rgb, NAME_at(ivec2(b.x, a.y)).rgb, t.x);
    vec3 low = mix(NAME_at(ivec2(a.x, b.y)).rgb, NAME_at(b).rgb, t.x);
    return mix(top, low, t.y);
}
