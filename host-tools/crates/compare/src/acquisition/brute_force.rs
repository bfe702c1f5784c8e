//! One light at a time.

use super::Acquisition;
use crate::{Found, Rig, Source, Unfit};
use iltm_picture::progress::Progress;
use nalgebra::DMatrix;

/// Lights one cell after the other: each photograph is a column of `T`.
#[derive(Clone, Copy, Debug)]
pub struct BruteForce;

impl Acquisition for BruteForce {
    fn name(&self) -> String {
        "one light at a time".to_owned()
    }

    fn source(&self) -> Source {
        Source::INVERSE_LIGHT_TRANSPORT
    }

    fn how(&self) -> &'static str {
        "A photograph for each cell, lit alone: nothing is assumed, and every photograph is \
         dark, so that the camera's reading noise counts most."
    }

    fn acquire(&self, rig: &mut Rig, _progress: &dyn Progress) -> Result<Found, Unfit> {
        let lit = rig.live_cells();
        let cells = rig.grid().cells();
        let mut patterns = DMatrix::zeros(cells, lit.len());
        for (photograph, cell) in lit.iter().enumerate() {
            patterns[(*cell, photograph)] = 1.0;
        }
        let light = rig.photograph(&patterns);
        let mut transport = DMatrix::zeros(cells, cells);
        for (column, cell) in light.column_iter().zip(&lit) {
            transport.set_column(*cell, &column);
        }
        Ok(Found::Forward(transport))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_capture::NoiseModel;
    use iltm_picture::progress::Silent;
    use iltm_runtime::Grid;

    #[test]
    fn without_noise_every_column_is_the_transports() {
        let grid = Grid::new(2, 2).unwrap();
        let transport = DMatrix::from_fn(4, 4, |i, j| 1.0 / (1 + i + 2 * j) as f64);
        let mut rig = Rig::new(
            grid,
            transport.clone(),
            vec![true; 4],
            NoiseModel::default(),
            1,
        );
        let found = BruteForce.acquire(&mut rig, &Silent).unwrap();
        assert!(matches!(found, Found::Forward(found) if found == transport));
        assert_eq!(rig.photographs(), 4);
    }
}
