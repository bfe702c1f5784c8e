//! Compressive dual photography and compressive light transport sensing: random patterns,
//! decoded greedily row by row, or from coarse to fine.

use super::Acquisition;
use super::greedy::SparseEstimate;
use super::sensing::HaarSensing;
use crate::{Acquired, Citation, Description, Rig, Unfit};
use iltm_solve::Haar;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Sen and Darabi's paper, which two ways to photograph share: this greedy one and the
/// solver's two-stage method by l1.
pub(super) const SEN_DARABI: Citation = Citation {
    authors: "Sen, Darabi",
    title: "Compressive Dual Photography",
    venue: "Computer Graphics Forum (Eurographics)",
    year: 2009,
};

/// Bernoulli patterns, each row of the doubly transformed transport by regularised
/// orthogonal matching pursuit on its own.
///
/// The paper transforms the projector's side; the camera's side as well is what the
/// comparison asks for, and what makes rows sparse together. Its number of coefficients
/// is set by hand; here photographs held out choose it row by row.
#[derive(Clone, Copy, Debug)]
pub struct CompressiveDual {
    photographs: usize,
    seed: u64,
}

impl CompressiveDual {
    /// On so many photographs, white among them; `seed` chooses the patterns.
    #[must_use]
    pub const fn new(photographs: usize, seed: u64) -> Self {
        Self { photographs, seed }
    }
}

impl Acquisition for CompressiveDual {
    fn description(&self) -> Description {
        Description {
            name: format!("compressive dual photography by ROMP, {}", self.photographs),
            source: SEN_DARABI,
            how: "White and Bernoulli photographs; each row of the transport, Haar-coded on both \
                sides, is built up coefficient by coefficient, those first that explain most \
                (regularised orthogonal matching pursuit); then the transport is inverted.",
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let sensing = HaarSensing::take(rig, self.photographs, self.seed)?;
        let rows = 0..rig.grid().cells();
        let responses: Vec<_> = rows
            .into_par_iter()
            .map(|row| sensing.decode(row, &[]))
            .collect();
        Ok(Acquired::Forward(sensing.transport(&responses, rig.live())))
    }
}

/// Coefficients that a child is told to look at first, as a part of the photographs.
const PREDICTED: usize = 8;

/// Bernoulli patterns, the camera's Haar coefficients decoded level by level.
///
/// Cells that lie together are lit alike: what the camera's coarse coefficients answer to
/// says where to look for those of the finer ones in the same place. From the paper: the
/// hierarchy over camera pixels, a parent's solution as prediction of its children's, a
/// greedy solver. Ours: a row of the doubly transformed transport in place of what a pixel
/// differs by from its parent; the prediction is the largest coefficients of all parents,
/// the number of coefficients chosen by photographs held out; plain Bernoulli patterns.
#[derive(Clone, Copy, Debug)]
pub struct CompressiveSensing {
    photographs: usize,
    seed: u64,
}

impl CompressiveSensing {
    /// On so many photographs, white among them; `seed` chooses the patterns.
    #[must_use]
    pub const fn new(photographs: usize, seed: u64) -> Self {
        Self { photographs, seed }
    }
}

impl Acquisition for CompressiveSensing {
    fn description(&self) -> Description {
        Description {
            name: format!("compressive light transport sensing, {}", self.photographs),
            source: Citation {
                authors: "Peers, Mahajan, Lamond, Ghosh, Matusik, Ramamoorthi, Debevec",
                title: "Compressive Light Transport Sensing",
                venue: "ACM Transactions on Graphics",
                year: 2009,
            },
            how: "White and Bernoulli photographs; the transport, Haar-coded on both sides, is \
                decoded from the camera's coarse coefficients to its fine ones, each greedily, \
                looking first where its coarser neighbours found something; then the transport is \
                inverted.",
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let sensing = HaarSensing::take(rig, self.photographs, self.seed)?;
        let tree = Tree::new(&sensing.haar);
        let most = (self.photographs / PREDICTED).max(1);
        let mut responses = vec![SparseEstimate::default(); rig.grid().cells()];
        for level in tree.levels() {
            let decode = |coefficient: &usize| {
                let parents = tree.parents[*coefficient].iter();
                let predicted = predict(parents.map(|parent| &responses[*parent]), most);
                sensing.decode(*coefficient, &predicted)
            };
            let decoded: Vec<_> = level.par_iter().map(decode).collect();
            for (coefficient, response) in level.into_iter().zip(decoded) {
                responses[coefficient] = response;
            }
        }
        Ok(Acquired::Forward(sensing.transport(&responses, rig.live())))
    }
}

/// The support of the parents' largest values, at most `most`.
fn predict<'e>(parents: impl Iterator<Item = &'e SparseEstimate>, most: usize) -> Vec<usize> {
    let mut entries: Vec<(usize, f64)> = parents
        .flat_map(|parent| {
            parent
                .support
                .iter()
                .copied()
                .zip(parent.values.iter().copied())
        })
        .collect();
    entries.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let mut support = Vec::new();
    for (column, _) in entries {
        if support.len() < most && !support.contains(&column) {
            support.push(column);
        }
    }
    support
}

/// The Haar basis of a grid as a tree.
struct Tree {
    /// Coarser functions at the same place, by coefficient: those of the next coarser
    /// level that has any; none of the constant's.
    parents: Vec<Vec<usize>>,
    /// Level of each coefficient, 0 for the constant.
    depth: Vec<usize>,
}

impl Tree {
    fn new(haar: &Haar) -> Self {
        let cells = haar.grid().cells();
        let functions = haar.synthesise_columns(&DMatrix::identity(cells, cells));
        // The constant is last, and a level of its own.
        let depth: Vec<usize> = (0..cells)
            .map(|k| {
                if k + 1 == cells {
                    0
                } else {
                    1 + haar.fineness()[k] as usize
                }
            })
            .collect();
        let parents = (0..cells)
            .map(|child| {
                let place = functions
                    .column(child)
                    .iter()
                    .position(|value| *value != 0.0);
                let above = |other: &usize| {
                    let there = place.is_some_and(|place| functions[(place, *other)] != 0.0);
                    depth[*other] < depth[child] && there
                };
                let above: Vec<usize> = (0..cells).filter(above).collect();
                let nearest = above.iter().map(|other| depth[*other]).max();
                let near = above
                    .into_iter()
                    .filter(|other| Some(depth[*other]) == nearest);
                near.collect()
            })
            .collect();
        Self { parents, depth }
    }

