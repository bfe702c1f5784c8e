//! Each projector alone: one inverse a projector, which misses the light that crosses.

use super::{Inversion, Inverted, KnownTransport};
use crate::rig::live_cells;
use crate::{Citation, Description, Unfit};
use iltm_runtime::Grid;
use iltm_solve::inverted;
use std::ops::Range;

/// The exact inverse of every projector's own transport.
#[derive(Clone, Debug)]
pub struct EachAlone {
    /// Columns of cells of each projector.
    pub columns: Vec<Range<usize>>,
}

/// The projector that a cell of a grid with these columns is of.
pub(crate) fn projector_of(cell: usize, grid: Grid, columns: &[Range<usize>]) -> Option<usize> {
    let col = cell % grid.cols();
    columns.iter().position(|own| own.contains(&col))
}

impl Inversion for EachAlone {
    fn description(&self) -> Description {
        Description {
            name: "exact inverse of each projector alone".to_owned(),
            source: Citation::INVERSE_LIGHT_TRANSPORT,
            how: "Every projector is calibrated while the others are dark, as if there were no \
                other. What crosses from one projector's light to another's is not cancelled.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let of_cell = |cell: usize| projector_of(cell, known.grid, &self.columns);
        let mut own = known.transport.clone();
        for col in 0..own.ncols() {
            for row in (0..own.nrows()).filter(|row| of_cell(*row) != of_cell(col)) {
                own[(row, col)] = 0.0;
            }
        }
        let inverse = inverted(&own, known.live).ok_or(Unfit::Singular)?;
        let live = live_cells(known.live);
        let multiplications = (0..self.columns.len()).map(|projector| {
            let cells = live
                .iter()
                .filter(|cell| of_cell(**cell) == Some(projector));
            (cells.count() as f64).powi(2)
        });
        Ok(Inverted::matrix(
            inverse,
            multiplications.sum(),
            String::new(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    #[test]
    fn light_that_crosses_is_missed_and_nothing_else() {
        let scene = KnownScene::sphere(3, 4, 0.7);
        let columns = std::iter::once(0..4).collect();
        assert!(scene.error(&EachAlone { columns }) < 1e-12);
        let columns = vec![0..2, 2..4];
        let halves = EachAlone { columns };
        let matrix = scene.matrix(&halves);
        assert!(scene.error(&halves) > 0.01);
        for (row, col) in (0..12).flat_map(|row| (0..12).map(move |col| (row, col))) {
            let same = row % 4 / 2 == col % 4 / 2;
            assert_eq!(matrix[(row, col)] != 0.0, same, "{row}, {col}");
        }
    }
}
