vec4 NAME_at(ivec2 cell) {
    vec3 whole = floor(255.0 * NAME_texel(ivec2(2 * cell.x, cell.y)).rgb + 0.5);
    return vec4((whole + NAME_texel(ivec2(2 * cell.x + 1, cell.y)).rgb) / 255.0, 1.0);
}
