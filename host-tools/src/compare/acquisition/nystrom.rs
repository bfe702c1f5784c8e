//! Kernel Nystrom: a transport of low rank from some of its columns and rows.

use super::Acquisition;
use super::clusters::Clusters;
use super::separation::direct_light;
use crate::compare::{Found, Rig, Source, Unfit};
use crate::progress::Progress;
use nalgebra::{DMatrix, DVector};

/// Exponents of the element-wise kernel that are tried.
const EXPONENTS: [f64; 4] = [1.0, 0.75, 0.5, 0.25];
/// Singular values below which part of the largest are dropped, tried one by one.
const CUTS: [f64; 9] = [0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-6, 1e-10];
/// Doubling the samples has to lower the predicted error by this factor, or it has
/// settled.
const SETTLED: f64 = 0.9;
/// Photographs of the least number of samples, and of the separation.
const LEAST: usize = 2;
const SEPARATION: usize = 6;

/// The generalised Nystrom method in the space of a power kernel.
///
/// Clusters of lights are lit alone: mean columns `C`, `N x k`; with projector and camera
/// exchanged, mean rows `R`, `k x N`; where both cross `A`, `k x k`. Then
/// `f(T) = f(C) f(A)^+ f(R)` element by element, `f(x) = x^gamma`, exact for `gamma = 1`
/// if `T` has no higher rank than `A`. From the paper: the formula, the kernel, clusters,
/// samples added until the error settles. Ours: clusters are halved, one half of each
/// photographed and the other found as the rest; the new photographs, predicted before
/// they are used, choose `gamma` and the rank, and estimate the error.
///
/// Direct light is a diagonal, of full rank: no cluster predicts what another returns, and
/// its answer smears each cell's own light over its cluster. `separated` therefore takes
/// direct light off first.
#[derive(Clone, Copy, Debug)]
pub struct Nystrom {
    photographs: usize,
    separated: bool,
}

impl Nystrom {
    /// On at most so many photographs; `separated`: direct light apart, by six of them.
    #[must_use]
    pub const fn new(photographs: usize, separated: bool) -> Self {
        Self {
            photographs,
            separated,
        }
    }
}

impl Acquisition for Nystrom {
    fn name(&self) -> String {
        let Self { photographs, .. } = self;
        if self.separated {
            format!("kernel Nystrom, direct light apart, up to {photographs}")
        } else {
            format!("kernel Nystrom, up to {photographs}")
        }
    }

    fn source(&self) -> Source {
        Source {
            authors: "Wang, Dong, Tong, Lin, Guo",
            title: "Kernel Nystrom Method for Light Transport",
            venue: "ACM Transactions on Graphics (SIGGRAPH)",
            year: 2009,
        }
    }

    fn how(&self) -> &'static str {
        if self.separated {
            "Each cell's own light by patterns as fine as cells (Nayar and others, 2006); the \
             rest, smooth and of low rank, from clusters of cells lit alone. Needs a second \
             projector and camera in each other's places."
        } else {
            "Clusters of cells lit alone, forwards and with projector and camera exchanged: \
             columns and rows that all others are made of if the rank is low. Needs a second \
             projector and camera in each other's places; a cell's own light is of full rank."
        }
    }

    fn acquire(&self, rig: &mut Rig, _progress: &dyn Progress) -> Result<Found, Unfit> {
        let separation = if self.separated { SEPARATION } else { 0 };
        if self.photographs < separation + LEAST {
            return Err(Unfit::Condition(format!(
                "{} photographs; the least is {}",
                self.photographs,
                separation + LEAST
            )));
        }
        let direct = if self.separated {
            direct_light(rig)
        } else {
            DVector::zeros(rig.grid().cells())
        };
        let mut samples = Samples::first(rig, direct);
        let mut best = (f64::INFINITY, Model::default());
        while 2 * samples.clusters.splits() > 0
            && rig.photographs() + 2 * samples.clusters.splits() <= self.photographs
        {
            let next = samples.halved(rig);
            let (error, model) = Model::choose(&samples, &next);
            let settled = error > SETTLED * best.0;
            samples = next;
            best = (error, model);
            if settled {
                break;
            }
        }
        let mut transport = best.1.transport(&samples);
        for (cell, live) in rig.live().iter().enumerate() {
            transport[(cell, cell)] += samples.direct[cell];
            if !live {
                transport.row_mut(cell).fill(0.0);
                transport.column_mut(cell).fill(0.0);
            }
        }
        Ok(Found::Forward(transport))
    }
}

