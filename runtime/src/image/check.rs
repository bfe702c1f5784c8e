//! The check of what an image's sections say.

use super::bytes::{Halfwords, u16_at, u32_at};
use super::layout::{
    MAX_PROVENANCE, MAX_SEGMENTS, MAX_TIERS, SectionKind, fine_gain, header, meta, tier,
};
use super::sections::{Section, Whole};
use super::{FineGain, ImageError, SectionProblem, Table, TierInfo};
use crate::haar::Basis;
use crate::operator::{Channels, Operator, OperatorError, Segment};
use crate::pace::{Pace, cost};
use crate::pipeline::RESPONSE_KNOTS;
use crate::pipeline::codes::{CODES, code};
use crate::units::Light;
use crate::{FrameSize, Grid};
use fixed::types::{U0F32, U1F15, U8F24};
use heapless::Vec;

pub(super) fn contents<'a>(
    whole: &Whole<'a>,
    pace: &mut Pace<'_>,
) -> Result<Table<'a>, ImageError> {
    let meta = Meta::read(whole.required(SectionKind::Meta)?)?;
    let (grid, values) = (meta.grid, meta.grid.cells() * usize::from(meta.channels));
    let basis = Basis::new(grid);
    let tiers = tiers(whole.required(SectionKind::Tiers)?)?;
    let gain = halfwords(whole.required(SectionKind::Gain)?, values)?;
    let ambient = whole
        .optional(SectionKind::Ambient)
        .map(|section| ambient(section, values, pace))
        .transpose()?;
    let response = whole
        .optional(SectionKind::Response)
        .map(|section| response(section, meta.channels, pace))
        .transpose()?;
    let fine_gain = whole
        .optional(SectionKind::FineGain)
        .map(|section| fine_gains(section, grid, meta.channels))
        .transpose()?;
    let operator = operator(whole, &meta, &basis, tiers.len(), pace)?;
    check_costs(operator.as_ref(), &tiers, meta.channels, pace)?;
    let provenance = whole
        .optional(SectionKind::Provenance)
        .map_or(Ok(&[][..]), |section| provenance(section, pace))?;
    let mut table = Table {
        basis,
        channels: meta.channels,
        gain_fraction: meta.gain_fraction,
        reference_white: meta.reference_white,
        inverse_error: meta.inverse_error,
        tiers,
        gain,
        ambient,
        response,
        codes: &[],
        fine_gain,
        operator,
        provenance,
        bytes: whole.image.len(),
        id: u32_at(whole.image, header::CRC).unwrap_or(0),
    };
    table.codes = codes(whole.optional(SectionKind::Codes), &table, pace)?;
    Ok(table)
}

/// The fields of the meta section.
struct Meta {
    grid: Grid,
    channels: u8,
    gain_fraction: u8,
    reference_white: U8F24,
    inverse_error: U0F32,
    accumulator_bound: u32,
    correction_bound: u32,
    channel_scales: [U1F15; 3],
}

impl Meta {
    fn read(section: Section<'_>) -> Result<Self, ImageError> {
        if section.bytes.len() != meta::SIZE {
            return Err(section.length_error());
        }
        let wide = |field| u32_at(section.bytes, field).unwrap_or(0);
        let half = |field| u16_at(section.bytes, field).unwrap_or(0);
        let byte = |at: usize| section.bytes.get(at).copied().unwrap_or(0);
        let grid = Grid::new(half(meta::ROWS), half(meta::COLS)).map_err(ImageError::Grid)?;
        let channels = byte(meta::CHANNELS);
        if !matches!(channels, 1 | 3) {
            return Err(section.field_error("channels", meta::CHANNELS));
        }
        let gain_fraction = byte(meta::GAIN_FRACTION);
        if gain_fraction > 15 {
            return Err(section.field_error("gain fraction", meta::GAIN_FRACTION));
        }
        for reserved in [meta::RESERVED, meta::RESERVED_END] {
            let start = reserved.start;
            let bytes = section.bytes.get(reserved).unwrap_or_default();
            if bytes.iter().any(|byte| *byte != 0) {
                return Err(section.field_error("reserved", start));
            }
        }
        let reference_white = U8F24::from_bits(wide(meta::REFERENCE_WHITE));
        if reference_white == U8F24::ZERO {
            return Err(section.field_error("reference white", meta::REFERENCE_WHITE.start));
        }
        let mut channel_scales = [U1F15::ZERO; 3];
        let scales = section.bytes.get(meta::CHANNEL_SCALES).unwrap_or_default();
        for (channel, (scale, bytes)) in channel_scales
            .iter_mut()
            .zip(scales.as_chunks::<2>().0)
            .enumerate()
        {
            *scale = U1F15::from_bits(u16::from_le_bytes(*bytes));
            if channel >= usize::from(channels) && *scale != U1F15::ZERO {
                let offset = meta::CHANNEL_SCALES.start + 2 * channel;
                return Err(section.field_error("channel scale", offset));
            }
        }
        Ok(Self {
            grid,
            channels,
            gain_fraction,
            reference_white,
            inverse_error: U0F32::from_bits(wide(meta::INVERSE_ERROR)),
            accumulator_bound: wide(meta::ACCUMULATOR_BOUND),
            correction_bound: wide(meta::CORRECTION_BOUND),
            channel_scales,
        })
    }
}

