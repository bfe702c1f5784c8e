//! Haar coefficients of the operator, as a picture.

use iltm_picture::{ColourScale, Palette, Picture};
use iltm_runtime::FrameSize;
use iltm_solve::{Haar, InverseTransport};

/// Powers of ten below the largest coefficient that have colours of their own.
const DECADES: i32 = 4;

/// Most pixels along a side; larger operators show the largest of several
/// coefficients.
const MOST_PIXELS: usize = 768;

/// `|K^|` with its scale and axes.
#[derive(Clone, Debug)]
pub struct CoefficientMap {
    /// Row (output) by column (input) coefficient, coarse to fine from the top
    /// left.
    pub picture: Picture,
    /// Relative to the largest coefficient.
    pub scale: ColourScale,
    /// Where each level begins along both axes, 0 to 1, coarsest first, with the
    /// side of its functions in cells.
    pub levels: Vec<MapLevel>,
    /// How many coefficients there are, zeros included.
    pub coefficients: usize,
}

/// Coefficients of one level.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MapLevel {
    /// Where they begin, 0 to 1.
    pub start: f64,
    /// Cells along a side of their functions.
    pub side: usize,
}

impl CoefficientMap {
    /// Draws the operator that all channels share.
    #[must_use]
    pub fn new(inverse: &InverseTransport) -> Self {
        let haar = Haar::new(inverse.grid);
        let coefficients = inverse.shared.haar_coefficients(&haar);
        let magnitudes = coefficients.iter().map(|c| c.value.abs());
        let largest = magnitudes.fold(0.0, f64::max);
        let scale = ColourScale::logarithmic(Palette::Viridis, 1.0, DECADES);
        let cells = inverse.grid.cells();
        let side = cells.min(MOST_PIXELS);
        // A frame's sides fit 16 bits, since this one is at most `MOST_PIXELS`.
        let size = FrameSize::new(side as u16, side as u16);
        let size = size.unwrap_or(FrameSize::of_grid(inverse.grid));
        // Both axes reversed, since coefficients are numbered fine to coarse.
        let pixel = |number: u32| ((cells - number as usize) * side - 1) / cells;
        let mut values = vec![0.0_f64; side * side];
        for coefficient in coefficients {
            let value = &mut values[pixel(coefficient.row) * side + pixel(coefficient.col)];
            *value = value.max(coefficient.value.abs() / largest);
        }
        Self {
            picture: scale.picture(size, values),
            scale,
            levels: levels(haar.fineness()),
            coefficients: cells * cells,
        }
    }
}

/// The levels, from the fineness of each coefficient in its own order.
fn levels(fineness: &[f64]) -> Vec<MapLevel> {
    let finest = fineness.first().copied().unwrap_or(0.0);
    let mut levels: Vec<MapLevel> = Vec::new();
    let mut last = f64::NEG_INFINITY;
    for (index, level) in fineness.iter().rev().enumerate() {
        if *level > last {
            last = *level;
            levels.push(MapLevel {
                start: index as f64 / fineness.len() as f64,
                side: 2 << ((finest - level) as u32).min(30),
            });
        }
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::inverse;
    use iltm_picture::Samples;
    use iltm_runtime::Grid;

    #[test]
    fn an_operator_that_only_sees_the_mean_fills_the_top_left_corner() {
        let grid = Grid::new(4, 4).unwrap();
        let map = CoefficientMap::new(&inverse(grid, 1, |_, _| 1.0, |_, _| 0.1));
        assert_eq!(map.coefficients, 256);
        let Samples::Eight(samples) = map.picture.samples() else {
            panic!("8 bits");
        };
        assert_eq!(samples[..3], map.scale.colour(1.0));
        assert!(
            samples[3..]
                .chunks(3)
                .all(|pixel| pixel == map.scale.colour(0.0))
        );
    }

    #[test]
    fn four_by_four_cells_have_two_levels() {
        let grid = Grid::new(4, 4).unwrap();
        let map = CoefficientMap::new(&inverse(grid, 1, |_, _| 1.0, |_, _| 0.0));
        let sides: Vec<_> = map
            .levels
            .iter()
            .map(|level| (level.start, level.side))
            .collect();
        assert_eq!(sides, [(0.0, 4), (0.25, 2)]);
    }
}