/// What was photographed, direct light taken off.
struct Samples {
    clusters: Clusters,
    /// Direct light, length `N`; zeros if not separated.
    direct: DVector<f64>,
    /// Mean of each cluster's columns, `N x k`.
    columns: DMatrix<f64>,
    /// Mean of each cluster's rows, `N x k`: transposed.
    rows: DMatrix<f64>,
}

impl Samples {
    /// All live cells as one cluster.
    fn first(rig: &mut Rig, direct: DVector<f64>) -> Self {
        let clusters = Clusters::whole(rig.grid(), rig.live());
        let lit = clusters.lights();
        let columns = rig.photograph(&lit);
        let rows = rig.photograph_exchanged(&lit);
        Self::new(clusters, direct, &columns, &rows)
    }

    /// From photographs of whole clusters.
    fn new(
        clusters: Clusters,
        direct: DVector<f64>,
        columns: &DMatrix<f64>,
        rows: &DMatrix<f64>,
    ) -> Self {
        let own = DMatrix::from_diagonal(&direct) * clusters.lights();
        let means = clusters.means();
        let mean = |light: &DMatrix<f64>| {
            let mut light = light - &own;
            for (mut column, weights) in light.column_iter_mut().zip(means.column_iter()) {
                column *= weights.amax();
            }
            light
        };
        Self {
            columns: mean(columns),
            rows: mean(rows),
            clusters,
            direct,
        }
    }

    /// Every cluster in two: one half photographed, the other is what remains.
    fn halved(&self, rig: &mut Rig) -> Self {
        let (clusters, parents) = self.clusters.halved();
        let lights = clusters.lights();
        let new: Vec<usize> = (0..parents.len())
            .filter(|child| *child > 0 && parents[*child] == parents[*child - 1])
            .collect();
        let shown = lights.select_columns(&new);
        let rest = |seen: DMatrix<f64>, means: &DMatrix<f64>| {
            let mut light = DMatrix::zeros(lights.nrows(), parents.len());
            for (child, parent) in parents.iter().enumerate() {
                // The parent's own light, direct light put back.
                let cells = self.clusters.lights().column(*parent).into_owned();
                let whole = means.column(*parent) * cells.sum() + self.direct.component_mul(&cells);
                light.set_column(child, &whole);
            }
            for (photograph, child) in seen.column_iter().zip(&new) {
                let first = light.column(*child - 1) - photograph;
                light.set_column(*child - 1, &first);
                light.set_column(*child, &photograph);
            }
            light
        };
        let columns = rest(rig.photograph(&shown), &self.columns);
        let rows = rest(rig.photograph_exchanged(&shown), &self.rows);
        Self::new(clusters, self.direct.clone(), &columns, &rows)
    }

    /// `A`: means between clusters, seen from both sides, `k x k`.
    fn crossing(&self) -> DMatrix<f64> {
        let means = self.clusters.means();
        (means.tr_mul(&self.columns) + self.rows.tr_mul(&means)) * 0.5
    }
}

/// Kernel and rank.
#[derive(Clone, Copy, Debug)]
struct Model {
    exponent: f64,
    cut: f64,
}

impl Default for Model {
    fn default() -> Self {
        Self {
            exponent: 1.0,
            cut: 1e-10,
        }
    }
}

