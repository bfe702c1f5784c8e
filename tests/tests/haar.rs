//! The solver's floating-point Haar basis is the runtime's integer one.

use iltm::solve::Haar;
use iltm_runtime::Grid;
use iltm_runtime::haar::{self, Function};
use nalgebra::DVector;

#[test]
fn both_bases_have_the_same_functions_in_the_same_order() {
    for (rows, cols) in [(1, 1), (1, 7), (6, 1), (5, 8), (13, 21), (16, 24)] {
        let grid = Grid::new(rows, cols).expect("a small grid");
        let float = Haar::new(grid);
        let integer = haar::Basis::new(grid);
        for (index, function) in integer.functions().enumerate() {
            let mut unit = DVector::zeros(grid.cells());
            unit[index] = 1.0;
            let cells = float.synthesise(&unit);
            let norm = (function.squared_norm() as f64).sqrt();
            let value = |f: &Function, cell: usize| f.at(cell / grid.cols(), cell % grid.cols());
            for (cell, found) in cells.iter().enumerate() {
                let expected = value(&function, cell) as f64 / norm;
                assert!(
                    (found - expected).abs() < 1e-12,
                    "{grid}: function {index}, cell {cell}: {found}, {expected}"
                );
            }
        }
    }
}
