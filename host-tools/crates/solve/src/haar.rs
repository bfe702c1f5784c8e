//! The orthonormal Haar basis of a grid of any size, in floating point.
//!
//! `W` is `N x N` with one basis function a column, `W^T W = I`. It merges rows and
//! columns in turn, level by level (a quad-tree, the non-standard basis): it is the runtime's integer one with each function scaled to unit norm,
//! numbered in the same order (`iltm_runtime::haar`): finest level first, node
//! by node along the rows, in a node the split of the columns, of the rows and
//! of both, the constant last.
//!
//! Merging two nodes of `a` and `b` cells turns their normalised sums `x`, `y`
//! into `(sqrt(a) x + sqrt(b) y, sqrt(b) x - sqrt(a) y) / sqrt(a + b)`: a plane
//! rotation with a reflection, hence its own inverse. A basis is a list of
//! those; it needs no padding, so a 13 x 21 grid has 273 coefficients.
//!
//! The iterations transform every row and every column of an `N x N` matrix. Done
//! sixteen at a time (a [`Pack`]), each rotation is a handful of vector instructions
//! and its two indices are read once for sixteen numbers.

use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// One merge of two values in place: the sum replaces the first, the detail the
/// second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rotation {
    first: u32,
    second: u32,
    cos: f64,
    sin: f64,
}

/// The orthonormal Haar basis of one grid.
#[derive(Clone, Debug)]
pub struct Haar {
    grid: Grid,
    rotations: Vec<Rotation>,
    /// Where a transform in place leaves each coefficient.
    places: Vec<u32>,
    /// Steps finer than the coarsest detail, by coefficient.
    fineness: Vec<f64>,
}

impl Haar {
    /// The basis of `grid`.
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        let mut haar = Self {
            grid,
            rotations: Vec::new(),
            places: Vec::with_capacity(grid.cells()),
            fineness: Vec::with_capacity(grid.cells()),
        };
        haar.build_quad_tree();
        haar
    }

    /// The grid it is the basis of.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// How many merges finer than the coarsest detail each coefficient is,
    /// length `N`; 0 for the constant.
    #[must_use]
    pub fn fineness(&self) -> &[f64] {
        &self.fineness
    }

    /// `W^T x` of an image of `N` cells.
    ///
    /// # Panics
    /// If `cells` has fewer than `N` elements.
    #[must_use]
    pub fn analyse(&self, cells: &DVector<f64>) -> DVector<f64> {
        let mut image = cells.clone();
        self.analyse_in_place(image.as_mut_slice());
        DVector::from_fn(self.places.len(), |k, _| image[self.places[k] as usize])
    }

    /// `W z` of `N` coefficients.
    ///
    /// # Panics
    /// If `coefficients` has fewer than `N` elements.
    #[must_use]
    pub fn synthesise(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        let mut image = DVector::zeros(self.places.len());
        for (place, value) in self.places.iter().zip(coefficients.iter()) {
            image[*place as usize] = *value;
        }
        self.synthesise_in_place(image.as_mut_slice());
        image
    }

    /// `W^T X` of a matrix with one image of `N` cells a column.
    ///
    /// # Panics
    /// If `images` has fewer than `N` rows.
    #[must_use]
    pub fn analyse_columns(&self, images: &DMatrix<f64>) -> DMatrix<f64> {
        self.by_column(images, |from, image, to| {
            image.copy_from_slice(from);
            self.analyse_in_place(image);
            for (value, place) in to.iter_mut().zip(&self.places) {
                *value = image[*place as usize];
            }
        })
    }

    /// `W Z` of a matrix with one image's coefficients a column.
    ///
    /// # Panics
    /// If `coefficients` has fewer than `N` rows.
    #[must_use]
    pub fn synthesise_columns(&self, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
        self.by_column(coefficients, |from, image, to| {
            for (value, place) in from.iter().zip(&self.places) {
                image[*place as usize] = *value;
            }
            self.synthesise_in_place(image);
            to.copy_from_slice(image);
        })
    }

    /// `W^T K W` of an `N x N` operator on images.
    ///
    /// # Panics
    /// If `operator` is smaller than `N x N`.
    #[must_use]
    pub fn analyse_operator(&self, operator: &DMatrix<f64>) -> DMatrix<f64> {
        self.analyse_columns(&self.analyse_columns(operator).transpose())
            .transpose()
    }

    /// `W K^ W^T`: the inverse of [`Self::analyse_operator`].
    ///
    /// # Panics
    /// If `coefficients` is smaller than `N x N`.
    #[must_use]
    pub fn synthesise_operator(&self, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
        self.synthesise_columns(&self.synthesise_columns(coefficients).transpose())
            .transpose()
    }

    fn by_column(
        &self,
        from: &DMatrix<f64>,
        transform: impl Fn(&[f64], &mut [f64], &mut [f64]) + Sync,
    ) -> DMatrix<f64> {
        let cells = self.places.len();
        let mut to = DMatrix::zeros(cells, from.ncols());
        to.as_mut_slice()
            .par_chunks_mut(cells)
            .zip(from.as_slice().par_chunks(from.nrows()))
            .for_each_init(
                || vec![0.0; cells],
                |image, (to, from)| transform(&from[..cells], image, to),
            );
        to
    }

    /// `W^T x` with the coefficients where the merges leave them: coefficient
    /// `k` at `places()[k]`.
    pub(super) fn analyse_in_place<T: Lane>(&self, image: &mut [T]) {
        for rotation in &self.rotations {
            rotate(image, rotation);
        }
    }

    /// The inverse of [`Self::analyse_in_place`].
    pub(super) fn synthesise_in_place<T: Lane>(&self, image: &mut [T]) {
        for rotation in self.rotations.iter().rev() {
            rotate(image, rotation);
        }
    }

    /// Where [`Self::analyse_in_place`] leaves each coefficient.
    pub(super) fn places(&self) -> &[u32] {
        &self.places
    }

    fn build_quad_tree(&mut self) {
        let cols = self.grid.cols();
        let mut levels = 0;
        let (mut row_nodes, mut col_nodes) = (nodes(self.grid.rows()), nodes(cols));
        while row_nodes.len() > 1 || col_nodes.len() > 1 {
            for rows in row_nodes.chunks(2) {
                for columns in col_nodes.chunks(2) {
                    self.merge(rows, columns, cols, levels);
                }
            }
            (row_nodes, col_nodes) = (merged(&row_nodes), merged(&col_nodes));
            levels += 1;
        }
        self.places.push(0);
        // Until now a level number; the constant counts with the coarsest.
        self.fineness.push(f64::from(levels - 1));
        for fineness in &mut self.fineness {
            *fineness = f64::from(levels - 1) - *fineness;
        }
    }

    /// Merges one node of the quad-tree, whose halves are one or two nodes along
    /// each axis.
    fn merge(&mut self, rows: &[Node], columns: &[Node], cols: usize, level: i32) {
        let place = |row: &Node, column: &Node| (row.start * cols + column.start) as u32;
        if let [left, right] = columns {
            for row in rows {
                self.rotation(place(row, left), place(row, right), left.cells, right.cells);
            }
            self.emit(place(&rows[0], right), level);
        }
        if let [top, bottom] = rows {
            for column in columns {
                let (first, second) = (place(top, column), place(bottom, column));
                self.rotation(first, second, top.cells, bottom.cells);
            }
            for column in columns {
                self.emit(place(bottom, column), level);
            }
        }
    }

    fn rotation(&mut self, first: u32, second: u32, first_cells: usize, second_cells: usize) {
        let cells = (first_cells + second_cells) as f64;
        self.rotations.push(Rotation {
            first,
            second,
            cos: (first_cells as f64 / cells).sqrt(),
            sin: (second_cells as f64 / cells).sqrt(),
        });
    }

    fn emit(&mut self, place: u32, level: i32) {
        self.places.push(place);
        self.fineness.push(f64::from(level));
    }
}

