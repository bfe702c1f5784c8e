//! Wiener filter, adaptive: takes noise of a known size out of a photograph without blurring edges.
//!
//! A pixel is drawn towards the mean of its window by as much of the window's scatter as noise
//! explains: fully where a surface is even, not at all beside an edge between two paints. Lee,
//! *Digital image enhancement and noise filtering by use of local statistics*, IEEE Trans. Pattern
//! Analysis and Machine Intelligence 1980.

use rayon::prelude::*;

/// Pixels on each side of one that its window reaches.
const REACH: usize = 2;

/// Filters a plane of `width` columns in which only pixels of `inside` count; `variance` is the
/// noise's at a light. Pixels that do not count stay as they are.
pub(crate) fn filtered(
    plane: &[f32],
    width: usize,
    inside: &[bool],
    variance: impl Fn(f64) -> f64 + Sync,
) -> Vec<f32> {
    let height = plane.len() / width.max(1);
    let around = |at: usize, of: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(of);
    let value = |pixel: usize| {
        let own = plane[pixel];
        if !inside[pixel] {
            return own;
        }
        let (x, y) = (pixel % width, pixel / width);
        let (mut count, mut sum, mut squares) = (0.0_f64, 0.0, 0.0);
        for row in around(y, height) {
            for at in around(x, width).map(|x| row * width + x) {
                if inside[at] {
                    // From the pixel's own: squares of large numbers would lose small ones.
                    let off = f64::from(plane[at] - own);
                    count += 1.0;
                    sum += off;
                    squares += off * off;
                }
            }
        }
        let mean = sum / count;
        let scatter = (squares - count * mean * mean) / (count - 1.0);
        // Of a single pixel there is no scatter.
        let noise = (variance(f64::from(own) + mean) / scatter).min(1.0);
        if noise > 0.0 {
            own + (noise * mean) as f32
        } else {
            own
        }
    };
    (0..plane.len()).into_par_iter().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 40;
    const NOISE: f32 = 0.01;

    /// Two paints, 0.8 and 0.3, with noise of `NOISE` from a fixed sequence.
    fn noisy() -> Vec<f32> {
        let mut state = 1_u32;
        let mut even = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as f32 / u32::MAX as f32 - 0.5
        };
        let noise = |sum: f32| sum * NOISE;
        let paint = |at: usize| if at % WIDTH < 20 { 0.8 } else { 0.3 };
        // The sum of twelve has variance 1.
        (0..WIDTH * WIDTH)
            .map(|at| paint(at) + noise((0..12).map(|_| even()).sum()))
            .collect()
    }

    fn off(plane: &[f32], columns: std::ops::Range<usize>, paint: f32) -> f32 {
        let of_columns = plane.iter().enumerate();
        let of_columns = of_columns.filter(|(at, _)| columns.contains(&(at % WIDTH)));
        let squares: Vec<f32> = of_columns.map(|(_, v)| (v - paint).powi(2)).collect();
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    }

    #[test]
    fn noise_goes_and_an_edge_stays() {
        let plane = noisy();
        let inside = vec![true; plane.len()];
        let variance = |_| f64::from(NOISE * NOISE);
        let found = filtered(&plane, WIDTH, &inside, variance);
        assert!(off(&plane, 0..18, 0.8) > 0.9 * NOISE);
        for (columns, paint) in [(0..18, 0.8), (22..40, 0.3)] {
            assert!(off(&found, columns, paint) < 0.4 * NOISE);
        }
        for (columns, paint) in [(18..20, 0.8), (20..22, 0.3)] {
            assert!(off(&found, columns, paint) < 1.2 * NOISE);
        }
    }

    #[test]
    fn pixels_beside_the_projection_take_no_part() {
        let mut plane = vec![0.8; 100];
        let inside: Vec<bool> = (0..100).map(|at| at % 10 != 4).collect();
        for at in (4..100).step_by(10) {
            plane[at] = 0.0;
        }
        let found = filtered(&plane, 10, &inside, |_| 1.0);
        assert_eq!(found, plane);
    }

    #[test]
    fn a_lone_pixel_and_no_noise_change_nothing() {
        let alone: Vec<bool> = (0..9).map(|at| at == 4).collect();
        let plane: Vec<f32> = (0..9_u8).map(f32::from).collect();
        assert_eq!(filtered(&plane, 3, &alone, |_| 1.0), plane);
        assert_eq!(filtered(&plane, 3, &[true; 9], |_| 0.0), plane);
    }
}
