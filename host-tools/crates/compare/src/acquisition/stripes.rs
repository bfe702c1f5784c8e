//! Stripe scanning: every row and every column of the projector, lit alone.

use super::Acquisition;
use crate::{Acquired, Citation, Description, Rig, Unfit};
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// Light below so many deviations of its noise is no light to divide by.
const BRIGHT: f64 = 3.0;

/// Scans rows and columns.
///
/// A camera cell answers `r_y` to row `y` and `c_x` to column `x`, and `f` to white. Its
/// response to cell `(y, x)` is taken for `r_y c_x / f`. That is exact where the response
/// is separable: a spot, a box, a Gaussian blur. Of interreflection it makes a cross: the
/// light that a whole column sends is put where that column meets the cell's own row.
/// Noise of rows and of columns is independent, so that its product has no bias; nothing
/// is clipped for that reason.
#[derive(Clone, Copy, Debug)]
pub struct StripeScanning;

impl Acquisition for StripeScanning {
    fn description(&self) -> Description {
        Description {
            name: "stripe scanning".to_owned(),
            source: Citation {
                authors: "Ding, Xiao, Tan, Yu",
                title: "Catadioptric Projectors",
                venue: "CVPR",
                year: 2009,
            },
            how: "White, every row and every column alone: a cell's response is the product of its \
                responses to rows and to columns. Needs responses that are separable, as blur is; \
                light between surfaces is not and ends up in a cross around each cell.",
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let grid = rig.grid();
        let (rows, cols) = (grid.rows(), grid.cols());
        let light = rig.photograph(&stripes(grid));
        let mut transport = DMatrix::zeros(grid.cells(), grid.cells());
        for seen in rig.live_cells() {
            let flood = light[(seen, rows + cols)];
            let noise = rig.noise().variance(flood).sqrt();
            // Not a number is not bright.
            let bright = flood > BRIGHT * noise;
            if !bright {
                return Err(Unfit::Condition(format!(
                    "cell {seen} returns {flood:.2e} under white, of which {noise:.2e} may be \
                     noise: stripes need light to divide by"
                )));
            }
            for lit in (0..grid.cells()).filter(|cell| rig.live()[*cell]) {
                let (row, col) = (lit / cols, lit % cols);
                transport[(seen, lit)] = light[(seen, row)] * light[(seen, rows + col)] / flood;
            }
        }
        Ok(Acquired::Forward(transport))
    }
}

/// Every row, every column, white: `N x (rows + cols + 1)`.
fn stripes(grid: Grid) -> DMatrix<f64> {
    let (rows, cols) = (grid.rows(), grid.cols());
    DMatrix::from_fn(grid.cells(), rows + cols + 1, |cell, stripe| {
        let lit = if stripe < rows {
            cell / cols == stripe
        } else {
            stripe == rows + cols || cell % cols == stripe - rows
        };
        f64::from(u8::from(lit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::{forward, m_scene, rig};
    use iltm_capture::NoiseModel;

    #[test]
    fn a_separable_response_is_found_exactly() {
        // A cell spreads 1, 2, 1 along its row and 1, 3 along its column, by albedo.
        let grid = Grid::new(4, 5).unwrap();
        let weight = |offset: i32, weights: &[(i32, f64)]| {
            let found = weights.iter().find(|(at, _)| *at == offset);
            found.map_or(0.0, |(_, weight)| *weight)
        };
        let transport = DMatrix::from_fn(20, 20, |seen, lit| {
            let (down, across) = (
                (lit / 5) as i32 - (seen / 5) as i32,
                (lit % 5) as i32 - (seen % 5) as i32,
            );
            let spread = weight(down, &[(0, 3.0), (1, 1.0)])
                * weight(across, &[(-1, 1.0), (0, 2.0), (1, 1.0)]);
            spread * (1 + seen) as f64 / 100.0
        });
        let mut rig = rig(grid, &transport, &[true; 20], NoiseModel::default());
        assert!((forward(&StripeScanning, &mut rig) - &transport).amax() < 1e-14);
        assert_eq!(rig.photographs(), 4 + 5 + 1);
    }

    #[test]
    fn interreflection_ends_up_in_a_cross() {
        let grid = Grid::new(6, 8).unwrap();
        let (transport, live) = m_scene(grid);
        let found = forward(
            &StripeScanning,
            &mut rig(grid, &transport, &live, NoiseModel::default()),
        );
        // What cell (2, 1) gets from column 3 of the other panel seems to come from its own
        // row.
        let from = |transport: &DMatrix<f64>, row: usize| transport[(2 * 8 + 1, row * 8 + 3)];
        assert!(from(&found, 2) > 2.0 * from(&transport, 2));
        for row in [0, 1, 3, 4, 5] {
            assert!(from(&found, row) < 0.5 * from(&transport, row));
        }
        // Yet every cell's flood is right.
        assert!((found.column_sum() - transport.column_sum()).amax() < 1e-13);
    }

    #[test]
    fn a_cell_that_returns_no_light_is_refused_by_name() {
        let mut transport = DMatrix::identity(4, 4);
        transport[(2, 2)] = 0.0;
        let grid = Grid::new(2, 2).unwrap();
        let mut rig = rig(grid, &transport, &[true; 4], NoiseModel::default());
        let refused = StripeScanning.acquire(&mut rig).unwrap_err();
        assert!(refused.to_string().contains("cell 2"), "{refused}");
    }
}
