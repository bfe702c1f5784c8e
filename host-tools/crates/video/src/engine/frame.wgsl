// Frames in integers: averages over the cells, corrections between their centres, gains and
// codes. Every result is the runtime's, bit for bit.
//
// Codes lie row by row, in a row colour by colour, two or four in a word. The light of an average
// and the correction of a pixel are what iltm_runtime::resample says. Whatever is the same for
// all frames is an override.

// Of a row of the frame.
override WIDTH: u32;
// Of a pixel of the frame, and of the table.
override COLOURS: u32;
override CHANNELS: u32;
override CODE_BITS: u32;
// The pixels that cells cover.
override AREA_LEFT: u32;
override AREA_TOP: u32;
override AREA_WIDTH: u32;
override AREA_HEIGHT: u32;
// The picture on them; nothing counts as clipped around it.
override PICTURE_LEFT: u32;
override PICTURE_RIGHT: u32;
override PICTURE_TOP: u32;
override PICTURE_BOTTOM: u32;
override ROWS: u32;
override COLS: u32;
// Of a cell's width, what a pixel is: 32 fraction bits, and 0 stands for a whole one.
override STEP: u32;
override GAIN_FRACTION: u32;
override CORRECTION_GUARD_BITS: u32;
override DRIVE_ONE: u32;
// Curves from drives to codes: one for each channel, or one for all.
override CURVES: u32;

@group(0) @binding(0) var<storage, read_write> codes: array<u32>;
@group(0) @binding(1) var<storage, read> light_by_code: array<u32>;
// Of every pixel of the area and every channel: gain, and ambient light in the upper half.
@group(0) @binding(2) var<storage, read> paint: array<u32>;
// Of every cell, colour by colour: lower word, upper word.
@group(0) @binding(3) var<storage, read_write> sums: array<vec2<u32>>;
// Of every cell, colour by colour.
@group(0) @binding(4) var<storage, read> corrections: array<i32>;
// Of every row of the area: the cells before and after it, and the share of the one after.
@group(0) @binding(5) var<storage, read> places: array<vec4<u32>>;
// Of every piece: its first pixel, and how far that is after the centre.
@group(0) @binding(6) var<storage, read> pieces: array<vec2<u32>>;
// Of every row and colour, `COLS + 1` pieces: the correction at pixel 0, and its step.
@group(0) @binding(7) var<storage, read_write> lines: array<vec2<i32>>;
// Of every column of the area: its piece.
@group(0) @binding(8) var<storage, read> columns: array<u32>;
@group(0) @binding(9) var<storage, read> code_by_drive: array<u32>;
// Below black, above white.
@group(0) @binding(10) var<storage, read_write> clipped: array<atomic<u32>, 2>;

// Of every row and colour, column of cells by column: its light, times how much of it is in the cell.
@group(0) @binding(11) var<storage, read_write> row_sums: array<u32>;

const GROUP: u32 = 64;

struct Invocation {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) within: u32,
}

fn index_of(invocation: Invocation) -> u32 {
    let group = invocation.group.y * invocation.groups.x + invocation.group.x;
    return group * GROUP + invocation.within;
}

// a * b: lower word, upper word.
fn product(a: u32, b: u32) -> vec2<u32> {
    let low = (a & 0xffff) * (b & 0xffff);
    let middle = (a >> 16) * (b & 0xffff) + (low >> 16);
    let other = (a & 0xffff) * (b >> 16) + (middle & 0xffff);
    let high = (a >> 16) * (b >> 16) + (middle >> 16) + (other >> 16);
    return vec2((other << 16) | (low & 0xffff), high);
}

// (a * b) >> 32, rounded down.
fn scaled_down(a: i32, b: u32) -> i32 {
    let magnitude = product(u32(abs(a)), b);
    let up = select(0u, 1u, magnitude.x != 0);
    return select(i32(magnitude.y), -i32(magnitude.y + up), a < 0);
}

// (a * b) >> 32, to nearest, halves up.
fn scaled(a: i32, b: u32) -> i32 {
    let magnitude = product(u32(abs(a)), b);
    let up = select(0u, 1u, magnitude.x >= 0x80000000u);
    let negative_up = select(0u, 1u, magnitude.x > 0x80000000u);
    return select(i32(magnitude.y + up), -i32(magnitude.y + negative_up), a < 0);
}

// Between two values, as iltm_runtime::resample::interpolation::blend; 31 fraction bits.
fn blend(before: i32, after: i32, fraction: u32) -> i32 {
    return before + scaled_down(after - before, fraction << 1);
}

fn code_at(sample: u32) -> u32 {
    let per_word = 32 / CODE_BITS;
    let word = codes[sample / per_word] >> (sample % per_word * CODE_BITS);
    return word & ((1u << CODE_BITS) - 1);
}

fn paint_at(x: u32, y: u32, colour: u32) -> u32 {
    return paint[(y * CHANNELS + colour % CHANNELS) * AREA_WIDTH + x];
}

// Light without ambient.
fn light(code: u32, paint: u32) -> u32 {
    let light = light_by_code[code];
    return light - min(light, paint >> 16);
}

