//! Noise of every scale, from a hash of whole numbers.

/// Noise of one seed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    seed: u32,
}

impl Noise {
    pub(super) const fn new(seed: u64) -> Self {
        Self {
            seed: (seed ^ (seed >> 32)) as u32,
        }
    }

    /// Another noise, as independent as can be.
    pub(super) const fn other(self, number: u32) -> Self {
        Self {
            seed: mix(self.seed.wrapping_add(number.wrapping_mul(0x9E37_79B9))),
        }
    }

    /// 0 to 1, different in every cell.
    pub(super) const fn cell(self, x: i32, y: i32) -> f32 {
        let row = mix((y as u32).wrapping_add(self.seed));
        let hash = mix((x as u32).wrapping_add(row.wrapping_mul(0x85EB_CA6B)));
        // 24 bits are all that an `f32` holds.
        (hash >> 8) as f32 / 16_777_216.0
    }

    /// 0 to 1, smooth, with features about as large as 1.
    pub(super) fn smooth(self, x: f32, y: f32) -> f32 {
        let (left, top) = (x.floor(), y.floor());
        let (column, row) = (left as i32, top as i32);
        let (right, down) = (fade(x - left), fade(y - top));
        let along = |row: i32| {
            let (a, b) = (
                self.cell(column, row),
                self.cell(column.wrapping_add(1), row),
            );
            a + (b - a) * right
        };
        let (a, b) = (along(row), along(row.wrapping_add(1)));
        a + (b - a) * down
    }

    /// 0 to 1, with features at `octaves` scales, each half as large and half as
    /// strong as the one before: the spectrum of natural surfaces.
    pub(super) fn rough(self, x: f32, y: f32, octaves: u32) -> f32 {
        let (mut sum, mut weight, mut scale) = (0.0, 0.5, 1.0);
        for octave in 0..octaves {
            // Turned between octaves, so that their lattices do not show.
            let (turned_x, turned_y) = (0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
            let (at_x, at_y) = if octave % 2 == 0 {
                (x, y)
            } else {
                (turned_x, turned_y)
            };
            sum += weight * self.other(octave).smooth(at_x * scale, at_y * scale);
            weight *= 0.5;
            scale *= 2.03;
        }
        sum
    }

    /// 0 to 1, with sharp crests.
    pub(super) fn ridged(self, x: f32, octaves: u32) -> f32 {
        let (mut sum, mut weight, mut scale) = (0.0, 0.5, 1.0);
        for octave in 0..octaves {
            let value = self.other(octave).smooth(x * scale, 0.5);
            let crest = 1.0 - (2.0 * value - 1.0).abs();
            sum += weight * crest * crest;
            weight *= 0.46;
            scale *= 2.11;
        }
        sum
    }
}

/// Scrambles 32 bits (`lowbias32` of Wellons, *Prospecting for Hash Functions*,
/// 2018).
const fn mix(mut hash: u32) -> u32 {
    hash ^= hash >> 16;
    hash = hash.wrapping_mul(0x7FEB_352D);
    hash ^= hash >> 15;
    hash = hash.wrapping_mul(0x846C_A68B);
    hash ^ (hash >> 16)
}

/// 0 to 1 with no slope and no curvature at the ends.
fn fade(x: f32) -> f32 {
    x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
}

/// 0 below `start`, 1 above `end`, smooth between them.
pub(super) fn step(start: f32, end: f32, x: f32) -> f32 {
    let x = ((x - start) / (end - start)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// From -1 to 1 and back with a period of 1, like a sine.
pub(super) fn swing(x: f32) -> f32 {
    let x = 4.0 * ((x - 0.25) - (x - 0.25).floor() - 0.5).abs() - 1.0;
    x * (1.5 - 0.5 * x * x)
}