    /// Coefficients level by level, coarse to fine.
    fn levels(&self) -> Vec<Vec<usize>> {
        let deepest = self.depth.iter().max().map_or(0, |depth| depth + 1);
        let at = |level| (0..self.depth.len()).filter(move |k| self.depth[*k] == level);
        (0..deepest).map(|level| at(level).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::Grid;

    #[test]
    fn every_coefficient_but_the_constant_has_a_coarser_one_at_its_place() {
        for (rows, cols) in [(1, 1), (1, 6), (5, 7), (13, 21)] {
            let grid = Grid::new(rows, cols).unwrap();
            let tree = Tree::new(&Haar::new(grid));
            let last = grid.cells() - 1;
            for child in 0..last {
                assert!(!tree.parents[child].is_empty());
                for parent in &tree.parents[child] {
                    assert!(tree.depth[*parent] < tree.depth[child]);
                }
            }
            assert!(tree.parents[last].is_empty());
            let levels = tree.levels();
            assert_eq!(levels[0], [last]);
            assert_eq!(levels.concat().len(), grid.cells());
        }
    }

    #[test]
    fn a_prediction_is_the_parents_largest_coefficients_each_once() {
        let parent = |support: &[usize], values: &[f64]| SparseEstimate {
            support: support.to_vec(),
            values: values.to_vec(),
        };
        let parents = [
            parent(&[3, 5], &[0.1, -4.0]),
            parent(&[5, 7, 9], &[1.0, 2.0, 0.05]),
        ];
        assert_eq!(predict(parents.iter(), 3), [5, 7, 3]);
    }
}
