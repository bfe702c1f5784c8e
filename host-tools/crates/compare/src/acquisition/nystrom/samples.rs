//! Photographs of clusters, forwards and with projector and camera exchanged.

use super::clusters::Clusters;
use crate::Rig;
use nalgebra::DMatrix;

/// Whole clusters lit alone.
pub(super) struct Samples {
    pub(super) clusters: Clusters,
    /// `N x k`.
    pub(super) columns: DMatrix<f64>,
    /// With projector and camera exchanged, `N x k`.
    pub(super) rows: DMatrix<f64>,
}

impl Samples {
    /// All live cells as one cluster.
    pub(super) fn first(rig: &mut Rig) -> Self {
        let clusters = Clusters::whole(rig.grid(), rig.live());
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
