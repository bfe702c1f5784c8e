//! Simulated rig: a projector and a camera before a scene whose transport is known.
//!
//! Stands for a real rig where a method wants patterns that nobody photographed: one
//! light at a time, stripes, patterns that depend on the photographs before.

use iltm_capture::NoiseModel;
use iltm_runtime::Grid;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Indices of the cells that are `live`, ascending.
pub(crate) fn live_cells(live: &[bool]) -> Vec<usize> {
    (0..live.len()).filter(|cell| live[*cell]).collect()
}

/// Sets rows and columns of cells that are not `live` to zero.
pub(crate) fn clear_dead(matrix: &mut DMatrix<f64>, live: &[bool]) {
    for cell in (0..live.len()).filter(|cell| !live[*cell]) {
        matrix.row_mut(cell).fill(0.0);
        matrix.column_mut(cell).fill(0.0);
    }
}

/// Photographs cell by cell, with a camera's noise, and counts them.
#[derive(Clone, Debug)]
pub struct Rig {
    grid: Grid,
    transport: DMatrix<f64>,
    live: Vec<bool>,
    noise: NoiseModel,
    random: Pcg64Mcg,
    photographs: usize,
}

impl Rig {
    /// A rig before a scene of `transport`, `N x N` in camera units, whose cells that
    /// are not `live` (length `N`) have zero rows and columns. `noise` is that of a
    /// cell's observation in one photograph; `seed` repeats it.
    ///
    /// # Panics
    /// If sizes disagree.
    #[must_use]
    pub fn new(
        grid: Grid,
        transport: DMatrix<f64>,
        live: Vec<bool>,
        noise: NoiseModel,
        seed: u64,
    ) -> Self {
        let cells = grid.cells();
        assert_eq!(transport.shape(), (cells, cells), "one row a cell");
        assert_eq!(live.len(), cells, "one entry a cell");
        Self {
            grid,
            transport,
            live,
            noise,
            random: Pcg64Mcg::seed_from_u64(seed),
            photographs: 0,
        }
    }

    /// Cells of the projector.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// Cells that are lit and seen, length `N`.
    #[must_use]
    pub fn live(&self) -> &[bool] {
        &self.live
    }

    /// The same, by index.
    #[must_use]
    pub fn live_cells(&self) -> Vec<usize> {
        live_cells(&self.live)
    }

    /// Noise of one cell's observation in one photograph.
    #[must_use]
    pub const fn noise(&self) -> NoiseModel {
        self.noise
    }

    /// The same rig with its projector out of focus: `spread`, `N x N`, is the part of
    /// each cell's light that falls on each other one.
    #[must_use]
    pub fn behind(&self, spread: &DMatrix<f64>) -> Self {
        Self {
            transport: &self.transport * spread,
            ..self.clone()
        }
    }

    /// Light of each cell under each pattern, `N x m` from `N x m` of 0 to 1: `m`
    /// photographs.
    pub fn photograph(&mut self, patterns: &DMatrix<f64>) -> DMatrix<f64> {
        let light = &self.transport * patterns;
        self.seen(light)
    }

    /// The same with projector and camera exchanged (`T^T`), which a rig needs a second
    /// projector and camera for.
    pub fn photograph_exchanged(&mut self, patterns: &DMatrix<f64>) -> DMatrix<f64> {
        let light = self.transport.tr_mul(patterns);
        self.seen(light)
    }

    /// Photographs taken so far.
    #[must_use]
    pub const fn photographs(&self) -> usize {
        self.photographs
    }

    fn seen(&mut self, mut light: DMatrix<f64>) -> DMatrix<f64> {
        self.photographs += light.ncols();
        for mut photograph in light.column_iter_mut() {
            for (value, live) in photograph.iter_mut().zip(&self.live) {
                let deviation = self.noise.variance(*value).sqrt();
                if *live && deviation > 0.0 {
                    let normal: f64 = StandardNormal.sample(&mut self.random);
                    *value += deviation * normal;
                }
            }
        }
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig(noise: NoiseModel) -> Rig {
        let grid = Grid::new(1, 3).unwrap();
        let transport =
            DMatrix::from_row_slice(3, 3, &[0.5, 0.1, 0.0, 0.2, 0.4, 0.0, 0.0, 0.0, 0.0]);
        Rig::new(grid, transport, vec![true, true, false], noise, 1)
    }

    #[test]
    fn photographs_are_counted_and_an_exchange_transposes() {
        let mut rig = rig(NoiseModel::default());
        let one = DMatrix::identity(3, 3);
        let forward = rig.photograph(&one);
        assert_eq!(forward.transpose(), rig.photograph_exchanged(&one));
        assert_eq!(rig.photographs(), 6);
    }

    #[test]
    fn out_of_focus_a_cell_lights_what_its_light_falls_on() {
        let half = DMatrix::from_row_slice(3, 3, &[0.5, 0.5, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 1.0]);
        let light = rig(NoiseModel::default())
            .behind(&half)
            .photograph(&DMatrix::from_row_slice(3, 1, &[1.0, 0.0, 0.0]));
        let wanted = DMatrix::from_row_slice(3, 1, &[0.3, 0.3, 0.0]);
        assert!((light - wanted).amax() < 1e-15);
    }

    #[test]
    fn noise_has_the_variance_of_its_model_and_spares_dead_cells() {
        let noise = NoiseModel {
            shot: 1e-3,
            floor: 1e-5,
        };
        let mut rig = rig(noise);
        let flood = rig.photograph(&DMatrix::from_element(3, 20_000, 1.0));
        for (cell, light) in [(0, 0.6), (1, 0.6)] {
            let row = flood.row(cell);
            assert!((row.mean() - light).abs() < 1e-3);
            // 20,000 samples: a variance is good to 1 %.
            assert!((row.variance() / noise.variance(light) - 1.0).abs() < 0.05);
        }
        assert!(
            flood
                .row(2)
                .iter()
                .all(|light| light.abs() < f64::MIN_POSITIVE)
        );
    }
}
