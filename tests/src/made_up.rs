//! Made-up tables: any gains, ambient light, response and operator, without a scene behind
//! them.

use fastrand::Rng;
use fixed::types::{U0F32, U1F15, U8F24};
use iltm::compile::image::{ImageWriter, StoredRow, segment_bytes};
use iltm::compile::response;
use iltm::picture::Response;
use iltm_runtime::Grid;
use iltm_runtime::haar::Basis;
use iltm_runtime::image::layout::SectionKind;
use iltm_runtime::image::{Meta, TierInfo};
use iltm_runtime::operator::{Bounds, Channels, Operator, OperatorError, Segment};
use std::collections::BTreeSet;

/// What a table is to hold.
#[derive(Clone, Debug)]
pub struct MadeUp {
    /// Its grid.
    pub grid: Grid,
    /// Its channels, 1 or 3.
    pub channels: usize,
    /// Fraction bits of the gains.
    pub gain_fraction: u8,
    /// Gains of every cell, channels of a cell side by side.
    pub gains: Vec<u16>,
    /// Ambient light in the same way, bits of [`Light`](iltm_runtime::units::Light).
    pub ambient: Option<Vec<u16>>,
    /// Whether codes follow a projector's response (sRGB).
    pub response: bool,
    /// Rows of the operator of tier 1, the only one above 0; none without an operator.
    pub rows: Vec<StoredRow>,
    /// Scale of the operator in each channel that there is.
    pub scales: [U1F15; 3],
}

impl MadeUp {
    /// Gain 1 and nothing else.
    pub fn new(grid: Grid, channels: usize) -> Self {
        let mut scales = [U1F15::ZERO; 3];
        scales[..channels].fill(U1F15::ONE);
        Self {
            grid,
            channels,
            gain_fraction: 13,
            gains: vec![1 << 13; grid.cells() * channels],
            ambient: None,
            response: false,
            rows: Vec::new(),
            scales,
        }
    }

    /// Just under gain 1, so that natural frames are not clipped more than usual, and with
    /// ambient light if wanted.
    pub fn nearly_plain(grid: Grid, channels: usize, ambient: bool) -> Self {
        let mut table = Self::new(grid, channels);
        table.gains.fill(7_800);
        table.ambient = ambient.then(|| vec![330; table.gains.len()]);
        table
    }

    fn operator<'a>(&self, segment: &'a [u8]) -> Result<Operator<'a>, OperatorError> {
        let segment = Segment::new(0, 1, Channels::All, segment)?;
        let segments = std::iter::once(segment).collect();
        Operator::new(&Basis::new(self.grid), segments, self.scales)
    }

    /// The bytes of the image. Where the runtime refuses the operator, so does it the
    /// image, for the same reason.
    pub fn image(&self) -> Vec<u8> {
        let segment = segment_bytes(self.grid.cells(), &self.rows);
        let operator = (!self.rows.is_empty()).then(|| self.operator(&segment));
        let operator = operator.and_then(Result::ok);
        let mut image = ImageWriter::default();
        image.section(
            SectionKind::Meta,
            0,
            self.meta(operator.as_ref()).emit().to_vec(),
        );
        let top = u8::from(!self.rows.is_empty());
        let tiers = (0..=top).flat_map(|number| {
            let cost = operator.as_ref();
            let cost = cost.map_or((0, 0), |o| o.cost(number, self.channels as u8));
            TierInfo {
                predicted_error: U0F32::ZERO,
                entries: cost.0,
                multiplications: cost.1,
            }
            .emit()
        });
        image.section(SectionKind::Tiers, 0, tiers.collect());
        image.section(SectionKind::Gain, 0, halfwords(self.gains.iter().copied()));
        if let Some(ambient) = &self.ambient {
            image.section(SectionKind::Ambient, 0, halfwords(ambient.iter().copied()));
        }
        if self.response {
            let knots = response::knots(&Response::Srgb.into(), 1).expect("not linear");
            image.section(SectionKind::Codes, 0, response::codes(&knots));
            image.section(SectionKind::Response, 0, halfwords(knots));
        }
        if !self.rows.is_empty() {
            image.section(SectionKind::Operator, 1, segment.clone());
        }
        image.finish()
    }

    fn meta(&self, operator: Option<&Operator<'_>>) -> Meta {
        Meta {
            grid: self.grid,
            channels: self.channels as u8,
            gain_fraction: self.gain_fraction,
            reference_white: U8F24::from_bits(1 << 23),
            inverse_error: U0F32::ZERO,
            bounds: operator.map_or(Bounds::default(), Operator::bounds),
            channel_scales: self.scales,
        }
    }
}

/// Entries of a row: so many pairs at random even places, so that none runs into the next,
/// with random values.
pub fn pairs(random: &mut Rng, cells: u16, count: usize) -> Vec<(u16, i16)> {
    let mut places = BTreeSet::new();
    while places.len() < count {
        places.insert(2 * random.u16(..cells / 2));
    }
    let pair = |at: u16| [(at, random.i16(1..20)), (at + 1, -random.i16(1..20))];
    places.into_iter().flat_map(pair).collect()
}

fn halfwords(values: impl IntoIterator<Item = u16>) -> Vec<u8> {
    values.into_iter().flat_map(u16::to_le_bytes).collect()
}
