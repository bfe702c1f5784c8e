//! Overlapping projectors together: shares of the light where pictures overlap, and one inverse of the
//! bounces of all.

use super::{Inversion, Inverted, KnownTransport};
use crate::rig::live_cells;
use crate::{Citation, Description, Unfit};
use iltm_solve::inverted;
use nalgebra::DMatrix;

/// `p = w (g d - K d)` of cells that overlap: with `C` the light between cells that do not light one
/// place directly, `p = (1 + W G C)^-1 W G d`.
#[derive(Clone, Debug)]
pub struct Together {
    /// Cells of other projectors that light the same place directly, by cell, length `N`.
    pub overlaps: Vec<Vec<usize>>,
    /// Share of each cell in the light of its place, length `N`, 0 to 1; `None` without blending, as if it
    /// were 1 everywhere.
    pub shares: Option<Vec<f64>>,
}

impl Together {
    /// What takes wanted light to inputs, `N x N`, zero for cells that are not live; `None` if there is
    /// none.
    pub(crate) fn matrix(&self, transport: &DMatrix<f64>, live: &[bool]) -> Option<DMatrix<f64>> {
        let cells = live.len();
        let gain = |cell: usize| {
            let own = transport[(cell, cell)];
            let share = self.shares.as_ref().map_or(1.0, |shares| shares[cell]);
            if live[cell] && own > 0.0 {
                share / own
            } else {
                0.0
            }
        };
        let mut crossed = transport.clone();
        for (cell, others) in self.overlaps.iter().enumerate() {
            crossed[(cell, cell)] = 0.0;
            for other in others {
                crossed[(cell, *other)] = 0.0;
            }
        }
        for (cell, mut row) in crossed.row_iter_mut().enumerate() {
            row *= gain(cell);
        }
        crossed += DMatrix::identity(cells, cells);
        let mut matrix = inverted(&crossed, live)?;
        for (cell, mut column) in matrix.column_iter_mut().enumerate() {
            column *= gain(cell);
        }
        Some(matrix)
    }
}

impl Inversion for Together {
    fn description(&self) -> Description {
        let (name, how) = if self.shares.is_some() {
            (
                "all projectors together",
                "One inverse for the cells of all projectors. Where pictures overlap, each gives a share \
                 of the light, and the shares of a place add up to one.",
            )
        } else {
            (
                "all projectors together, without blending",
                "One inverse for the cells of all projectors, which cancels what crosses by bounces. \
                 Where pictures overlap, each projector shows the picture as if it lit the place \
                 alone.",
            )
        };
        Description {
            name: name.to_owned(),
            source: Citation {
                authors: "Raskar, Brown, Yang, Chen, Welch, Towles, Seales, Fuchs",
                title: "Multi-Projector Displays Using Camera-Based Registration",
                venue: "IEEE Visualization",
                year: 1999,
            },
            how,
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let matrix = self.matrix(known.transport, known.live);
        let cells = live_cells(known.live).len() as f64;
        Ok(Inverted::matrix(
            matrix.ok_or(Unfit::Singular)?,
            cells * cells,
            String::new(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inversion::Exact;
    use crate::known_scene::KnownScene;
    use nalgebra::DVector;

    #[test]
    fn without_overlap_it_is_the_inverse() {
        let scene = KnownScene::sphere(3, 4, 0.7);
        for shares in [None, Some(vec![1.0; 12])] {
            let overlaps = vec![Vec::new(); 12];
            let error = scene.error(&Together { overlaps, shares });
            assert!(error < 1e-12, "{error}");
        }
        let exact = scene.error(&Exact);
        assert!(exact < 1e-12);
    }

    /// Two places with a bounce between them, the second lit by two cells of different brightness.
    #[test]
    fn shares_of_a_place_add_up_to_the_wanted_light() {
        let rows = [[1.0, 0.1, 0.05], [0.2, 1.0, 0.5], [0.2, 1.0, 0.5]];
        let transport = DMatrix::from_fn(3, 3, |row, col| rows[row][col]);
        let overlaps = vec![vec![], vec![2], vec![1]];
        let wanted = DVector::from_vec(vec![0.4, 0.6, 0.6]);
        let light = |shares: Option<Vec<f64>>| {
            let overlaps = overlaps.clone();
            let matrix = Together { overlaps, shares }.matrix(&transport, &[true; 3]);
            &transport * (matrix.unwrap() * &wanted)
        };
        let blended = light(Some(vec![1.0, 0.3, 0.7]));
        assert!((blended - &wanted).norm() < 1e-12);
        let doubled = light(None);
        assert!(doubled[1] > 1.5 * wanted[1], "{doubled}");
        // A cell that is not lit or not seen takes no part.
        let matrix = Together {
            overlaps,
            shares: None,
        };
        let matrix = matrix.matrix(&transport, &[true, true, false]).unwrap();
        assert!(
            matrix
                .row(2)
                .iter()
                .chain(&matrix.column(2))
                .all(|value| *value == 0.0)
        );
    }
}
