//! The transform against its definition, on every size up to 64 x 64.

use super::*;
use crate::Grid;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

fn basis(rows: u16, cols: u16) -> Basis {
    Basis::new(Grid::new(rows, cols).expect("a small grid"))
}

/// Two buffers for a transform.
fn buffers<T: Clone + Default>(basis: &Basis) -> [Vec<T>; 2] {
    [(); 2].map(|()| vec![T::default(); basis.scratch_len()])
}

fn analysed<T: Coefficient + Default>(basis: &Basis, cells: &[i32]) -> Vec<T> {
    let [mut a, mut b] = buffers(basis);
    let mut coefficients = vec![T::default(); cells.len()];
    let source = Cells {
        values: cells,
        cols: basis.grid().cols(),
    };
    analyse(basis, &source, [&mut a, &mut b], &mut coefficients).expect("slices are long enough");
    coefficients
}

fn exact(basis: &Basis, cells: &[i32]) -> Vec<i64> {
    analysed(basis, cells)
}

fn synthesised(basis: &Basis, z: &[i32]) -> Vec<i32> {
    let [mut a, mut b] = buffers(basis);
    let mut cells = vec![0; z.len()];
    synthesise(basis, z, [&mut a, &mut b], &mut cells).expect("slices are long enough");
    cells
}

/// `S` by its definition, `N x N`, row-major by cell.
fn dense(basis: &Basis) -> Vec<Vec<i64>> {
    let functions: Vec<_> = basis.functions().collect();
    let (rows, cols) = (basis.grid().rows(), basis.grid().cols());
    (0..rows * cols)
        .map(|cell| {
            let at = |f: &Function| f.at(cell / cols, cell % cols);
            functions.iter().map(at).collect()
        })
        .collect()
}

fn grid_and_cells() -> impl Strategy<Value = (u16, u16, Vec<i32>)> {
    (1_u16..=64, 1_u16..=64).prop_flat_map(|(rows, cols)| {
        let count = usize::from(rows) * usize::from(cols);
        (
            Just(rows),
            Just(cols),
            prop::collection::vec(0..=32_768, count),
        )
    })
}

proptest! {
    #[test]
    fn reconstruction_returns_every_cell((rows, cols, cells) in grid_and_cells()) {
        let basis = basis(rows, cols);
        let coefficients = exact(&basis, &cells);
        prop_assert_eq!(coefficients.len(), cells.len());
        let mut back = vec![0; cells.len()];
        let [mut a, mut b] = buffers(&basis);
        reconstruct(&basis, &coefficients, &mut back, [&mut a, &mut b]).expect("slices are long enough");
        prop_assert!(cells.iter().zip(&back).all(|(&cell, &back)| i64::from(cell) == back));
    }

    #[test]
    fn coefficients_stay_within_the_functions_positive_mass((rows, cols, cells) in grid_and_cells()) {
        let basis = basis(rows, cols);
        for (coefficient, function) in exact(&basis, &cells).into_iter().zip(basis.functions()) {
            let limit = function.positive_mass() << 15;
            prop_assert!(coefficient.unsigned_abs() <= limit);
            prop_assert!(limit >> function.input_shift() <= u64::from(crate::units::INPUT_COEFFICIENT_MAX));
        }
    }

    #[test]
    fn rounding_is_to_nearest((rows, cols, cells) in grid_and_cells()) {
        let basis = basis(rows, cols);
        let rounded: Vec<i16> = analysed(&basis, &cells);
        let exact = exact(&basis, &cells).into_iter().zip(basis.functions());
        for ((coefficient, function), rounded) in exact.zip(rounded) {
            let step = 1_i64 << function.input_shift();
            prop_assert!((2 * (coefficient - i64::from(rounded) * step)).abs() <= step);
        }
    }

    #[test]
    fn synthesis_is_the_transpose_of_analysis(
        (rows, cols, cells) in grid_and_cells(), seed in any::<u64>()
    ) {
        // <S^T x, z> = <x, S z> for the transform and for random small z.
        let basis = basis(rows, cols);
        let mut state = seed | 1;
        let z: Vec<i32> = cells.iter().map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as i32 & 0x1FF) - 256
        }).collect();
        let synthesised = synthesised(&basis, &z);
        let left: i128 = exact(&basis, &cells).iter().zip(&z).map(|(&h, z)| i128::from(h) * i128::from(*z)).sum();
        let right: i128 = cells.iter().zip(&synthesised).map(|(&x, &s)| i128::from(x) * i128::from(s)).sum();
        prop_assert_eq!(left, right);
    }
}

