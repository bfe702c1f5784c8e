//! Accuracy against time: many ways to compensate a scene, each with its error and its
//! cost.
//!
//! | what | file |
//! |---|---|
//! | the ways, and what is asked of each | `sweep.rs`, of a table alone `of_table.rs` |
//! | a table's tiers and bits as points | `points.rs` |
//! | a table in floating point | `float_table.rs` |
//! | errors of natural images, predicted and true | `judge.rs` |
//! | fewer bits, a coarser grid | `bits.rs`, `coarse.rs` |
//! | points that no other beats | `front.rs` |
//! | one line of advice | `advice.rs` |
//! | as JSON and CSV, as a picture, as a page | `list.rs`, `picture.rs`, `page.rs` |
//!
//! A point's predicted error has two parts, of which it is the root of the sum of
//! squares: that of the inverse itself, by photographs that its solve had not seen, and
//! what the table leaves out of it, on natural images. Its true error, where a capture
//! holds a [reference](iltm_capture::read_reference), is the mean over natural images
//! `d`, from a fifth of reference white up to all of it, of `||T p - d|| / ||d||` with
//! `p` the clipped input that the table gives.

mod advice;
mod bits;
mod coarse;
mod float_table;
mod front;
mod judge;
mod list;
mod of_table;
mod page;
mod picture;
mod points;
mod sweep;

use iltm_capture::ReferenceError;
use iltm_compile::{CompileError, build_table::BuildError, cost::BUDGET};
use iltm_picture::progress::Progress;
use iltm_runtime::{
    Grid,
    image::{ImageError, Table},
    operator::OperatorError,
    pipeline::FrameError,
};
use std::path::Path;

/// What is varied.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sweep {
    /// Nothing: the tiers of the table itself, or of the one that `iltm solve` makes.
    Table,
    /// Tiers between those.
    Tiers,
    /// Fewer Bernoulli photographs.
    Photographs,
    /// Another method.
    Solver,
    /// Fewer bits a coefficient.
    Bits,
    /// A coarser operator.
    Grid,
}

impl Sweep {
    /// All, in the order of lists.
    pub const ALL: [Self; 6] = [
        Self::Table,
        Self::Tiers,
        Self::Photographs,
        Self::Solver,
        Self::Bits,
        Self::Grid,
    ];

    /// Its name in lists.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Tiers => "tiers",
            Self::Photographs => "photographs",
            Self::Solver => "solver",
            Self::Bits => "bits",
            Self::Grid => "grid",
        }
    }
}

/// One way to compensate.
#[derive(Clone, PartialEq, Debug)]
pub struct Point {
    /// What is varied.
    pub sweep: Sweep,
    /// To what, in words.
    pub setting: String,
    /// The tier of its table.
    pub tier: u8,
    /// Name of the method; `None` if the table does not say.
    pub method: Option<String>,
    /// Photographs that were solved from, of all kinds but black; likewise.
    pub photographs: Option<u64>,
    /// Bits of a coefficient.
    pub bits: u32,
    /// Grid of the operator.
    pub grid: Grid,
    /// Predicted error of what is left out.
    pub left_out: f64,
    /// Predicted error of the inverse; 0 if none could be predicted.
    pub inverse: f64,
    /// Both together.
    pub predicted: f64,
    /// True error, where there is a reference.
    pub truth: Option<f64>,
    /// Instructions of a frame of one pixel a cell on the reference board, by the
    /// [model](iltm_compile::cost).
    pub instructions: u64,
    /// Microseconds of the same on one core of this machine; `None` if not timed.
    pub microseconds: Option<f64>,
    /// Bytes of a table with this tier and gain only.
    pub bytes: u64,
    /// Seconds of the solve; `None` if the table does not say.
    pub seconds: Option<f64>,
    /// Whether [`bytes`](Self::bytes) are those of a format that no device has.
    pub hypothetical: bool,
    /// Whether no other point errs as little (predicted) in as few instructions.
    /// Hypothetical ones take no part.
    pub front: bool,
}

impl Point {
    /// Share of a frame's time: [`BUDGET`].
    #[must_use]
    pub fn share(&self) -> f64 {
        self.instructions as f64 / BUDGET as f64
    }
}

/// A way that has no points, or a number that is not there.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Missing {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
}

/// All points of a scene.
#[derive(Clone, Debug)]
pub struct Tradeoff {
    /// The capture's or the table's name.
    pub name: String,
    /// The scene, from its table.
    pub scene: String,
    /// Cells.
    pub grid: Grid,
    /// 1 or 3.
    pub channels: u8,
    /// Every way, those of the table first.
    pub points: Vec<Point>,
    /// What has no points, or lacks numbers.
    pub missing: Vec<Missing>,
}

/// Why there are no points.
#[derive(Debug, thiserror::Error)]
pub enum TradeoffError {
    /// The capture does not become a table.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The reference cannot be used.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// A table with other tiers cannot be stored.
    #[error(transparent)]
    Compile(#[from] CompileError),
    /// A table that was compiled is not one.
    #[error("the table cannot be read back: {0}")]
    Table(ImageError),
    /// Coefficients that were rounded are no operator.
    #[error("the rounded operator cannot be read back: {0}")]
    Operator(OperatorError),
    /// The tiers could not be timed.
    #[error("the tiers cannot be timed: {0}")]
    Timing(FrameError),
}

impl From<iltm_capture::CaptureError> for TradeoffError {
    fn from(error: iltm_capture::CaptureError) -> Self {
        Self::Build(error.into())
    }
}

impl Tradeoff {
    /// Solves a capture in many ways. Takes some seconds for a few hundred cells.
    ///
    /// # Errors
    /// [`TradeoffError`] if the capture does not become a table as it is, or holds a
    /// reference that cannot be used. Other ways that fail are named in
    /// [`missing`](Self::missing).
    pub fn of_capture(folder: &Path, progress: &dyn Progress) -> Result<Self, TradeoffError> {
        sweep::of_capture(folder, progress).map(Self::with_front)
    }

    /// The tiers of a table, and fewer bits. `name` is what it is called.
    ///
    /// # Errors
    /// [`TradeoffError`] if it cannot be timed.
    pub fn of_table(
        name: &str,
        table: &Table<'_>,
        progress: &dyn Progress,
    ) -> Result<Self, TradeoffError> {
        of_table::of_table(name, table, progress).map(Self::with_front)
    }

    /// One line: the cheapest tier of the table that is good enough, what it costs, and
    /// what more time would bring.
    #[must_use]
    pub fn advice(&self) -> String {
        advice::advice(&self.points)
    }

    /// Whether points have a true error.
    #[must_use]
    pub fn has_truth(&self) -> bool {
        self.points.iter().any(|point| point.truth.is_some())
    }

    fn with_front(mut self) -> Self {
        let places = self.points.iter().map(|point| {
            let error = if point.hypothetical {
                f64::NAN
            } else {
                point.predicted
            };
            (point.instructions as f64, error)
        });
        let on = front::front(&places.collect::<Vec<_>>());
        for (point, on) in self.points.iter_mut().zip(on) {
            point.front = on;
        }
        self
    }
}
