//! What every way to photograph has in common, and a table of all.

use super::*;
use crate::known_scene::{m_scene, rig};
use iltm_capture::NoiseModel;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};

/// What a method finds; `None` if the scene is none for it.
fn found(method: &dyn Acquisition, rig: &mut Rig) -> Option<DMatrix<f64>> {
    match method.acquire(rig) {
        Ok(Acquired::Forward(found) | Acquired::Inverse(found)) => Some(found),
        // Light of full rank.
        Err(Unfit::Condition(_)) if method.name().starts_with("kernel Nystrom, up to") => None,
        Err(why) => panic!("{}: {why}", method.name()),
    }
}

#[test]
fn cells_that_are_not_live_stay_dark_in_every_answer() {
    let grid = Grid::new(5, 7).unwrap();
    let (mut transport, mut live) = m_scene(grid);
    for dead in [0, 9, 34] {
        live[dead] = false;
        transport.row_mut(dead).fill(0.0);
        transport.column_mut(dead).fill(0.0);
    }
    for noise in [0.0, 1e-6] {
        let noise = NoiseModel {
            shot: 0.0,
            floor: noise,
        };
        for method in all(40, 1) {
            let mut rig = rig(grid, &transport, &live, noise);
            let Some(found) = found(method.as_ref(), &mut rig) else {
                continue;
            };
            assert!(found.iter().all(|value| value.is_finite()));
            for dead in [0, 9, 34] {
                let most = found.row(dead).amax().max(found.column(dead).amax());
                assert!(most < 1e-12, "{}: {most}", method.name());
            }
        }
    }
}

/// Every cell has its own light and no other.
#[test]
fn a_wall_of_one_cell_one_row_or_one_column_is_found_by_every_way() {
    for (rows, cols) in [(1, 1), (7, 1), (1, 7)] {
        let grid = Grid::new(rows, cols).unwrap();
        let cells = grid.cells();
        let own = DVector::from_fn(cells, |i, _| 0.5 + 0.05 * (i % 3) as f64);
        let wanted = DMatrix::from_diagonal(&own);
        let rig = rig(grid, &wanted, &vec![true; cells], NoiseModel::default());
        for method in all(40, 1) {
            let found = match method.acquire(&mut rig.clone()) {
                Ok(Acquired::Forward(found)) => found,
                Ok(Acquired::Inverse(found)) => found.try_inverse().unwrap(),
                Err(why) => panic!("{}: {why}", method.name()),
            };
            let off = (found - &wanted).norm() / wanted.norm();
            assert!(off < 1e-3, "{}: {off}", method.name());
        }
    }
}

#[test]
fn ways_that_take_so_many_photographs_take_no_more() {
    let grid = Grid::new(5, 7).unwrap();
    let (transport, live) = m_scene(grid);
    for method in all(33, 1).iter().skip(4) {
        let mut rig = rig(grid, &transport, &live, NoiseModel::default());
        found(method.as_ref(), &mut rig);
        assert!(rig.photographs() <= 33, "{}", method.name());
    }
}
