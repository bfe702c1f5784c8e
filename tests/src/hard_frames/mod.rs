//! Hard frames: frames and tables that are hard on integer arithmetic, against exact ones.
//!
//! The reference takes the entries that a checked table holds and does with them, in
//! `f64`, what the documentation says: whole basis functions instead of the fast
//! transform, no rounding anywhere. What may lie between the two is known cell by cell,
//! because the runtime rounds in four places and no others, in steps of a drive
//! (`2^-15`):
//!
//! - each input coefficient to nearest: half of its last place, times the entries that
//!   multiply it, times the functions that carry that to the cell;
//! - the end of each operator row downwards: one of 2^-23, times the function;
//! - the correction to nearest: half a step;
//! - gain times light to nearest: half a step;
//!
//! and the code that is compared, 16 bits, to nearest: a quarter of a step.
//!
//! | module | what lives there |
//! |---|---|
//! | [`limits`] | tables at the edge of what the proof of the bounds takes |
//! | [`page`] | what `docs/hard-cases.md` says of all of them |

pub mod limits;
pub mod page;

use crate::grid;
use crate::made_up::MadeUp;
use iltm::video::OperatorMemory;
use iltm_runtime::Grid;
use iltm_runtime::haar::{Basis, Function};
use iltm_runtime::image::Table;
use iltm_runtime::operator::Segment;
use iltm_runtime::pipeline::{Encoding, GridPipeline, Sample};
use iltm_runtime::units::ClippedSamples;
use nalgebra::{DMatrix, DVector};
use std::fmt;

/// Steps of a drive in 1.
const UNIT: f64 = 32_768.0;

/// What rounds a drive whatever the operator: correction, gain and code.
const ALWAYS: f64 = 0.5 + 0.5 + 0.25;

/// The frames, full scale, of one channel.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Frame {
    /// No light.
    Black,
    /// All light.
    White,
    /// White where row and column add up to an even number, or to an odd one: the
    /// largest details of the finest level.
    Checkerboard(bool),
    /// White at one cell.
    SinglePixel(usize),
    /// White where a function is positive, or where it is negative: what makes one
    /// coefficient as large as it can be.
    Extreme(usize, bool),
}

impl Frame {
    /// The light of the cells, 0 or 1.
    pub fn light(self, grid: Grid) -> Vec<f64> {
        let basis = Basis::new(grid);
        let function = match self {
            Self::Extreme(index, _) => basis.functions().nth(index),
            _ => None,
        };
        let lit = |cell: usize| {
            let (row, col) = (cell / grid.cols(), cell % grid.cols());
            match self {
                Self::Black => false,
                Self::White => true,
                Self::Checkerboard(even) => (row + col).is_multiple_of(2) == even,
                Self::SinglePixel(at) => cell == at,
                Self::Extreme(_, positive) => {
                    function.is_some_and(|f| (f.at(row, col) > 0) == positive)
                }
            }
        };
        (0..grid.cells())
            .map(|cell| f64::from(u8::from(lit(cell))))
            .collect()
    }

    /// Those of a grid that its size alone makes hard.
    pub fn all(grid: Grid) -> Vec<Self> {
        let cells = grid.cells();
        let mut frames = vec![Self::Black, Self::White];
        frames.extend([true, false].map(Self::Checkerboard));
        frames.extend([0, cells / 2, cells - 1].map(Self::SinglePixel));
        for index in [0, cells / 2, cells.saturating_sub(2)] {
            frames.extend([true, false].map(|side| Self::Extreme(index, side)));
        }
        frames
    }
}

/// What a table computes, without rounding.
pub struct Reference<'t, 'a> {
    table: &'t Table<'a>,
    functions: Vec<Function>,
    /// Value of each function (row) at each cell.
    values: DMatrix<f64>,
}

impl<'t, 'a> Reference<'t, 'a> {
    /// Of a table, at its top tier.
    pub fn new(table: &'t Table<'a>) -> Self {
        let functions: Vec<_> = table.basis().functions().collect();
        let (count, cols) = (functions.len(), table.grid().cols());
        let values = DMatrix::from_fn(count, count, |function, cell| {
            functions[function].at(cell / cols, cell % cols) as f64
        });
        Self {
            table,
            functions,
            values,
        }
    }