fn tiers(section: Section<'_>) -> Result<Vec<TierInfo, MAX_TIERS>, ImageError> {
    let (entries, rest) = section.bytes.as_chunks::<{ tier::SIZE }>();
    if !rest.is_empty() || entries.is_empty() || entries.len() > MAX_TIERS {
        return Err(section.length_error());
    }
    let read = |entry: &[u8; tier::SIZE]| {
        let field = |field| u32_at(entry, field).unwrap_or(0);
        TierInfo {
            predicted_error: U0F32::from_bits(field(tier::PREDICTED_ERROR)),
            entries: field(tier::ENTRIES),
            multiplications: field(tier::MULTIPLICATIONS),
        }
    };
    Ok(entries.iter().map(read).collect())
}

fn halfwords(section: Section<'_>, count: usize) -> Result<Halfwords<'_>, ImageError> {
    Halfwords::new(section.bytes)
        .filter(|words| words.len() == count)
        .ok_or(section.length_error())
}

fn ambient<'a>(
    section: Section<'a>,
    count: usize,
    pace: &mut Pace<'_>,
) -> Result<Halfwords<'a>, ImageError> {
    let words = halfwords(section, count)?;
    let too_much = |bits| {
        pace.done(1, cost::VALUE);
        Light::from_bits(bits) > Light::ONE
    };
    match words.run(0, count).position(too_much) {
        None => Ok(words),
        Some(index) => Err(section.field_error("ambient light", 2 * index)),
    }
}

fn response<'a>(
    section: Section<'a>,
    channels: u8,
    pace: &mut Pace<'_>,
) -> Result<Halfwords<'a>, ImageError> {
    let words = Halfwords::new(section.bytes).ok_or(section.length_error())?;
    let own = usize::from(channels) * RESPONSE_KNOTS;
    if words.len() != RESPONSE_KNOTS && words.len() != own {
        return Err(section.length_error());
    }
    for start in (0..words.len()).step_by(RESPONSE_KNOTS) {
        let falls = |index: &usize| {
            pace.done(1, cost::VALUE);
            words.get(*index) < words.get(index.saturating_sub(1))
        };
        if let Some(index) = (start + 1..start + RESPONSE_KNOTS).find(falls) {
            return Err(section.field_error("response", 2 * index));
        }
    }
    Ok(words)
}

/// The 8-bit codes, which must be those of the response that the table has.
fn codes<'a>(
    section: Option<Section<'a>>,
    table: &Table<'_>,
    pace: &mut Pace<'_>,
) -> Result<&'a [[u8; CODES]], ImageError> {
    let Some(section) = section else {
        return match table.response {
            None => Ok(&[]),
            Some(_) => Err(ImageError::Section {
                section: SectionKind::Codes,
                problem: SectionProblem::Missing,
            }),
        };
    };
    let curves = table.response.map_or(0, Halfwords::len) / RESPONSE_KNOTS;
    let (codes, rest) = section.bytes.as_chunks::<CODES>();
    if !rest.is_empty() || codes.len() != curves {
        return Err(section.length_error());
    }
    for (channel, curve) in codes.iter().enumerate() {
        let response = table.response(channel);
        let differs = |(index, stored): (usize, &u8)| {
            pace.done(1, cost::CODE);
            *stored != code(index, response)
        };
        if let Some(index) = curve.iter().enumerate().position(differs) {
            return Err(section.field_error("code", channel * CODES + index));
        }
    }
    Ok(codes)
}

