//! Page of hard frames: the lines of the page of hard cases that are about frames.

use super::limits::{at_the_accumulators_limit, at_the_corrections_limit, corrections, verdict};
use super::{Frame, GRIDS, Worst, all_frames, drifted};
use crate::grid;
use crate::made_up::MadeUp;
use iltm_runtime::operator::{Bounds, OperatorError};

/// One line of the page of hard cases.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: &'static str,
    /// Why it is hard.
    pub reason: &'static str,
    /// What theory allows, and which.
    pub bound: String,
    /// What was found.
    pub measured: String,
    /// Whether that is within the bound.
    pub holds: bool,
}

/// The lines.
pub fn rows() -> Vec<Row> {
    let mut rows = frame_rows();
    rows.extend(limit_rows());
    rows.push(drift_row());
    rows.extend(grid_rows());
    rows
}

const ROUNDINGS: &str = "roundings of input coefficients, rows, correction, gain and code";

fn within(case: &'static str, reason: &'static str, worst: Worst) -> Row {
    Row {
        case,
        reason,
        bound: format!(
            "{:.2} steps of 2^-15 where it is largest: {ROUNDINGS}",
            worst.bound
        ),
        measured: worst.to_string(),
        holds: worst.holds(),
    }
}

/// The largest difference of some frames on all grids.
fn on_all_grids(choose: fn(&Frame) -> bool) -> Worst {
    let of = |(seed, (rows, cols)): (u64, (u16, u16))| {
        let made = MadeUp::random(grid(rows, cols), 1, 6, seed);
        let frames: Vec<_> = Frame::all(made.grid).into_iter().filter(choose).collect();
        all_frames(&made, &frames)
    };
    (0..).zip(GRIDS).map(of).fold(Worst::default(), Worst::max)
}

fn frame_rows() -> Vec<Row> {
    vec![
        within(
            "a black frame",
            "below the ambient light everywhere: differences must not wrap",
            on_all_grids(|frame| *frame == Frame::Black),
        ),
        within(
            "a white frame",
            "the largest mean that there is",
            on_all_grids(|frame| *frame == Frame::White),
        ),
        within(
            "a checkerboard",
            "the largest details of the finest level, all at once",
            on_all_grids(|frame| matches!(frame, Frame::Checkerboard(_))),
        ),
        within(
            "a single white pixel",
            "all levels have one detail each, small ones rounded away",
            on_all_grids(|frame| matches!(frame, Frame::SinglePixel(_))),
        ),
        within(
            "a frame like a basis function",
            "the largest coefficient that there is, of either sign",
            on_all_grids(|frame| matches!(frame, Frame::Extreme(..))),
        ),
    ]
}

fn limit_rows() -> Vec<Row> {
    let entries = "all entries at their largest, and a frame with all of their coefficients so";
    let levels = "functions of three levels that add up at one cell";
    vec![
        reached(
            ("an accumulator just under its limit", entries),
            &at_the_accumulators_limit(3),
            // The row's coefficient is the accumulator, shifted by 8.
            |bounds| (bounds.accumulator, 1 << 8),
        ),
        refused(
            ("an accumulator at its limit", entries),
            &at_the_accumulators_limit(4),
            Bounds::MAX_ACCUMULATOR,
        ),
        reached(
            ("a correction just under its limit", levels),
            &at_the_corrections_limit(1),
            |bounds| (bounds.correction, 1),
        ),
        refused(
            ("a correction at its limit", levels),
            &at_the_corrections_limit(2),
            Bounds::MAX_CORRECTION,
        ),
    ]
}

/// A table that is taken, and how near its proved bound a frame comes. `of` says which
/// bound, and how many of its units one of a correction is.
fn reached(
    (case, reason): (&'static str, &'static str),
    made: &MadeUp,
    of: fn(Bounds) -> (u32, i64),
) -> Row {
    // Half a step of a drive is on every correction, beyond what the proof is about.
    let half = 128;
    let (proved, unit) = of(verdict(made).expect("made to be taken"));
    let frame = |side| corrections(made, Frame::Checkerboard(side));
    let all = [true, false].map(frame).concat();
    let largest = all.into_iter().map(|c| (i64::from(c) - half).abs() * unit);
    let largest = largest.max().unwrap_or(0);
    let share = largest as f64 / f64::from(proved);
    Row {
        case,
        reason,
        bound: format!("{proved}, the table's proved bound"),
        measured: format!("{largest}, {share:.7} of it, in a checkerboard"),
        holds: share > 0.999 && largest <= i64::from(proved),
    }
}

fn refused((case, reason): (&'static str, &'static str), made: &MadeUp, limit: u64) -> Row {
    use OperatorError::{AccumulatorOverflow, CorrectionOverflow};
    let (measured, holds) = match verdict(made) {
        Err(error @ (AccumulatorOverflow { bound, .. } | CorrectionOverflow { bound })) => {
            (format!("refused: {error}"), bound > limit)
        }
        Err(error) => (format!("refused for another reason: {error}"), false),
        Ok(bounds) => (format!("taken, with {bounds:?}"), false),
    };
    Row {
        case,
        reason,
        bound: format!("at most {limit}, or refused"),
        measured,
        holds,
    }
}

/// Frames of the line on drift: nine hours of video at 30 frames a second.
const FRAMES: usize = 1_000_000;

fn drift_row() -> Row {
    let drifted = drifted(FRAMES);
    Row {
        case: "full-scale alternation, a million frames",
        reason: "what is left of a frame would show in the next, or grow",
        bound: "0 frames: nothing of a frame is kept".to_owned(),
        measured: format!("{drifted} of {FRAMES} differ from the first in any bit"),
        holds: drifted == 0,
    }
}

fn grid_rows() -> Vec<Row> {
    let on = |sides: &[(u16, u16)]| {
        let of = |(seed, (rows, cols)): (u64, &(u16, u16))| {
            let made = MadeUp::random(grid(*rows, *cols), 3, 5, 100 + seed);
            all_frames(&made, &Frame::all(made.grid))
        };
        (0..).zip(sides).map(of).fold(Worst::default(), Worst::max)
    };
    vec![
        within(
            "a grid of 1 x 1",
            "no neighbour, no detail, no operator",
            on(&[(1, 1)]),
        ),
        within(
            "grids of one row or one column",
            "splits along one axis only",
            on(&[(1, 2), (2, 1), (1, 64), (64, 1), (1, 37), (37, 1)]),
        ),
        within(
            "grids of prime sides",
            "odd splits at every level, with weights",
            on(&[(2, 3), (7, 11), (31, 23)]),
        ),
        within("a grid of 13 x 21", "the paper's", on(&[(13, 21)])),
        within(
            "a grid of 257 x 3",
            "the most unequal splits: 256 to 1",
            on(&[(257, 3)]),
        ),
    ]
}