    /// The corrections of one channel, and how far rounding may take the runtime's from
    /// them, both in steps of a drive.
    pub fn corrections(&self, scale: f64, light: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let inputs = &self.values * DVector::from_column_slice(light) * UNIT;
        let count = light.len();
        let (mut sums, mut slack) = (DVector::zeros(count), DVector::zeros(count));
        let tier = self.table.top_tier();
        let segments = self.table.operator().map_or(&[][..], |o| o.segments());
        for row in segments
            .iter()
            .filter(|s| s.tier == tier)
            .flat_map(Segment::rows)
        {
            // To the last place of a drive, from that of a correction.
            let unit = scale * (-8.0 - f64::from(row.shift)).exp2();
            let at = usize::from(row.index);
            let (sum, slack) = (&mut sums[at], &mut slack[at]);
            row.fold((), |(), pair| {
                for (index, value) in (usize::from(pair.index)..).zip(pair.values) {
                    let Some(function) = self.functions.get(index) else {
                        continue;
                    };
                    let own = f64::from(function.input_shift()).exp2();
                    *sum += unit * f64::from(value) * inputs[index] / own;
                    *slack += unit * 0.5 * f64::from(value.unsigned_abs());
                }
            });
            *slack += 1.0 / 256.0;
        }
        (self.values.tr_mul(&sums), self.values.abs().tr_mul(&slack))
    }
}

/// The largest difference there was.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Worst {
    /// Steps of a drive.
    pub error: f64,
    /// The largest bound of a cell, steps of a drive.
    pub bound: f64,
    /// The largest difference as a part of the bound of its cell: below 1, or the
    /// runtime does what it should not.
    pub share: f64,
    /// The same of 8-bit codes, which are rounded themselves by more than all the rest.
    pub of_bytes: f64,
    /// Samples, and those of them that are not clipped.
    pub samples: [usize; 2],
}

impl Worst {
    fn add(&mut self, error: f64, bound: f64) {
        self.error = self.error.max(error);
        self.bound = self.bound.max(bound);
        self.share = self.share.max(error / bound);
    }

    /// The larger of each.
    pub fn max(self, other: Self) -> Self {
        Self {
            error: self.error.max(other.error),
            bound: self.bound.max(other.bound),
            share: self.share.max(other.share),
            of_bytes: self.of_bytes.max(other.of_bytes),
            samples: [0, 1].map(|of| self.samples[of] + other.samples[of]),
        }
    }

    /// Whether all were within their bounds.
    pub fn holds(&self) -> bool {
        self.share <= 1.0 && self.of_bytes <= 1.0
    }
}

impl fmt::Display for Worst {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.2} steps of 2^-15, at most {:.2} of its cell's bound",
            self.error, self.share
        )
    }
}

/// Drives of a frame of `C` channels, all of the same light, as the runtime makes them
/// with 16-bit codes, and the clipped samples.
pub fn runtime_drives<const C: usize>(
    table: &Table<'_>,
    light: &[f64],
) -> (Vec<[f64; C]>, ClippedSamples) {
    let (codes, clipped) = frame::<u16, C>(table, light, |light| (light * 65_535.0) as u16);
    let drives = codes
        .iter()
        .map(|pixel| pixel.map(|code| f64::from(code) / 65_535.0));
    (drives.collect(), clipped)
}

fn frame<S: Sample, const C: usize>(
    table: &Table<'_>,
    light: &[f64],
    code: impl Fn(f64) -> S,
) -> (Vec<[S; C]>, ClippedSamples) {
    let wanted: Vec<[S; C]> = light.iter().map(|light| [code(*light); C]).collect();
    let mut input = vec![[S::default(); C]; light.len()];
    let pipeline = GridPipeline::<C>::new(table).expect("the caller knows its channels");
    let mut memory = OperatorMemory::new(table);
    let how = (table.top_tier(), Encoding::Linear);
    let clipped = pipeline.compensate(how.0, how.1, &wanted, &mut input, &mut memory.workspace());
    (input, clipped.expect("everything has the grid's size"))
}

