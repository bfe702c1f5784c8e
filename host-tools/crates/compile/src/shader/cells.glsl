vec4 PASS() {
    ivec2 cell = kept_at(PLACE);
    vec4 area = area_of(FRAME);
    vec2 from = vec2(cell) * area.zw / vec2(CELLS);
    vec2 to = vec2(cell + 1) * area.zw / vec2(CELLS);
    vec3 sum = vec3(0.0);
    for (int y = int(floor(from.y)); float(y) < to.y; y++) {
        for (int x = int(floor(from.x)); float(x) < to.x; x++) {
            vec2 pixel = vec2(x, y);
            vec2 overlap = max(min(to, pixel + 1.0) - max(from, pixel), vec2(0.0));
            vec2 place = (area.xy + pixel + 0.5) / FRAME;
            vec3 light = above_ambient(light_of(FILM(place).rgb), (pixel + 0.5) / area.zw);
            sum += overlap.x * overlap.y * light;
        }
    }
    vec2 sides = to - from;
    return keep(sum / (sides.x * sides.y), PLACE);
}
