//! Links: an interreflection operator as what cells get from all the light of blocks of cells
//! together.

use super::quadtree::Quadtree;
use crate::interreflection::Coefficient;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DMatrixView};
use rayon::prelude::*;
use std::sync::Arc;

/// Columns of one task of a product.
const COLUMNS: usize = 16;

fn add<const LANES: usize>(sum: &mut [f64; LANES], value: f64, light: &[f64; LANES]) {
    for (sum, light) in sum.iter_mut().zip(light) {
        *sum += value * light;
    }
}

fn add_all<const LANES: usize>(sum: &mut [f64; LANES], light: &[f64; LANES]) {
    add(sum, 1.0, light);
}

/// A part of all the light of a block of cells together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub(super) block: u32,
    /// Of single precision: a product takes as long as it takes to read the links.
    pub(super) value: f32,
}

/// An operator of `N x N` elements as links between cells and blocks of a quadtree over the
/// grid.
#[derive(Clone, Debug)]
pub struct Links {
    tree: Arc<Quadtree>,
    /// What each cell gets. Links add where their blocks overlap.
    rows: Arc<Vec<Vec<Link>>>,
    /// Whether the rows are columns instead.
    transposed: bool,
}

impl Links {
    pub(crate) fn none(grid: Grid) -> Self {
        Self::new(
            Arc::new(Quadtree::new(grid)),
            vec![Vec::new(); grid.cells()],
        )
    }

    /// One row a cell.
    pub(super) fn new(tree: Arc<Quadtree>, rows: Vec<Vec<Link>>) -> Self {
        Self {
            tree,
            rows: Arc::new(rows),
            transposed: false,
        }
    }

    /// A part of each cell's own light.
    pub(crate) fn diagonal(grid: Grid, parts: &[f64]) -> Self {
        let own = (0..).zip(parts);
        let own = own.map(|(block, value)| {
            vec![Link {
                block,
                value: *value as f32,
            }]
        });
        Self::new(Arc::new(Quadtree::new(grid)), own.collect())
    }

    pub(crate) fn cells(&self) -> usize {
        self.rows.len()
    }

    fn links(&self) -> impl Iterator<Item = &Link> {
        self.rows.iter().flatten().filter(|link| link.value != 0.0)
    }

    pub(crate) fn is_none(&self) -> bool {
        self.links().next().is_none()
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.links().all(|link| link.value.is_finite())
    }

    pub(crate) fn transpose(&self) -> Self {
        Self {
            transposed: !self.transposed,
            ..self.clone()
        }
    }

    pub(crate) fn scale(&mut self, factor: f64) {
        let rows = Arc::make_mut(&mut self.rows);
        for link in rows.iter_mut().flatten() {
            link.value = (f64::from(link.value) * factor) as f32;
        }
    }

    /// Multiplies what each cell gets.
    ///
    /// # Panics
    /// If the operator is transposed.
    pub(crate) fn scale_rows(&mut self, factors: &[f64]) {
        assert!(!self.transposed, "rows are cells");
        for (row, factor) in Arc::make_mut(&mut self.rows).iter_mut().zip(factors) {
            for link in row {
                link.value = (f64::from(link.value) * factor) as f32;
            }
        }
    }

    pub(crate) fn dense(&self) -> DMatrix<f64> {
        let cells = self.cells();
        let mut dense = DMatrix::zeros(cells, cells);
        for (cell, row) in self.rows.iter().enumerate() {
            for link in row.iter().filter(|link| link.value != 0.0) {
                for source in self.tree.cells_of(link.block as usize) {
                    dense[(cell, source)] += f64::from(link.value);
                }
            }
        }
        if self.transposed {
            dense.transpose_mut();
        }
        dense
    }

