//! Image registration of two photographs of black: whether a camera stood still between captures
//! of one scene.
//!
//! Each capture has its own patterns, but black shows the same scene in the same light: the room's,
//! and what projectors give off that show black. Both relative to their means, the photographs
//! differ by slopes times a shift (Lucas and Kanade, *An iterative image registration technique*,
//! 1981). Black is dark: the means over small squares of pixels are compared, and squares of slopes
//! are products of one photograph's with the other's, to which noise adds nothing. How far the shift
//! is known comes from leaving out each part of the picture in turn (the jackknife), so that a lamp
//! which lights one corner makes a shift unsure instead of making one up.

use nalgebra::{Matrix2, Vector2};

/// Pixels along a square's side whose mean is compared.
const SQUARE: usize = 4;

/// Squares that a photograph may be shifted by, on either side: what lies further is not found.
const FAR: isize = 8;

/// Parts of the picture along a side, each left out in turn.
const PARTS: usize = 4;

/// How many times what noise makes of it the likeness of two photographs must be: the best of many
/// shifts is taken, and smoothed noise is alike with its neighbours.
const CHANCE: f64 = 12.0;

/// How many times its deviation a shift is taken to be off.
const SURE: f64 = 4.0;

/// How far a photograph of black lies beside another.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct BlackShift {
    /// Right and down, in pixels.
    pub(crate) shift: [f64; 2],
    /// How far that may be off, in pixels.
    pub(crate) unsure: f64,
}

/// Light of the second photograph relative to the first; `None` if one of them has none.
pub(crate) fn brighter(first: &[f32], second: &[f32]) -> Option<f64> {
    let [first, second] =
        [first, second].map(|photo| photo.iter().map(|light| f64::from(*light)).sum::<f64>());
    (first > 0.0 && second > 0.0).then(|| second / first)
}

/// Finds the shift of the second photograph of a scene under black, of so many pixels a row; `None`
/// where they have too few pixels, no light, or no edges.
pub(crate) fn find(first: &[f32], second: &[f32], width: usize) -> Option<BlackShift> {
    let (first, second) = (Squares::of(first, width)?, Squares::of(second, width)?);
    let near = first.most_alike(&second)?;
    let mut parts = vec![Equations::default(); PARTS * PARTS];
    for (at, other) in first.laid_over(&second, near) {
        let (row, col) = (at / first.cols, at % first.cols);
        let part = row * PARTS / first.rows * PARTS + col * PARTS / first.cols;
        let more = second.light[other] - first.light[at];
        parts[part].add(first.slopes[at], second.slopes[other], more);
    }
    let all = parts.iter().fold(Equations::default(), Equations::plus);
    let shift = all.shift()?;
    let without = |part: &Equations| all.minus(part).shift();
    let without: Vec<[f64; 2]> = parts.iter().map(without).collect::<Option<_>>()?;
    let count = without.len() as f64;
    let variance = |axis: usize| {
        let mean = without.iter().map(|shift| shift[axis]).sum::<f64>() / count;
        let squares = without.iter().map(|shift| (shift[axis] - mean).powi(2));
        (count - 1.0) / count * squares.sum::<f64>()
    };
    let side = SQUARE as f64;
    Some(BlackShift {
        shift: [0, 1].map(|axis| side * (near[axis] as f64 + shift[axis])),
        unsure: SURE * side * (variance(0) + variance(1)).sqrt(),
    })
}

/// A photograph as means over squares of pixels.
struct Squares {
    rows: usize,
    cols: usize,
    /// Relative to the mean, and a little smoothed: differences of sharp edges are no slopes.
    light: Vec<f64>,
    /// Slopes to the right and down, 0 along the border.
    slopes: Vec<[f64; 2]>,
}

impl Squares {
    /// `None` if there are too few, or no light.
    fn of(photo: &[f32], width: usize) -> Option<Self> {
        let (rows, cols) = (photo.len() / width / SQUARE, width / SQUARE);
        if rows.min(cols) < 3 * PARTS {
            return None;
        }
        let square = |at: usize| {
            let (row, col) = (at / cols * SQUARE, at % cols * SQUARE);
            let pixels = (0..SQUARE * SQUARE)
                .map(|k| photo[(row + k / SQUARE) * width + col + k % SQUARE])
                .map(f64::from);
            pixels.sum::<f64>() / (SQUARE * SQUARE) as f64
        };
        let mut light: Vec<f64> = (0..rows * cols).map(square).collect();
        let mean = light.iter().sum::<f64>() / light.len() as f64;
        if mean <= 0.0 {
            return None;
        }
        for light in &mut light {
            *light /= mean;
        }
        let inner = |at: usize| {
            let (row, col) = (at / cols, at % cols);
            (1..rows - 1).contains(&row) && (1..cols - 1).contains(&col)
        };
        for step in [1, cols] {
            let before = light.clone();
            for at in (0..light.len()).filter(|at| inner(*at)) {
                light[at] = 0.25 * (before[at - step] + before[at + step]) + 0.5 * before[at];
            }
        }
        let slope = |at: usize| {
            let of = |step: usize| 0.5 * (light[at + step] - light[at - step]);
            if inner(at) {
                [of(1), of(cols)]
            } else {
                [0.0; 2]
            }
        };
        Some(Self {
            slopes: (0..light.len()).map(slope).collect(),
            rows,
            cols,
            light,
        })
    }