fn fine_gains(section: Section<'_>, cells: Grid, channels: u8) -> Result<FineGain<'_>, ImageError> {
    let (head, rest) = section
        .bytes
        .split_at_checked(fine_gain::SIZE)
        .ok_or(section.length_error())?;
    let side = |field| u16_at(head, field).unwrap_or(0);
    let (rows, cols) = (side(fine_gain::ROWS), side(fine_gain::COLS));
    let size = FrameSize::new(cols, rows)
        .filter(|size| size.holds(cells))
        .ok_or(section.field_error("fine grid", 0))?;
    let count = size.pixels() * usize::from(channels);
    let gain = Halfwords::new(rest)
        .filter(|words| words.len() == count)
        .ok_or(section.length_error())?;
    Ok(FineGain {
        size,
        channels,
        gain,
    })
}

/// The operator; bounds that the image states must be those of its entries.
fn operator<'a>(
    whole: &Whole<'a>,
    meta: &Meta,
    basis: &Basis,
    tiers: usize,
    pace: &mut Pace<'_>,
) -> Result<Option<Operator<'a>>, ImageError> {
    let mut segments: Vec<Segment<'a>, MAX_SEGMENTS> = Vec::new();
    for (index, section) in whole.of_kind(SectionKind::Operator).enumerate() {
        let [tier, channel] = section.selector.to_le_bytes();
        let channels = match channel {
            0 => Channels::All,
            number => Channels::One(number - 1),
        };
        if tier == 0 || usize::from(tier) >= tiers || channel > meta.channels {
            return Err(ImageError::Section {
                section: SectionKind::Operator,
                problem: SectionProblem::Selector,
            });
        }
        let segment =
            Segment::new(index, tier, channels, section.bytes).map_err(ImageError::Operator)?;
        segments
            .push(segment)
            .map_err(|_| ImageError::Operator(OperatorError::Segments))?;
    }
    let stated = (meta.accumulator_bound, meta.correction_bound);
    if segments.is_empty() {
        return match stated {
            (0, 0) => Ok(None),
            _ => Err(ImageError::Operator(OperatorError::BoundsDiffer)),
        };
    }
    let operator = Operator::with_pace(basis, segments, meta.channel_scales, pace)
        .map_err(ImageError::Operator)?;
    let bounds = operator.bounds();
    if (bounds.accumulator, bounds.correction) != stated {
        return Err(ImageError::Operator(OperatorError::BoundsDiffer));
    }
    Ok(Some(operator))
}

/// A tier must cost what the image says: the governor plans with it.
fn check_costs(
    operator: Option<&Operator<'_>>,
    tiers: &[TierInfo],
    channels: u8,
    pace: &mut Pace<'_>,
) -> Result<(), ImageError> {
    for (tier, info) in (0_u8..).zip(tiers) {
        let cost = operator.map_or((0, 0), |operator| {
            operator.cost_with_pace(tier, channels, pace)
        });
        if cost != (info.entries, info.multiplications) {
            return Err(ImageError::Operator(OperatorError::CostDiffers { tier }));
        }
    }
    Ok(())
}

/// Checks the text piece by piece, for it may be long.
fn provenance<'a>(section: Section<'a>, pace: &mut Pace<'_>) -> Result<&'a [u8], ImageError> {
    const PIECE: usize = 256;
    if section.bytes.len() > MAX_PROVENANCE {
        return Err(section.length_error());
    }
    let mut rest = section.bytes;
    while !rest.is_empty() {
        let piece = rest.get(..PIECE).unwrap_or(rest);
        let good = match core::str::from_utf8(piece) {
            Ok(text) => text.len(),
            // Cut in the middle of a character.
            Err(error) if error.error_len().is_none() && piece.len() < rest.len() => {
                error.valid_up_to()
            }
            Err(error) => {
                let at = section.bytes.len() - rest.len() + error.valid_up_to();
                return Err(section.field_error("text", at));
            }
        };
        rest = rest.get(good..).unwrap_or_default();
        pace.done(piece.len(), cost::VALUE);
    }
    Ok(section.bytes)
}
