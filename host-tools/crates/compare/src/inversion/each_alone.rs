//! Each projector alone: one inverse a projector, which misses the light that crosses.

use super::{Inversion, Inverted, KnownTransport};
use crate::rig::live_cells;
use crate::{Citation, Description, Unfit};
use iltm_picture::FramePart;
use iltm_runtime::Grid;
use iltm_solve::inverted;

/// The exact inverse of every projector's own transport.
#[derive(Clone, Debug)]
pub struct EachAlone {
    /// The cells of each projector.
    pub parts: Vec<FramePart>,
}

/// The projector that a cell of a grid with these parts is of.
pub(crate) fn projector_of(cell: usize, grid: Grid, parts: &[FramePart]) -> Option<usize> {
    let of = |part: &FramePart| part.own(grid.cols(), cell).is_some();
    parts.iter().position(of)
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
        let of_cell = |cell: usize| projector_of(cell, known.grid, &self.parts);
        let mut own = known.transport.clone();
        for col in 0..own.ncols() {
            for row in (0..own.nrows()).filter(|row| of_cell(*row) != of_cell(col)) {
                own[(row, col)] = 0.0;
            }
        }
        let inverse = inverted(&own, known.live).ok_or(Unfit::Singular)?;
        let live = live_cells(known.live);
        let multiplications = (0..self.parts.len()).map(|projector| {
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
        let parts = FramePart::side_by_side([[3, 4]]);
        assert!(scene.error(&EachAlone { parts }) < 1e-12);
        let parts = FramePart::side_by_side([[3, 2]; 2]);
        let halves = EachAlone { parts };
        let matrix = scene.matrix(&halves);
        assert!(scene.error(&halves) > 0.01);
        for (row, col) in (0..12).flat_map(|row| (0..12).map(move |col| (row, col))) {
            let same = row % 4 / 2 == col % 4 / 2;
            assert_eq!(matrix[(row, col)] != 0.0, same, "{row}, {col}");
        }
    }
}