    /// Squares of this one and of the other that lie on each other if that is shifted so many to
    /// the right and down.
    fn laid_over(&self, other: &Self, shift: [isize; 2]) -> impl Iterator<Item = (usize, usize)> {
        let (rows, cols) = (self.rows, self.cols);
        let within = move |at: usize, by: isize, all: usize| {
            at.checked_add_signed(by).filter(|moved| *moved < all)
        };
        let pair = move |at: usize| {
            let row = within(at / cols, shift[1], rows)?;
            Some((at, row * cols + within(at % cols, shift[0], cols)?))
        };
        let all = self.slopes.len().min(other.slopes.len());
        (0..all).filter_map(pair)
    }

    /// The shift, in whole squares, with which slopes are most alike.
    fn most_alike(&self, other: &Self) -> Option<[isize; 2]> {
        let shifts = (-FAR..=FAR).flat_map(|down| (-FAR..=FAR).map(move |right| [right, down]));
        let alike = |shift: [isize; 2]| -> f64 {
            let pairs = self.laid_over(other, shift);
            let product = |(at, with): (usize, usize)| {
                let ([x, y], [u, v]) = (self.slopes[at], other.slopes[with]);
                x * u + y * v
            };
            pairs.map(product).sum()
        };
        let scored = shifts.map(|shift| (alike(shift), shift));
        let (most, shift) = scored.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
        let norm = |slopes: &[[f64; 2]]| {
            let squares = slopes.iter().flatten().map(|slope| slope * slope);
            squares.sum::<f64>().sqrt()
        };
        let alike = most / (norm(&self.slopes) * norm(&other.slopes));
        // Written so that what is not a number is nothing.
        let sure = alike > CHANCE / (self.slopes.len() as f64).sqrt();
        sure.then_some(shift)
    }
}

/// Normal equations of the shift.
#[derive(Clone, Default)]
struct Equations {
    normal: Matrix2<f64>,
    right: Vector2<f64>,
}

impl Equations {
    /// Adds a square, with the slopes of both photographs and what the second has more.
    fn add(&mut self, first: [f64; 2], second: [f64; 2], more: f64) {
        let [first, second] = [first, second].map(Vector2::from);
        self.normal += 0.5 * (first * second.transpose() + second * first.transpose());
        self.right -= 0.5 * more * (first + second);
    }

    fn plus(self, other: &Self) -> Self {
        Self {
            normal: self.normal + other.normal,
            right: self.right + other.right,
        }
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            normal: self.normal - other.normal,
            right: self.right - other.right,
        }
    }

    /// In squares; `None` where there is nothing but noise.
    fn shift(&self) -> Option<[f64; 2]> {
        Some(self.normal.cholesky()?.solve(&self.right).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_capture::Dice;

    const WIDTH: usize = 160;

    /// A room under black, shifted by so many pixels, with noise.
    fn room(shift: [f64; 2], light: f64, noise: f64, seed: u64) -> Vec<f32> {
        let mut dice = Dice::new(seed);
        let smooth = |x: f64| 1.0 / (1.0 + (-x).exp());
        let pixel = |at: usize| {
            let x = (at % WIDTH) as f64 - shift[0];
            let y = (at / WIDTH) as f64 - shift[1];
            // Pictures end at soft edges; a fold goes across.
            let lit = smooth(x - 20.0) * smooth(130.0 - x) * smooth(y - 15.0) * smooth(90.0 - y);
            let fold = 0.3 * smooth(0.4 * x + y - 90.0);
            (light * (1.0 + 4.0 * lit + fold) + noise * dice.normal()) as f32
        };
        (0..WIDTH * 120).map(pixel).collect()
    }

    #[test]
    fn a_shift_is_found_to_within_what_it_says_and_none_where_there_is_none() {
        for (seed, shift) in (0..).zip([[0.0, 0.0], [0.4, -0.2], [-1.0, 0.6], [0.15, 0.0]]) {
            let first = room([0.0; 2], 0.002, 0.0005, 10 + seed);
            let second = room(shift, 0.0024, 0.0005, 20 + seed);
            let found = find(&first, &second, WIDTH).unwrap();
            let off = (found.shift[0] - shift[0]).hypot(found.shift[1] - shift[1]);
            // Sharp edges are told an eighth too far.
            let size = shift[0].hypot(shift[1]);
            assert!(off < found.unsure.max(0.125 * size), "{shift:?}: {found:?}");
            assert!(found.unsure < 0.2, "{shift:?}: {found:?}");
            let brighter = brighter(&first, &second).unwrap();
            assert!((brighter - 1.2).abs() < 0.01, "{brighter}");
        }
        let far = room([14.0, -9.0], 0.002, 0.0005, 7);
        let found = find(&room([0.0; 2], 0.002, 0.0005, 8), &far, WIDTH).unwrap();
        let off = (found.shift[0] - 14.0).hypot(found.shift[1] + 9.0);
        assert!(off < found.unsure.max(0.5), "{found:?}");
    }

    #[test]
    fn noise_alone_and_a_lamp_in_a_corner_are_no_shift() {
        let noise = |seed| room([0.0; 2], 0.0, 0.0005, seed);
        for seed in 0..20 {
            let found = find(&noise(2 * seed), &noise(2 * seed + 1), WIDTH);
            assert_eq!(found, None);
        }
        let first = room([0.0; 2], 0.002, 0.0002, 3);
        let mut second = room([0.0; 2], 0.002, 0.0002, 4);
        for (at, light) in second.iter_mut().enumerate() {
            let (x, y) = ((at % WIDTH) as f32, (at / WIDTH) as f32);
            *light += 0.01 * (-(x * x + y * y) / 900.0).exp();
        }
        let found = find(&first, &second, WIDTH).unwrap();
        let [x, y] = found.shift;
        assert!(x.hypot(y) < found.unsure, "{found:?}");
        assert_eq!(find(&[0.0; 80], &[0.0; 80], 10), None);
    }
}
