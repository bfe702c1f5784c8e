//! Kernel Nystrom: a transport of low rank from some of its columns and rows.

mod clusters;
mod fit;
mod separation;

use super::Acquisition;
use crate::{Acquired, Citation, Description, Rig, Unfit};
use clusters::ClusterSamples;
use fit::{DirectAndGlobal, KernelModel};
use nalgebra::DMatrix;
use separation::{PHOTOGRAPHS, Separation};

/// More samples have to lower the predicted error by this factor, or they are in vain;
const SETTLED: f64 = 0.9;
/// after so many doublings in vain the error has settled, and they are left out.
const PATIENCE: usize = 2;
/// Photographs of the least number of samples.
const LEAST: usize = 2;

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
    fn description(&self) -> Description {
        let Self { photographs, .. } = self;
        Description {
            name: if self.separated {
                format!("kernel Nystrom, direct light apart, up to {photographs}")
            } else {
                format!("kernel Nystrom, up to {photographs}")
            },
            source: Citation {
                authors: "Wang, Dong, Tong, Lin, Guo",
                title: "Kernel Nystrom Method for Light Transport",
                venue: "ACM Transactions on Graphics (SIGGRAPH)",
                year: 2009,
            },
            how: if self.separated {
                "Each cell's own light by patterns as fine as cells (Nayar and others, 2006); the \
                 rest, smooth and of low rank, from clusters of cells lit alone. Needs a second \
                 projector and camera in each other's places."
            } else {
                "Clusters of cells lit alone, forwards and with projector and camera exchanged: \
                 columns and rows that all others are made of if the rank is low. Needs a second \
                 projector and camera in each other's places, and fails where cells have light of \
                 their own, which is of full rank."
            },
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let live = rig.live_cells();
        if live.is_empty() {
            return Err(Unfit::Condition("0 cells are live".to_owned()));
        }
        let (transport, error) = self.sample(rig)?;
        let part = transport.select_rows(&live).select_columns(&live);
        let values = part.singular_values();
        let least = values.min() / values.max();
        // Not a number is no inverse either.
        let invertible = least > error;
        if !invertible {
            return Err(Unfit::Condition(format!(
                "what {} photographs make up predicts further ones to within {:.0} %, and its \
                 smallest singular value is {least:.3} of its largest: whether there is an \
                 inverse cannot be told",
                rig.photographs(),
                100.0 * error,
            )));
        }
        Ok(Acquired::Forward(transport))
    }
}

impl Nystrom {
    /// `T`, `N x N`, and the relative error with which it predicts further samples; zero
    /// if there was none to predict.
    fn sample(&self, rig: &mut Rig) -> Result<(DMatrix<f64>, f64), Unfit> {
        let least = LEAST + if self.separated { PHOTOGRAPHS } else { 0 };
        if self.photographs < least {
            return Err(Unfit::Condition(format!(
                "{} photographs; the least is {least}",
                self.photographs
            )));
        }
        let separation = self.separated.then(|| Separation::take(rig));
        let mut samples = ClusterSamples::first(rig);
        let mut best = (
            None,
            DirectAndGlobal::new(&samples, KernelModel::default(), separation.as_ref()),
        );
        let mut in_vain = 0;
        while samples.clusters.splits() > 0
            && rig.photographs() + 2 * samples.clusters.splits() <= self.photographs
            && in_vain < PATIENCE
        {
            let next = samples.halved(rig);
            let (error, model) = if next.clusters.splits() == 0 {
                // Every cell alone: nothing is left to predict.
                (0.0, KernelModel::default())
            } else {
                KernelModel::best(|model| {
                    DirectAndGlobal::new(&samples, *model, separation.as_ref()).error(&next)
                })
            };
            samples = next;
            if best.0.is_none_or(|before| error < SETTLED * before) {
                best = (
                    Some(error),
                    DirectAndGlobal::new(&samples, model, separation.as_ref()),
                );
                in_vain = 0;
            } else {
                in_vain += 1;
            }
        }
        Ok((best.1.transport(rig.live()), best.0.unwrap_or(0.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::{forward, m_scene, rig};
    use iltm_capture::NoiseModel;
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
        let (found, error) = Nystrom::new(40, false).sample(&mut rig).unwrap();
        assert!((found - &transport).norm() < 1e-9 * transport.norm());
        assert!(error < 1e-9);
        // Sixteen clusters, and as many rows.
        assert!(rig.photographs() <= 32);
    }

    /// Direct light of any texture beside light of low rank.
    #[test]
    fn direct_light_beside_light_of_low_rank_is_told_from_it() {
        let grid = Grid::new(9, 7).unwrap();
        let (other, live) = low_rank(grid);
        let transport = DMatrix::from_fn(63, 63, |i, j| {
            let own = if i == j && live[i] {
                0.2 + (i * i % 7) as f64
            } else {
                0.0
            };
            own + other[(i, j)] / 63.0
        });
        let mut rig = rig(grid, &transport, &live, NoiseModel::default());
        let found = forward(&Nystrom::new(46, true), &mut rig);
        assert!((found - &transport).norm() < 0.01 * transport.norm());
        assert!(rig.photographs() <= 46);
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
    fn a_diagonal_is_of_full_rank_and_is_refused_unless_separated() {
        let grid = Grid::new(12, 16).unwrap();
        let (transport, live) = m_scene(grid);
        let rig = || rig(grid, &transport, &live, NoiseModel::default());
        let refused = Nystrom::new(100, false).acquire(&mut rig());
        assert!(matches!(refused, Err(Unfit::Condition(why)) if why.contains("singular value")));
        let found = forward(&Nystrom::new(100, true), &mut rig());
        let off = (found - &transport).norm() / transport.norm();
        // Light of others is 6 % of the transport, more than that beside the folds, where
        // it is as fine as cells.
        assert!(off < 0.06, "{off}");
    }
}