#[inline]
fn rotate<T: Lane>(image: &mut [T], by: &Rotation) {
    let (first, second) = (by.first as usize, by.second as usize);
    let (sum, detail) = T::rotate(image[first], image[second], by);
    image[first] = sum;
    image[second] = detail;
}

/// Images that a [`Pack`] holds.
pub(super) const LANES: usize = 16;

/// One pixel of [`LANES`] images: a cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct Pack(pub(super) [f32; LANES]);

impl Pack {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
}

/// A value that a plane rotation can be applied to.
pub(super) trait Lane: Copy {
    /// `(cos a + sin b, sin a - cos b)`; its own inverse.
    fn rotate(a: Self, b: Self, by: &Rotation) -> (Self, Self);
}

impl Lane for f64 {
    #[inline]
    fn rotate(a: Self, b: Self, by: &Rotation) -> (Self, Self) {
        (by.cos * a + by.sin * b, by.sin * a - by.cos * b)
    }
}

impl Lane for Pack {
    #[inline]
    fn rotate(a: Self, b: Self, by: &Rotation) -> (Self, Self) {
        let (cos, sin) = (by.cos as f32, by.sin as f32);
        let (mut sum, mut detail) = (a, b);
        for lane in 0..LANES {
            sum.0[lane] = cos * a.0[lane] + sin * b.0[lane];
            detail.0[lane] = sin * a.0[lane] - cos * b.0[lane];
        }
        (sum, detail)
    }
}

/// Exchanges images and pixels of a square tile.
#[inline]
pub(super) fn transpose(tile: &[Pack; LANES]) -> [Pack; LANES] {
    let mut turned = [Pack::ZERO; LANES];
    for (row, pack) in tile.iter().enumerate() {
        for (col, value) in pack.0.iter().enumerate() {
            turned[col].0[row] = *value;
        }
    }
    turned
}

