//! Clusters of cells that are halved again and again, and photographs of them, forwards and
//! with projector and camera exchanged.

use crate::Rig;
use crate::rig::live_cells;
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// A partition of the live cells of a grid.
#[derive(Clone, Debug)]
pub(super) struct CellClusters {
    grid: Grid,
    /// Cells of each cluster, none of them empty.
    members: Vec<Vec<usize>>,
}

impl CellClusters {
    /// All `live` cells (length `N`) in one.
    pub(super) fn whole(grid: Grid, live: &[bool]) -> Self {
        let members = live_cells(live);
        Self {
            grid,
            members: if members.is_empty() {
                Vec::new()
            } else {
                vec![members]
            },
        }
    }

    /// How many can be halved.
    pub(super) fn splits(&self) -> usize {
        let large = self.members.iter().filter(|cells| cells.len() > 1);
        large.count()
    }

    /// Each cluster halved across its longer side, halves beside each other, and the
    /// cluster that each comes from.
    pub(super) fn halved(&self) -> (Self, Vec<usize>) {
        let (mut members, mut parents) = (Vec::new(), Vec::new());
        for (parent, cells) in self.members.iter().enumerate() {
            for half in self.halves(cells) {
                members.push(half);
                parents.push(parent);
            }
        }
        let halved = Self {
            grid: self.grid,
            members,
        };
        (halved, parents)
    }

    fn halves(&self, cells: &[usize]) -> Vec<Vec<usize>> {
        if cells.len() < 2 {
            return vec![cells.to_vec()];
        }
        let cols = self.grid.cols();
        let extent = |of: &dyn Fn(usize) -> usize| {
            let places = || cells.iter().map(|cell| of(*cell));
            places().max().unwrap_or(0) - places().min().unwrap_or(0)
        };
        let (row, col) = (|cell: usize| cell / cols, |cell: usize| cell % cols);
        let mut cells = cells.to_vec();
        if extent(&row) > extent(&col) {
            cells.sort_by_key(|cell| (row(*cell), col(*cell)));
        } else {
            cells.sort_by_key(|cell| (col(*cell), row(*cell)));
        }
        let second = cells.split_off(cells.len().div_ceil(2));
        vec![cells, second]
    }

    /// Light of each cluster alone, `N x k` of 0 and 1.
    pub(super) fn lights(&self) -> DMatrix<f64> {
        self.weighted(|_| 1.0)
    }

    /// The mean over each cluster, `N x k`.
    pub(super) fn means(&self) -> DMatrix<f64> {
        self.weighted(|size| (size as f64).recip())
    }

    fn weighted(&self, weight: impl Fn(usize) -> f64) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(self.grid.cells(), self.members.len());
        for (cluster, cells) in self.members.iter().enumerate() {
            for cell in cells {
                matrix[(*cell, cluster)] = weight(cells.len());
            }
        }
        matrix
    }
}

/// Whole clusters lit alone.
pub(super) struct ClusterSamples {
    pub(super) clusters: CellClusters,
    /// `N x k`.
    pub(super) columns: DMatrix<f64>,
    /// With projector and camera exchanged, `N x k`.
    pub(super) rows: DMatrix<f64>,
}

impl ClusterSamples {
    /// All live cells as one cluster.
    pub(super) fn first(rig: &mut Rig) -> Self {
        let clusters = CellClusters::whole(rig.grid(), rig.live());
        let lights = clusters.lights();
        Self {
            columns: rig.photograph(&lights),
            rows: rig.photograph_exchanged(&lights),
            clusters,
        }
    }

    /// Every cluster in two: one half photographed, the other is what remains.
    pub(super) fn halved(&self, rig: &mut Rig) -> Self {
        let (clusters, parents) = self.clusters.halved();
        let second: Vec<usize> = (1..parents.len())
            .filter(|child| parents[*child] == parents[*child - 1])
            .collect();
        let shown = clusters.lights().select_columns(&second);
        let divide = |whole: &DMatrix<f64>, seen: &DMatrix<f64>| {
            let mut light = whole.select_columns(&parents);
            for (photograph, child) in seen.column_iter().zip(&second) {
                let first = light.column(*child - 1) - photograph;
                light.set_column(*child - 1, &first);
                light.set_column(*child, &photograph);
            }
            light
        };
        Self {
            columns: divide(&self.columns, &rig.photograph(&shown)),
            rows: divide(&self.rows, &rig.photograph_exchanged(&shown)),
            clusters,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_halves_end_as_single_live_cells() {
        let grid = Grid::new(5, 7).unwrap();
        let live: Vec<bool> = (0..35).map(|cell| cell % 6 != 0).collect();
        let mut clusters = CellClusters::whole(grid, &live);
        while clusters.splits() > 0 {
            let before = clusters.lights();
            let (halved, parents) = clusters.halved();
            let after = halved.lights();
            // A partition: halves make up the whole, no cell twice.
            for parent in 0..before.ncols() {
                let children: Vec<usize> = (0..parents.len())
                    .filter(|child| parents[*child] == parent)
                    .collect();
                let sum = after.select_columns(&children).column_sum();
                assert!((sum - before.column(parent)).amax() < 1e-15);
            }
            clusters = halved;
        }
        assert_eq!(clusters.lights().ncols(), 35 - 6);
    }
}