impl Model {
    /// The model that best predicts `next` from `samples`, and its relative error.
    fn choose(samples: &Samples, next: &Samples) -> (f64, Self) {
        let means = next.clusters.means();
        let error = |model: &Self| {
            let transport = model.transport(samples);
            let columns = &transport * &means - &next.columns;
            let rows = transport.tr_mul(&means) - &next.rows;
            let total = next.columns.norm_squared() + next.rows.norm_squared();
            if total > 0.0 {
                ((columns.norm_squared() + rows.norm_squared()) / total).sqrt()
            } else {
                0.0
            }
        };
        let models = EXPONENTS
            .iter()
            .flat_map(|exponent| CUTS.map(|cut| (*exponent, cut)));
        let mut best = (f64::INFINITY, Self::default());
        for (exponent, cut) in models {
            let model = Self { exponent, cut };
            let error = error(&model);
            if error < best.0 {
                best = (error, model);
            }
        }
        best
    }

    /// `f^-1(f(C) f(A)^+ f(R))`, `N x N`, without direct light.
    fn transport(&self, samples: &Samples) -> DMatrix<f64> {
        let crossing = self.kernel(&samples.crossing(), self.exponent);
        let columns = self.kernel(&samples.columns, self.exponent);
        let rows = self.kernel(&samples.rows, self.exponent);
        let factors = crossing.svd(true, true);
        let least = self.cut * factors.singular_values.amax();
        let Ok(inverse) = factors.pseudo_inverse(least) else {
            return DMatrix::zeros(columns.nrows(), columns.nrows());
        };
        let product = columns * inverse * rows.transpose();
        self.kernel(&product, self.exponent.recip())
    }

    /// Element by element; light below zero is noise and becomes none, unless the kernel
    /// is linear.
    fn kernel(&self, matrix: &DMatrix<f64>, exponent: f64) -> DMatrix<f64> {
        if self.exponent >= 1.0 {
            matrix.clone()
        } else {
            matrix.map(|value| value.max(0.0).powf(exponent))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_scenes::{forward, m_scene, rig};
    use super::*;
    use crate::capture::NoiseModel;
    use iltm_runtime::Grid;

    /// Rank 3, smooth, positive; cells 0 and 17 dead.
    fn low_rank(grid: Grid) -> (DMatrix<f64>, Vec<bool>) {
        let cells = grid.cells();
        let live: Vec<bool> = (0..cells).map(|cell| ![0, 17].contains(&cell)).collect();
        let transport = DMatrix::from_fn(cells, cells, |i, j| {
            let (x, y) = (i as f64 / cells as f64, j as f64 / cells as f64);
            let value = 1.0 + x * y + (3.0 * x).sin() * (5.0 * y).cos() * 0.5;
            if live[i] && live[j] { value } else { 0.0 }
        });
        (transport, live)
    }

    #[test]
    fn a_transport_of_low_rank_is_found_from_few_photographs() {
        let grid = Grid::new(9, 7).unwrap();
        let (transport, live) = low_rank(grid);
        let mut rig = rig(grid, &transport, &live, NoiseModel::default());
        let found = forward(&Nystrom::new(40, false), &mut rig);
        assert!((found - &transport).norm() < 1e-9 * transport.norm());
        // Sixteen clusters, and as many rows.
        assert!(rig.photographs() <= 32);
    }

    #[test]
    fn one_cell_is_one_sample() {
        let grid = Grid::new(1, 1).unwrap();
        let transport = DMatrix::from_element(1, 1, 0.4);
        let mut rig = rig(grid, &transport, &[true], NoiseModel::default());
        let found = forward(&Nystrom::new(10, false), &mut rig);
        assert!((found[(0, 0)] - 0.4).abs() < 1e-15);
        assert_eq!(rig.photographs(), 2);
    }

    #[test]
    fn a_diagonal_is_of_full_rank_and_is_missed_unless_separated() {
        let grid = Grid::new(12, 16).unwrap();
        let (transport, live) = m_scene(grid);
        let error = |separated| {
            let mut rig = rig(grid, &transport, &live, NoiseModel::default());
            let found = forward(&Nystrom::new(100, separated), &mut rig);
            assert!(rig.photographs() <= 100);
            (found - &transport).norm() / transport.norm()
        };
        assert!(error(false) > 0.5);
        assert!(error(true) < 0.02);
    }
}