/// Adjacent cells of one axis, merged; its sum stands in its first cell.
#[derive(Clone, Copy, Debug)]
struct Node {
    start: usize,
    cells: usize,
}

fn nodes(cells: usize) -> Vec<Node> {
    (0..cells).map(|start| Node { start, cells: 1 }).collect()
}

fn merged(nodes: &[Node]) -> Vec<Node> {
    let merge = |pair: &[Node]| Node {
        start: pair[0].start,
        cells: pair.iter().map(|node| node.cells).sum(),
    };
    nodes.chunks(2).map(merge).collect()
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Zero and one are exact.
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid(rows: u16, cols: u16) -> Grid {
        Grid::new(rows, cols).unwrap()
    }

    /// `W`, column by column.
    fn matrix(haar: &Haar) -> DMatrix<f64> {
        let cells = haar.grid().cells();
        haar.synthesise_columns(&DMatrix::identity(cells, cells))
    }

    #[test]
    fn a_row_of_three_merges_two_cells_and_then_the_odd_one() {
        let w = matrix(&Haar::new(grid(1, 3)));
        let (half, sixth, third) = (
            0.5_f64.sqrt(),
            (1.0_f64 / 6.0).sqrt(),
            (1.0_f64 / 3.0).sqrt(),
        );
        let expected = DMatrix::from_row_slice(
            3,
            3,
            &[
                half,
                sixth,
                third, //
                -half,
                sixth,
                third, //
                0.0,
                -2.0 * sixth,
                third,
            ],
        );
        assert!((w - expected).amax() < 1e-15);
    }

    #[test]
    fn a_node_emits_columns_then_rows_then_both() {
        let w = matrix(&Haar::new(grid(2, 2))) * 2.0;
        let expected = DMatrix::from_row_slice(
            4,
            4,
            &[
                1.0, 1.0, 1.0, 1.0, //
                -1.0, 1.0, -1.0, 1.0, //
                1.0, -1.0, -1.0, 1.0, //
                -1.0, -1.0, 1.0, 1.0,
            ],
        );
        assert!((w - expected).amax() < 1e-15);
    }

    #[test]
    fn a_single_cell_is_its_own_coefficient() {
        let haar = Haar::new(grid(1, 1));
        assert_eq!(haar.analyse(&DVector::from_element(1, 0.3))[0], 0.3);
        assert_eq!(haar.fineness(), [0.0]);
    }

    #[test]
    fn thirteen_by_twenty_one_has_five_levels() {
        let haar = Haar::new(grid(13, 21));
        let count = |level: f64| haar.fineness().iter().filter(|l| **l == level).count();
        // 13 x 21 -> 7 x 11 -> 4 x 6 -> 2 x 3 -> 1 x 2 -> 1 x 1.
        assert_eq!([4.0, 3.0, 2.0, 1.0, 0.0].map(count), [196, 53, 18, 4, 2]);
    }

    #[test]
    fn an_operator_survives_both_transforms() {
        let haar = Haar::new(grid(3, 5));
        let operator = DMatrix::from_fn(15, 15, |i, j| ((i * 31 + j * 17) % 23) as f64);
        let w = matrix(&haar);
        let coefficients = haar.analyse_operator(&operator);
        assert!((&coefficients - w.transpose() * &operator * &w).amax() < 1e-12);
        assert!((haar.synthesise_operator(&coefficients) - operator).amax() < 1e-12);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn every_grid_has_an_orthonormal_basis(rows in 1_u16..=16, cols in 1_u16..=16) {
            let w = matrix(&Haar::new(grid(rows, cols)));
            let n = w.ncols();
            prop_assert!((w.transpose() * &w - DMatrix::identity(n, n)).amax() < 1e-13);
        }

        #[test]
        fn synthesis_undoes_analysis_up_to_64_x_64(rows in 1_u16..=64, cols in 1_u16..=64, seed: u32) {
            let haar = Haar::new(grid(rows, cols));
            let mut state = u64::from(seed);
            let image = DVector::from_fn(haar.grid().cells(), |_, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 33) as f64 / f64::from(1_u32 << 31)
            });
            let coefficients = haar.analyse(&image);
            prop_assert!((coefficients.norm() - image.norm()).abs() < 1e-12 * image.norm());
            prop_assert!((haar.synthesise(&coefficients) - image).amax() < 1e-13);
        }

        #[test]
        fn only_the_constant_sees_a_uniform_image(rows in 1_u16..=64, cols in 1_u16..=64) {
            let haar = Haar::new(grid(rows, cols));
            let n = haar.grid().cells();
            let coefficients = haar.analyse(&DVector::from_element(n, 1.0));
            prop_assert!(coefficients.rows(0, n - 1).amax() < 1e-12);
            prop_assert!((coefficients[n - 1] - (n as f64).sqrt()).abs() < 1e-11);
        }
    }
}