// Light of each column of cells along a row. Rows and their sum are two passes: on their own,
// they are many and short, and software stops a loop after 65,535 rounds.
@compute @workgroup_size(GROUP)
fn average_rows(invocation: Invocation) {
    let index = index_of(invocation);
    if index >= AREA_HEIGHT * COLOURS * COLS {
        return;
    }
    let y = index / COLS / COLOURS;
    let colour = index / COLS % COLOURS;
    // A pixel is COLS units wide, a cell AREA_WIDTH.
    let left = index % COLS * AREA_WIDTH;
    let right = left + AREA_WIDTH;
    let line = (AREA_TOP + y) * COLOURS + colour;
    var sum = 0u;
    for (var x = left / COLS; x * COLS < right; x++) {
        let code = code_at(line * WIDTH + AREA_LEFT + x);
        let overlap = min((x + 1) * COLS, right) - max(x * COLS, left);
        sum += overlap * light(code, paint_at(x, y, colour));
    }
    row_sums[index] = sum;
}

@compute @workgroup_size(GROUP)
fn average(invocation: Invocation) {
    let index = index_of(invocation);
    if index >= COLOURS * ROWS * COLS {
        return;
    }
    let colour = index / (ROWS * COLS);
    let row = index / COLS % ROWS;
    let col = index % COLS;
    // A pixel is ROWS units high, a cell AREA_HEIGHT.
    let top = row * AREA_HEIGHT;
    let bottom = top + AREA_HEIGHT;
    var sum = vec2(0u, 0u);
    for (var y = top / ROWS; y * ROWS < bottom; y++) {
        let overlap = min((y + 1) * ROWS, bottom) - max(y * ROWS, top);
        let more = product(row_sums[(y * COLOURS + colour) * COLS + col], overlap);
        let low = sum.x + more.x;
        sum = vec2(low, sum.y + more.y + select(0u, 1u, low < more.x));
    }
    sums[index] = sum;
}

// The correction of a cell of a row of pixels.
fn of_line(y: u32, colour: u32, col: u32) -> i32 {
    let place = places[y];
    let first = colour * ROWS;
    let before = corrections[(first + place.x) * COLS + col];
    let after = corrections[(first + place.y) * COLS + col];
    return blend(before, after, place.z);
}

@compute @workgroup_size(GROUP)
fn interpolate(invocation: Invocation) {
    let index = index_of(invocation);
    if index >= AREA_HEIGHT * COLOURS * (COLS + 1) {
        return;
    }
    let piece = index % (COLS + 1);
    let line = index / (COLS + 1);
    let y = line / COLOURS;
    let colour = line % COLOURS;
    let value = of_line(y, colour, max(piece, 1u) - 1);
    if piece == 0 || piece == COLS {
        lines[index] = vec2(value, 0);
        return;
    }
    let difference = of_line(y, colour, piece) - value;
    var step = difference;
    if STEP != 0 {
        step = scaled(difference, STEP);
    }
    let place = pieces[piece - 1];
    let begin = value + scaled_down(step, place.y);
    lines[index] = vec2(begin - step * i32(place.x), step);
}

@compute @workgroup_size(GROUP)
fn finish(invocation: Invocation) {
    let index = index_of(invocation);
    if index >= arrayLength(&codes) {
        return;
    }
    let per_word = 32 / CODE_BITS;
    var word = 0u;
    var black = 0u;
    var white = 0u;
    for (var place = 0u; place < per_word; place++) {
        let sample = index * per_word + place;
        let line = sample / WIDTH;
        let colour = line % COLOURS;
        // To the left of the area and above it these are as large as can be.
        let x = sample % WIDTH - AREA_LEFT;
        let y = line / COLOURS - AREA_TOP;
        if x >= AREA_WIDTH || y >= AREA_HEIGHT {
            continue;
        }
        let paint = paint_at(x, y, colour);
        let product = (paint & 0xffff) * light(code_at(sample), paint);
        let direct = (product + ((1u << GAIN_FRACTION) >> 1)) >> GAIN_FRACTION;
        let of_piece = lines[(y * COLOURS + colour) * (COLS + 1) + columns[x]];
        let correction = of_piece.x + of_piece.y * i32(x);
        let wanted = i32(direct) - (correction >> CORRECTION_GUARD_BITS);
        let in_picture = x >= PICTURE_LEFT && x < PICTURE_RIGHT
            && y >= PICTURE_TOP && y < PICTURE_BOTTOM;
        black += select(0u, 1u, in_picture && wanted < 0);
        white += select(0u, 1u, in_picture && wanted > i32(DRIVE_ONE));
        let drive = u32(clamp(wanted, 0, i32(DRIVE_ONE)));
        let curve = min(colour % CHANNELS, CURVES - 1);
        word |= code_by_drive[curve * (DRIVE_ONE + 1) + drive] << (place * CODE_BITS);
    }
    codes[index] = word;
    if black > 0 {
        atomicAdd(&clipped[0], black);
    }
    if white > 0 {
        atomicAdd(&clipped[1], white);
    }
}
