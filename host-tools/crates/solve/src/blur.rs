//! A projector out of focus.
//!
//! Light of a cell spreads as a Gaussian around where it should fall. With `B`
//! the part of each cell's light that lands on each other one, the transport is
//! `T = T0 B`: `T0^-1` keeps the sign and the sparsity that a solve relies on,
//! `T^-1 = B^-1 T0^-1` does not.

use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// Steps of Simpson's rule over a cell.
const STEPS: usize = 64;

/// `B`, `N x N`: element `(i, j)` is the part of cell `j`'s light that falls on
/// cell `i`, for a spread with a standard deviation of `deviation` cells. What
/// falls beside the frame is lost, so columns at the border sum to less than 1.
#[must_use]
pub fn blur(grid: Grid, deviation: f64) -> DMatrix<f64> {
    let (rows, cols) = (along(grid.rows(), deviation), along(grid.cols(), deviation));
    let width = grid.cols();
    DMatrix::from_fn(grid.cells(), grid.cells(), |i, j| {
        rows[(i / width).abs_diff(j / width)] * cols[(i % width).abs_diff(j % width)]
    })
}

/// The part of a cell's light that falls on the cell `0, 1, ... count - 1` places
/// beside it: a triangle, which is one cell's light seen over another's width,
/// times the Gaussian.
fn along(count: usize, deviation: f64) -> Vec<f64> {
    let gauss = |x: f64| {
        (-0.5 * (x / deviation).powi(2)).exp() / (deviation * std::f64::consts::TAU.sqrt())
    };
    let part = |distance: usize| {
        let half = |from: f64| {
            let value = |step: usize| {
                let x = from + step as f64 / STEPS as f64;
                let triangle = (1.0 - (x - distance as f64).abs()).max(0.0);
                let weight = match step {
                    0 | STEPS => 1.0,
                    odd if odd % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * triangle * gauss(x)
            };
            (0..=STEPS).map(value).sum::<f64>() / (3 * STEPS) as f64
        };
        half(distance as f64 - 1.0) + half(distance as f64)
    };
    if deviation < LEAST {
        return (0..count)
            .map(|distance| if distance == 0 { 1.0 } else { 0.0 })
            .collect();
    }
    (0..count).map(part).collect()
}

/// Below this many cells a blur is none, and Simpson's rule too coarse for it.
const LEAST: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_lost_only_beside_the_frame() {
        let grid = Grid::new(15, 17).unwrap();
        for deviation in [0.05, 0.3, 0.5, 1.0] {
            let blur = blur(grid, deviation);
            assert!(
                (blur.column(7 * 17 + 8).sum() - 1.0).abs() < 1e-6,
                "{deviation}"
            );
            assert!(blur.column(0).sum() < 1.0);
        }
    }

    /// Variance of a box convolved with a box and a Gaussian: 1/12 + 1/12 + s^2.
    #[test]
    fn the_spread_has_the_variance_that_was_asked_for() {
        for deviation in [0.1, 0.5, 1.0, 2.0_f64] {
            let parts = along(40, deviation);
            let variance: f64 = parts
                .iter()
                .enumerate()
                .map(|(k, p)| 2.0 * (k * k) as f64 * p)
                .sum();
            // A cell's own place counts as one number: the triangle's variance is 1/6.
            let wanted = deviation * deviation + 1.0 / 6.0;
            if deviation >= 0.5 {
                assert!((variance - wanted).abs() < 0.01, "{deviation}: {variance}");
            }
        }
    }
}
