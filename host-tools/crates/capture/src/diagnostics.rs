//! What reading a capture found out about it.

use super::{FileFormat, Gate, NoiseSource, PixelCount, RegistrationMethod};

/// What was used, what was left out and why.
#[derive(Clone, PartialEq, Debug)]
pub struct Diagnostics {
    /// What the photographs' files are.
    pub file: FileFormat,
    /// Bits of a sample in them, 32 for floating point.
    pub bits: u8,
    /// Photographs used, of every role.
    pub photographs: usize,
    /// Bernoulli photographs used.
    pub bernoulli: usize,
    /// Bernoulli photographs in the capture.
    pub bernoulli_taken: usize,
    /// How camera pixels were given to cells.
    pub method: RegistrationMethod,
    /// Camera pixels by what became of them.
    pub pixels: PixelCount,
    /// Cells that were not measured, in order.
    pub left_out: Vec<LeftOut>,
    /// 95th percentile of the flood photograph in the brightest channel, of full
    /// scale: about 0.8 is a good exposure.
    pub exposure: f64,
    /// Where the noise estimate comes from.
    pub noise: NoiseSource,
    /// How far patterns and their inverses together exceed white and black
    /// together, relative to white, signed, median over the pairs; `None`
    /// without inverses. A linear camera has 0; automatic exposure or an
    /// undeclared response shows here.
    pub superposition: Option<f64>,
    /// What the gates said; those that fail were ignored on purpose.
    pub gates: Vec<Gate>,
}

/// A cell that was not measured.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LeftOut {
    /// Its index, `row * cols + col`.
    pub cell: usize,
    /// Why.
    pub why: Why,
}

/// Why a cell was not measured.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Why {
    /// Too few camera pixels see it, and it alone.
    TooFewPixels {
        /// How many do.
        pixels: u32,
    },
    /// Its pixels reach the camera's full scale in the flood photograph.
    Saturated {
        /// How many of them.
        saturated: u32,
        /// All of them.
        pixels: u32,
    },
}