/// The runtime against the reference for a frame.
pub fn compare<const C: usize>(
    made: &MadeUp,
    reference: &Reference<'_, '_>,
    light: &[f64],
) -> Worst {
    let (drives, _) = runtime_drives::<C>(reference.table, light);
    let (bytes, _) = frame::<u8, C>(reference.table, light, |light| (light * 255.0) as u8);
    let gain_unit = f64::from(made.gain_fraction).exp2();
    let mut worst = Worst::default();
    for channel in 0..C {
        let own = |values: &[u16], cell: usize| f64::from(values[cell * C + channel]);
        let ambient = made.ambient.as_deref();
        let wanted: Vec<f64> = (0..)
            .zip(light)
            .map(|(cell, light)| {
                let ambient = ambient.map_or(0.0, |ambient| own(ambient, cell) / UNIT);
                (light - ambient).max(0.0)
            })
            .collect();
        let scale = made.scales[channel].to_num();
        let (corrections, slack) = reference.corrections(scale, &wanted);
        for (cell, light) in wanted.iter().enumerate() {
            let exact = own(&made.gains, cell) / gain_unit * light * UNIT - corrections[cell];
            let exact = exact.clamp(0.0, UNIT);
            // What the reference itself rounds, in f64, is far below the last term.
            let bound = ALWAYS + slack[cell] + 1e-6;
            worst.add((drives[cell][channel] * UNIT - exact).abs(), bound);
            // An 8-bit code is half of its own step off at most.
            let of_code = UNIT / 255.0;
            let error = (f64::from(bytes[cell][channel]) * of_code - exact).abs();
            worst.of_bytes = worst.of_bytes.max(error / (bound + of_code / 2.0));
            worst.samples[0] += 1;
            worst.samples[1] += usize::from(exact > 0.0 && exact < UNIT);
        }
    }
    worst
}

/// [`compare`] for all hard frames of a random table.
pub fn all_frames(made: &MadeUp, frames: &[Frame]) -> Worst {
    let image = made.image();
    let table = Table::check(&image).expect("made to be taken");
    let reference = Reference::new(&table);
    let of = |frame: &Frame| {
        let light = frame.light(made.grid);
        match made.channels {
            1 => compare::<1>(made, &reference, &light),
            _ => compare::<3>(made, &reference, &light),
        }
    };
    frames.iter().map(of).fold(Worst::default(), Worst::max)
}

/// Grids whose sides the transform finds hard: none, one row, one column, primes, the
/// paper's, a thin one.
pub const GRIDS: [(u16, u16); 11] = [
    (1, 1),
    (1, 2),
    (1, 64),
    (64, 1),
    (1, 37),
    (37, 1),
    (2, 2),
    (7, 11),
    (31, 23),
    (13, 21),
    (257, 3),
];

/// Frames of which the output differs from that of the first ones, among `count` that
/// show the same two frames, unlike in every sample, in turn: black and white, then a
/// checkerboard and its inverse. All stages at once, in 8 bits.
pub fn drifted(count: usize) -> usize {
    let mut made = MadeUp::random(grid(5, 7), 3, 6, 5);
    made.response = true;
    let image = made.image();
    let table = Table::check(&image).expect("made to be taken");
    let pipeline = GridPipeline::<3>::new(&table).expect("three channels");
    let mut memory = OperatorMemory::new(&table);
    let frames = [
        Frame::Black,
        Frame::White,
        Frame::Checkerboard(true),
        Frame::Checkerboard(false),
    ]
    .map(|frame| -> Vec<[u8; 3]> {
        let light = frame.light(made.grid);
        light
            .iter()
            .map(|light| [(light * 255.0) as u8; 3])
            .collect()
    });
    let mut input = vec![[0; 3]; made.grid.cells()];
    let mut make = |wanted: &[[u8; 3]]| {
        let (tier, mut workspace) = (table.top_tier(), memory.workspace());
        let made = pipeline.compensate(tier, Encoding::Display, wanted, &mut input, &mut workspace);
        made.expect("everything has the grid's size");
        input.clone()
    };
    let first = frames.each_ref().map(|frame| make(frame));
    let half = count / 2;
    (0..count)
        .filter(|number| {
            let of = number % 2 + if *number < half { 0 } else { 2 };
            make(&frames[of]) != first[of]
        })
        .count()
}
