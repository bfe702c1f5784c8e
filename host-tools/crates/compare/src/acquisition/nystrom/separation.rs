//! Direct-global separation: direct light apart from all other by patterns finer than the light between surfaces.
//!
//! Nayar, Krishnan, Grossberg, Raskar, *Fast Separation of Direct and Global Components of
//! a Scene using High Frequency Illumination*, ACM Transactions on Graphics (SIGGRAPH)
//! 2006: of a pattern that lights half of the cells and its complement, a cell gets its
//! own light in one and half of all other in both.

use crate::Rig;
use nalgebra::{DMatrix, DVector};

/// Photographs that a separation takes.
pub(super) const PHOTOGRAPHS: usize = 6;

/// Photographs of patterns as fine as cells, each beside its complement.
pub(super) struct Separation {
    /// `N x 6` of 0 and 1; rows of cells that are not live are zero.
    patterns: DMatrix<f64>,
    /// `N x 6`.
    light: DMatrix<f64>,
}

impl Separation {
    /// A chequerboard, rows and columns in turn.
    pub(super) fn take(rig: &mut Rig) -> Self {
        let (cells, cols) = (rig.grid().cells(), rig.grid().cols());
        let patterns = DMatrix::from_fn(cells, PHOTOGRAPHS, |cell, pattern| {
            let (row, col) = (cell / cols, cell % cols);
            let odd = match pattern / 2 {
                0 => row + col,
                1 => row,
                _ => col,
            };
            f64::from(u8::from(
                rig.live()[cell] && (odd + pattern).is_multiple_of(2),
            ))
        });
        let light = rig.photograph(&patterns);
        Self { patterns, light }
    }

    /// Direct light of every cell under white, length `N`: what a pattern that lights it
    /// shows more than its complement, less what `other` light, `N x N`, says of both.
    /// The mean of all pairs, for noise and because each errs on light of its own kind.
    pub(super) fn direct_light(&self, other: &DMatrix<f64>) -> DVector<f64> {
        let own = &self.light - other * &self.patterns;
        let lit: Vec<f64> = self.patterns.row_sum().iter().copied().collect();
        DVector::from_fn(own.nrows(), |cell, _| {
            let pairs = (0..PHOTOGRAPHS).filter(|k| self.patterns[(cell, *k)] > 0.0);
            let shown: Vec<f64> = pairs
                .filter_map(|with| {
                    let without = with ^ 1;
                    // Patterns of odd grids do not light the same number of other cells.
                    let others = lit[with] - 1.0;
                    if others > 0.0 {
                        let share = others / lit[without];
                        let less = own[(cell, without)] * share;
                        // A pattern without complement tells nothing apart.
                        share.is_finite().then_some(own[(cell, with)] - less)
                    } else {
                        Some(own[(cell, with)])
                    }
                })
                .collect();
            shown.iter().sum::<f64>() / (shown.len() as f64).max(1.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::{m_scene, rig};
    use iltm_capture::NoiseModel;
    use iltm_runtime::Grid;

    #[test]
    fn a_cells_own_light_is_told_from_that_of_others() {
        let grid = Grid::new(12, 16).unwrap();
        let (transport, live) = m_scene(grid);
        let mut rig = rig(grid, &transport, &live, NoiseModel::default());
        let separation = Separation::take(&mut rig);
        assert_eq!(rig.photographs(), PHOTOGRAPHS);
        let own = transport.diagonal();
        let off = |other: &DMatrix<f64>| {
            let direct = separation.direct_light(other);
            (direct - &own).norm() / own.norm()
        };
        // Others' light adds up to 30 % of a cell's own; beside a fold it is as fine as
        // the patterns.
        let nothing_known = off(&DMatrix::zeros(192, 192));
        assert!(nothing_known < 0.05, "{nothing_known}");
        let mut others = transport.clone();
        others.set_diagonal(&DVector::zeros(192));
        assert!(off(&others) < 1e-14);
    }
}
