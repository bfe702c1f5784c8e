//! Overflow limits: tables at the edge of what the proof of the bounds takes, and the
//! frames that it has in mind.

use super::{Frame, UNIT};
use crate::grid;
use crate::made_up::MadeUp;
use iltm::compile::image::StoredRow;
use iltm::video::OperatorMemory;
use iltm_runtime::Grid;
use iltm_runtime::image::{ImageError, Table};
use iltm_runtime::operator::{Bounds, Operator, OperatorError};
use iltm_runtime::pipeline::stages;

/// A grid of 1 x 10 cells, of whose details at the finest level all five are as large
/// as they can be in one frame: the checkerboard.
fn five_details() -> Grid {
    grid(1, 10)
}

/// Its constant function.
const CONSTANT: u16 = 9;

fn row(index: u16, shift: u16, values: &[i16]) -> StoredRow {
    StoredRow {
        index,
        shift,
        entries: (0..).zip(values.iter().copied()).collect(),
    }
}

/// A table whose accumulator can reach `2^14` times 131,068 + `more`; `2^31 - 1` is
/// 131,071.99 times that.
pub fn at_the_accumulators_limit(more: i16) -> MadeUp {
    let mut made = MadeUp::new(five_details(), 1);
    let most = i16::MAX;
    made.tiers = vec![vec![row(CONSTANT, 8, &[most, most, most, most, more])]];
    made
}

/// A table of whose corrections one can reach `2^12` times 262,142 + `more`, and 3 for
/// what the three rows round; `2^30 - 1` is 262,143.99 times that.
pub fn at_the_corrections_limit(more: i16) -> MadeUp {
    let mut made = MadeUp::new(five_details(), 1);
    let most = i16::MAX;
    let all = [most, most, most, most, 3];
    // The first functions of the finest level and of the next are positive at the first
    // cell, as the constant is.
    made.tiers = vec![vec![
        row(0, 2, &all),
        row(5, 2, &[more]),
        row(CONSTANT, 2, &all),
    ]];
    made
}

/// What the check says of a table.
///
/// # Errors
/// [`OperatorError`] if it is its operator that is refused.
pub fn verdict(made: &MadeUp) -> Result<Bounds, OperatorError> {
    let image = made.image();
    match Table::check(&image) {
        Ok(table) => Ok(table.operator().map_or(Bounds::default(), Operator::bounds)),
        Err(ImageError::Operator(error)) => Err(error),
        Err(error) => panic!("{error}"),
    }
}

/// The corrections of the cells, bits of
/// [`Correction`](iltm_runtime::units::Correction), for a frame.
pub fn corrections(made: &MadeUp, frame: Frame) -> Vec<i32> {
    let image = made.image();
    let table = Table::check(&image).expect("made to be taken");
    let light = frame.light(made.grid);
    let mut cells: Vec<i32> = light.iter().map(|light| (light * UNIT) as i32).collect();
    let mut memory = OperatorMemory::new(&table);
    let done = stages::correct(
        &table,
        table.top_tier(),
        &mut cells,
        &mut memory.workspace(),
    );
    done.expect("everything has the grid's size");
    cells
}