#[test]
fn analysis_and_synthesis_equal_the_dense_matrix() {
    for (rows, cols) in [
        (1, 1),
        (1, 2),
        (3, 1),
        (2, 2),
        (5, 7),
        (13, 21),
        (8, 8),
        (1, 33),
    ] {
        let basis = basis(rows, cols);
        let matrix = dense(&basis);
        let count = matrix.len();
        for cell in 0..count {
            let mut impulse = vec![0; count];
            impulse[cell] = 1;
            assert_eq!(
                exact(&basis, &impulse),
                matrix[cell],
                "{rows} x {cols}, cell {cell}"
            );
            let mut z = vec![0; count];
            z[cell] = 1;
            let cells = synthesised(&basis, &z);
            let column: Vec<i64> = matrix.iter().map(|row| row[cell]).collect();
            assert!(column.iter().zip(&cells).all(|(&a, &b)| a == i64::from(b)));
        }
    }
}

#[test]
fn functions_are_orthogonal_with_the_stated_norms_and_peaks() {
    for rows in 1..=9 {
        for cols in [1, 2, 3, 5, 8, 11] {
            let basis = basis(rows, cols);
            let matrix = dense(&basis);
            for (i, f) in basis.functions().enumerate() {
                for (j, _) in basis.functions().enumerate() {
                    let product: i64 = matrix.iter().map(|row| row[i] * row[j]).sum();
                    let expected = if i == j { f.squared_norm() as i64 } else { 0 };
                    assert_eq!(product, expected, "{rows} x {cols}: {i}, {j}");
                }
                let column = || matrix.iter().map(|row| row[i]);
                assert_eq!(column().map(i64::unsigned_abs).max(), Some(f.peak()));
                let positive: i64 = column().filter(|v| *v > 0).sum();
                assert_eq!(positive as u64, f.positive_mass());
            }
        }
    }
}

#[test]
fn every_size_up_to_64_has_as_many_functions_as_cells() {
    for rows in 1..=64 {
        for cols in 1..=64 {
            let basis = basis(rows, cols);
            assert_eq!(
                basis.functions().count(),
                usize::from(rows) * usize::from(cols)
            );
        }
    }
}

#[test]
fn the_longest_grids_have_a_basis_without_overflow() {
    for (rows, cols) in [(1, 32_767), (32_767, 1), (181, 181), (127, 255), (128, 256)] {
        let basis = basis(rows, cols);
        let count = basis.grid().cells();
        let coefficients = exact(&basis, &vec![32_768; count]);
        assert_eq!(
            *coefficients.last().expect("at least one"),
            (count as i64) << 15
        );
        assert!(coefficients[..count - 1].iter().all(|&detail| detail == 0));
        for (f, _) in basis.functions().zip(0..) {
            assert!(f.input_shift() < 63);
        }
    }
}

#[test]
fn short_slices_are_refused() {
    let basis = basis(4, 4);
    let cells = [0; 16];
    let mut coefficients = [0_i64; 16];
    let [mut a, mut b] = [[0; 4], [0; 4]];
    let cells = Cells {
        values: &cells,
        cols: 4,
    };
    let error =
        analyse(&basis, &cells, [&mut a, &mut b], &mut coefficients[1..]).expect_err("short");
    assert_eq!(
        (error.what, error.needed, error.given),
        ("coefficient", 16, 15)
    );
    let error =
        analyse(&basis, &cells, [&mut a, &mut b[1..]], &mut coefficients).expect_err("short");
    assert_eq!(
        (error.what, error.needed, error.given),
        ("second buffer", 4, 3)
    );
    assert_eq!(coefficients, [0; 16]);
}