    /// The sum of both. Links of the same block become one.
    ///
    /// # Panics
    /// If one is of another number of cells, or transposed and the other is not.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        let shape = |links: &Self| (links.cells(), links.transposed);
        assert_eq!(shape(self), shape(other), "operators of one kind");
        let rows = self.rows.par_iter().zip(other.rows.par_iter());
        let rows = rows.map(|(a, b)| {
            let mut links = [a.as_slice(), b.as_slice()].concat();
            links.sort_by_key(|link| link.block);
            let of_block = links.chunk_by(|a, b| a.block == b.block);
            let sum = |links: &[Link]| Link {
                value: links.iter().map(|link| link.value).sum(),
                ..links[0]
            };
            of_block.map(sum).collect()
        });
        self.with_rows(rows.collect())
    }

    /// Rows and columns of these cells alone: blocks that have others as well are split.
    pub(crate) fn between(&self, to: &[bool], from: &[bool]) -> Self {
        let (to, from) = if self.transposed {
            (from, to)
        } else {
            (to, from)
        };
        let mut kept: Vec<usize> = from.iter().map(|from| usize::from(*from)).collect();
        kept.resize(self.tree.blocks(), 0);
        self.tree.sum_cells(&mut kept, |sum, own| *sum += own);
        let whole = |block: usize| kept[block] == self.tree.size(block);
        let rows = self.rows.par_iter().zip(to).map(|(row, to)| {
            let mut own = Vec::new();
            for link in row.iter().filter(|_| *to) {
                let mut blocks = vec![link.block as usize];
                while let Some(block) = blocks.pop() {
                    if whole(block) {
                        own.push(Link {
                            block: block as u32,
                            ..*link
                        });
                    } else if kept[block] > 0 {
                        blocks.extend(self.tree.children(block));
                    }
                }
            }
            own
        });
        self.with_rows(rows.collect())
    }

    fn with_rows(&self, rows: Vec<Vec<Link>>) -> Self {
        Self {
            tree: Arc::clone(&self.tree),
            rows: Arc::new(rows),
            transposed: self.transposed,
        }
    }

    /// The product with `light`, `N x n`.
    pub(crate) fn apply(&self, light: &DMatrix<f64>) -> DMatrix<f64> {
        let mut result = DMatrix::zeros(self.cells(), light.ncols());
        let tasks = result.as_mut_slice().par_chunks_mut(self.cells() * COLUMNS);
        tasks.enumerate().for_each(|(task, part)| {
            let light = light.columns(task * COLUMNS, part.len() / self.cells());
            if light.ncols() == 1 {
                self.apply_to_few::<1>(light, part);
            } else {
                self.apply_to_few::<COLUMNS>(light, part);
            }
        });
        result
    }

    /// The same of at most so many columns, which a processor can take side by side.
    fn apply_to_few<const LANES: usize>(&self, light: DMatrixView<'_, f64>, result: &mut [f64]) {
        let mut blocks = vec![[0.0; LANES]; self.tree.blocks()];
        let of_cell = |cell: usize| {
            let mut lanes = [0.0; LANES];
            for (lane, light) in lanes.iter_mut().zip(light.row(cell).iter()) {
                *lane = *light;
            }
            lanes
        };
        let received: Vec<[f64; LANES]> = if self.transposed {
            for (cell, row) in self.rows.iter().enumerate() {
                let light = of_cell(cell);
                for link in row {
                    add(&mut blocks[link.block as usize], link.value.into(), &light);
                }
            }
            self.tree.spread_to_cells(&mut blocks, add_all);
            blocks
        } else {
            for (cell, block) in blocks[..self.cells()].iter_mut().enumerate() {
                *block = of_cell(cell);
            }
            self.tree.sum_cells(&mut blocks, add_all);
            let rows = self.rows.par_iter().map(|row| {
                let mut sum = [0.0; LANES];
                for link in row {
                    add(&mut sum, link.value.into(), &blocks[link.block as usize]);
                }
                sum
            });
            rows.collect()
        };
        for (lane, column) in result.chunks_exact_mut(self.cells()).enumerate() {
            for (result, received) in column.iter_mut().zip(&received) {
                *result = received[lane];
            }
        }
    }

    /// The elements of `W^T K W` that are not zero.
    pub(crate) fn haar_coefficients(&self) -> Vec<Coefficient> {
        let mut found = super::haar::coefficients(&self.tree, &self.rows);
        if self.transposed {
            for coefficient in &mut found {
                std::mem::swap(&mut coefficient.row, &mut coefficient.col);
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Haar;
    use crate::interreflection::Interreflection;
    use proptest::prelude::*;

    /// Rows of a few links each, which may overlap.
    fn links(rows: u16, cols: u16, seed: u64) -> Links {
        let grid = Grid::new(rows, cols).unwrap();
        let tree = Arc::new(Quadtree::new(grid));
        let mut random = fastrand::Rng::with_seed(seed);
        let blocks = tree.blocks() as u32;
        let rows = (0..grid.cells()).map(|_| {
            let count = random.usize(0..6);
            let link = |_| Link {
                block: random.u32(0..blocks),
                // Sums of few are exact.
                value: f32::from(random.i8(-20..44)) / 64.0,
            };
            (0..count).map(link).collect()
        });
        let rows = rows.collect();
        Links::new(tree, rows)
    }

    #[test]
    fn rows_are_scaled_as_those_of_the_dense_operator() {
        let links = links(3, 5, 8);
        let factors: Vec<f64> = (0..15).map(|cell| f64::from(cell % 4) / 2.0).collect();
        let mut expected = Interreflection::Dense(links.dense());
        let mut scaled = Interreflection::Links(links);
        expected.scale_rows(&factors);
        scaled.scale_rows(&factors);
        assert_eq!(scaled.dense(), expected.dense());
        assert_ne!(scaled.dense().row(1), scaled.dense().row(0));
    }

    /// Numbers without a pattern.
    fn numbers(rows: usize, cols: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, cols, |i, j| {
            ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn links_are_the_operator_that_their_elements_are(
            rows in 1_u16..=9,
            cols in 1_u16..=9,
            seed: u64,
            transposed: bool,
        ) {
            let (mut links, other) = (self::links(rows, cols, seed), self::links(rows, cols, seed ^ 1));
            let dense = links.dense();
            let sum = links.plus(&other).dense() - &dense - other.dense();
            prop_assert!(sum.amax() < 1e-12);
            let mut dense = dense;
            if transposed {
                (links, dense) = (links.transpose(), dense.transpose());
                prop_assert_eq!(&links.dense(), &dense);
            }
            let cells = links.cells();
            let light = numbers(cells, COLUMNS + 3);
            prop_assert!((links.apply(&light) - &dense * &light).amax() < 1e-12);
            let mut random = fastrand::Rng::with_seed(seed);
            let mut some = || (0..cells).map(|_| random.u8(..) < 180).collect::<Vec<bool>>();
            let (to, from) = (some(), some());
            let between = links.between(&to, &from).dense();
            for ((row, col), value) in (0..cells * cells).map(|at| (at % cells, at / cells)).zip(&between) {
                let wanted = if to[row] && from[col] { dense[(row, col)] } else { 0.0 };
                prop_assert!((value - wanted).abs() < 1e-12);
            }
            links.scale(-0.5);
            prop_assert!((links.dense() + &dense * 0.5).amax() < 1e-12);
        }

        #[test]
        fn haar_coefficients_of_links_are_those_of_their_elements(
            rows in 1_u16..=9,
            cols in 1_u16..=9,
            seed: u64,
            transposed: bool,
        ) {
            let links = links(rows, cols, seed);
            let links = if transposed { links.transpose() } else { links };
            let haar = Haar::new(Grid::new(rows, cols).unwrap());
            let mut left = haar.analyse_operator(&links.dense());
            for coefficient in Interreflection::Links(links).haar_coefficients(&haar) {
                left[(coefficient.row as usize, coefficient.col as usize)] -= coefficient.value;
            }
            prop_assert!(left.amax() < 1e-12, "{left}");
        }
    }
}
