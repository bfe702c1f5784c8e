//! Direct light apart from all other by patterns finer than the light between surfaces.
//!
//! Nayar, Krishnan, Grossberg, Raskar, *Fast Separation of Direct and Global Components of
//! a Scene using High Frequency Illumination*, ACM Transactions on Graphics (SIGGRAPH)
//! 2006: of a pattern that lights half of the cells and its complement, a cell gets its
//! own light in one and half of all other in both.

use crate::compare::Rig;
use nalgebra::{DMatrix, DVector};

/// Direct light of every cell under white, length `N`, from six photographs: a
/// chequerboard, rows and columns in turn, each with its complement. What each pair says
/// is averaged, for noise and because each errs on light of its own kind.
pub(super) fn direct_light(rig: &mut Rig) -> DVector<f64> {
    let (cells, cols) = (rig.grid().cells(), rig.grid().cols());
    let lit = |pattern: usize, cell: usize| {
        let (row, col) = (cell / cols, cell % cols);
        let odd = match pattern / 2 {
            0 => row + col,
            1 => row,
            _ => col,
        };
        (odd + pattern).is_multiple_of(2)
    };
    let patterns = DMatrix::from_fn(cells, 6, |cell, pattern| {
        f64::from(u8::from(lit(pattern, cell)))
    });
    let light = rig.photograph(&patterns);
    DVector::from_fn(cells, |cell, _| {
        let own = (0..6).map(|pattern| {
            if lit(pattern, cell) {
                light[(cell, pattern)]
            } else {
                -light[(cell, pattern)]
            }
        });
        own.sum::<f64>() / 3.0
    })
}

#[cfg(test)]
mod tests {
    use super::super::test_scenes::{m_scene, rig};
    use super::*;
    use crate::capture::NoiseModel;
    use iltm_runtime::Grid;

    #[test]
    fn a_cells_own_light_is_told_from_that_of_others() {
        let grid = Grid::new(12, 16).unwrap();
        let (transport, live) = m_scene(grid);
        let mut rig = rig(grid, &transport, &live, NoiseModel::default());
        let direct = direct_light(&mut rig);
        assert_eq!(rig.photographs(), 6);
        // The panels return 0.7 of their own light; others' adds up to 30 % of it.
        let off = (direct - transport.diagonal()).norm() / transport.diagonal().norm();
        assert!(off < 0.01, "{off}");
    }
}
