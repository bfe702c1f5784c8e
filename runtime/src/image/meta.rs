//! Meta section and tiers of an image: one `parse` and one `emit` each.

use super::bytes::{put, u16_at, u32_at};
use super::layout::{SectionKind, meta, tier};
use super::{ImageError, Label, SectionProblem};
use crate::Grid;
use crate::operator::Bounds;
use fixed::types::{U0F32, U1F15, U8F24};

/// The fields of the meta section.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Meta {
    /// Grid of cells.
    pub grid: Grid,
    /// Colour channels, 1 or 3.
    pub channels: u8,
    /// Fraction bits of the gains, 1 to 15.
    pub gain_fraction: u8,
    /// Light of reference white in camera units, not 0.
    pub reference_white: U8F24,
    /// Predicted closed-loop error of the inverse itself.
    pub inverse_error: U0F32,
    /// What no frame makes the operator exceed.
    pub bounds: Bounds,
    /// Scale of the operator in each channel; 0 for channels that there are not.
    pub channel_scales: [U1F15; 3],
    /// What people call the table.
    pub label: Label,
}

impl Meta {
    /// Reads the section's bytes.
    ///
    /// # Errors
    /// [`ImageError`] if there are more or fewer than [`meta::SIZE`], or a field holds
    /// what it must not hold. Bounds are taken as they are stated.
    pub fn parse(bytes: &[u8]) -> Result<Self, ImageError> {
        let section = SectionKind::Meta;
        let wrong = |field, offset| ImageError::Field {
            section,
            field,
            offset,
        };
        if bytes.len() != meta::SIZE {
            let problem = SectionProblem::Length;
            return Err(ImageError::Section { section, problem });
        }
        let wide = |field| u32_at(bytes, field).unwrap_or(0);
        let half = |field| u16_at(bytes, field).unwrap_or(0);
        let byte = |at: usize| bytes.get(at).copied().unwrap_or(0);
        let grid = Grid::new(half(meta::ROWS), half(meta::COLS)).map_err(ImageError::Grid)?;
        let channels = byte(meta::CHANNELS);
        if !matches!(channels, 1 | 3) {
            return Err(wrong("channels", meta::CHANNELS));
        }
        let gain_fraction = byte(meta::GAIN_FRACTION);
        // With none, light times gain less the correction could leave 32 bits.
        if !(1..=15).contains(&gain_fraction) {
            return Err(wrong("gain fraction", meta::GAIN_FRACTION));
        }
        for reserved in [meta::RESERVED, meta::RESERVED_END] {
            let start = reserved.start;
            let reserved = bytes.get(reserved).unwrap_or_default();
            if reserved.iter().any(|byte| *byte != 0) {
                return Err(wrong("reserved", start));
            }
        }
        let reference_white = U8F24::from_bits(wide(meta::REFERENCE_WHITE));
        if reference_white == U8F24::ZERO {
            return Err(wrong("reference white", meta::REFERENCE_WHITE.start));
        }
        let mut channel_scales = [U1F15::ZERO; 3];
        let scales = bytes.get(meta::CHANNEL_SCALES).unwrap_or_default();
        for (channel, (scale, bytes)) in channel_scales
            .iter_mut()
            .zip(scales.as_chunks::<2>().0)
            .enumerate()
        {
            *scale = U1F15::from_bits(u16::from_le_bytes(*bytes));
            if channel >= usize::from(channels) && *scale != U1F15::ZERO {
                let offset = meta::CHANNEL_SCALES.start + 2 * channel;
                return Err(wrong("channel scale", offset));
            }
        }
        let label = bytes.get(meta::LABEL).and_then(<[u8]>::first_chunk);
        let label = label.and_then(Label::parse);
        let label = label.ok_or(wrong("name", meta::LABEL.start))?;
        Ok(Self {
            grid,
            channels,
            gain_fraction,
            reference_white,
            inverse_error: U0F32::from_bits(wide(meta::INVERSE_ERROR)),
            bounds: Bounds {
                accumulator: wide(meta::ACCUMULATOR_BOUND),
                correction: wide(meta::CORRECTION_BOUND),
            },
            channel_scales,
            label,
        })
    }

    /// The section's bytes.
    #[must_use]
    pub fn emit(&self) -> [u8; meta::SIZE] {
        let mut bytes = [0; meta::SIZE];
        let [rows, cols] = [self.grid.rows(), self.grid.cols()].map(|side| side as u16);
        put(&mut bytes, meta::ROWS, &rows.to_le_bytes());
        put(&mut bytes, meta::COLS, &cols.to_le_bytes());
        // The two bytes stand side by side.
        let pair = meta::CHANNELS..meta::RESERVED.start;
        put(&mut bytes, pair, &[self.channels, self.gain_fraction]);
        put(&mut bytes, meta::LABEL, &self.label.emit());
        let scales = self.channel_scales.map(U1F15::to_le_bytes);
        put(&mut bytes, meta::CHANNEL_SCALES, scales.as_flattened());
        for (field, value) in [
            (meta::REFERENCE_WHITE, self.reference_white.to_bits()),
            (meta::ACCUMULATOR_BOUND, self.bounds.accumulator),
            (meta::CORRECTION_BOUND, self.bounds.correction),
            (meta::INVERSE_ERROR, self.inverse_error.to_bits()),
        ] {
            put(&mut bytes, field, &value.to_le_bytes());
        }
        bytes
    }
}

/// What one tier promises and costs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TierInfo {
    /// Predicted error of what the tier leaves out of the inverse: mean over
    /// natural images of `|light with the tier - light with all entries|` over
    /// `|wanted light|`. It adds to [`Table::inverse_error`](super::Table::inverse_error),
    /// as the root of the sum of squares.
    pub predicted_error: U0F32,
    /// Operator entries read a frame.
    pub entries: u32,
    /// Multiplications by operator entries a frame, all channels.
    pub multiplications: u32,
}

impl TierInfo {
    /// Reads an entry of the tiers section.
    #[must_use]
    pub fn parse(bytes: &[u8; tier::SIZE]) -> Self {
        let field = |field| u32_at(bytes, field).unwrap_or(0);
        Self {
            predicted_error: U0F32::from_bits(field(tier::PREDICTED_ERROR)),
            entries: field(tier::ENTRIES),
            multiplications: field(tier::MULTIPLICATIONS),
        }
    }

    /// Its entry of the tiers section.
    #[must_use]
    pub fn emit(&self) -> [u8; tier::SIZE] {
        let mut bytes = [0; tier::SIZE];
        for (field, value) in [
            (tier::PREDICTED_ERROR, self.predicted_error.to_bits()),
            (tier::ENTRIES, self.entries),
            (tier::MULTIPLICATIONS, self.multiplications),
        ] {
            put(&mut bytes, field, &value.to_le_bytes());
        }
        bytes
    }
}
