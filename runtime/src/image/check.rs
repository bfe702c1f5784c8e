//! The check of an image, section by section.

use super::bytes::{Halfwords, u16_at, u32_at};
use super::layout::{
    ALIGNMENT, FORMAT_VERSION, MAGIC, MAX_PROVENANCE, MAX_SECTIONS, MAX_SEGMENTS, MAX_TIERS,
    SectionKind, entry, fine_gain, header, meta, tier,
};
use super::{FineGain, ImageError, SectionProblem, Table, TierInfo, crc32};
use crate::haar::Basis;
use crate::operator::{Channels, Operator, OperatorError, Segment};
use crate::pipeline::RESPONSE_KNOTS;
use crate::pipeline::codes::{CODES, code};
use crate::units::Light;
use crate::{FrameSize, Grid};
use fixed::types::{U0F32, U1F15, U8F24};
use heapless::Vec;

/// One section whose checksum holds.
#[derive(Clone, Copy)]
struct Section<'a> {
    kind: SectionKind,
    selector: u16,
    bytes: &'a [u8],
}

type Sections<'a> = Vec<Section<'a>, MAX_SECTIONS>;

pub(super) fn check(image: &[u8]) -> Result<Table<'_>, ImageError> {
    let sections = sections(image)?;
    let meta = Meta::read(required(&sections, SectionKind::Meta)?)?;
    let (grid, values) = (meta.grid, meta.grid.cells() * usize::from(meta.channels));
    let basis = Basis::new(grid);
    let tiers = tiers(required(&sections, SectionKind::Tiers)?)?;
    let gain = halfwords(required(&sections, SectionKind::Gain)?, values)?;
    let ambient = optional(&sections, SectionKind::Ambient)
        .map(|section| ambient(section, values))
        .transpose()?;
    let response = optional(&sections, SectionKind::Response)
        .map(|section| response(section, meta.channels))
        .transpose()?;
    let fine_gain = optional(&sections, SectionKind::FineGain)
        .map(|section| fine_gains(section, grid, meta.channels))
        .transpose()?;
    let operator = operator(&sections, &meta, &basis, tiers.len())?;
    check_costs(operator.as_ref(), &tiers, meta.channels)?;
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
        provenance: optional(&sections, SectionKind::Provenance).map_or(Ok(""), provenance)?,
        bytes: image.len(),
        id: u32_at(image, header::CRC).unwrap_or(0),
    };
    table.codes = codes(optional(&sections, SectionKind::Codes), &table)?;
    Ok(table)
}

/// Header, section table and checksums.
fn sections(image: &[u8]) -> Result<Sections<'_>, ImageError> {
    let given = image.len();
    let truncated = |needed: usize| ImageError::Truncated { needed, given };
    let head = image.get(..header::SIZE).ok_or(truncated(header::SIZE))?;
    if head.get(header::MAGIC) != Some(&MAGIC) {
        return Err(ImageError::NotATable);
    }
    let short = truncated(header::SIZE);
    let found = u16_at(head, header::VERSION).ok_or(short)?;
    if found != FORMAT_VERSION {
        return Err(ImageError::Version { found });
    }
    let stated = u32_at(head, header::LENGTH).ok_or(short)? as usize;
    if given < stated {
        return Err(truncated(stated));
    }
    if given > stated {
        return Err(ImageError::Length { stated, given });
    }
    let count = usize::from(u16_at(head, header::SECTIONS).ok_or(short)?);
    let table_end = header::SIZE + count * entry::SIZE;
    let table = image
        .get(header::SIZE..table_end)
        .ok_or(truncated(table_end))?;
    let covered = head.get(..header::CRC.start).ok_or(short)?;
    if u32_at(head, header::CRC) != Some(crc32(&[covered, table])) {
        return Err(ImageError::HeaderChecksum);
    }
    let mut sections = Sections::new();
    let mut place = table_end;
    for (index, bytes) in table.chunks_exact(entry::SIZE).enumerate() {
        let section = section(image, index, bytes, &mut place)?;
        let in_order = sections
            .last()
            .is_none_or(|last| (last.kind, last.selector) < (section.kind, section.selector));
        let only = section.kind == SectionKind::Operator || section.selector == 0;
        let problem = |problem| ImageError::Section {
            section: section.kind,
            problem,
        };
        if !in_order {
            return Err(problem(SectionProblem::Order));
        }
        if !only {
            return Err(problem(SectionProblem::Selector));
        }
        sections
            .push(section)
            .map_err(|section| ImageError::Section {
                section: section.kind,
                problem: SectionProblem::Order,
            })?;
    }
    if place != given {
        return Err(ImageError::Length {
            stated: place,
            given,
        });
    }
    Ok(sections)
}

/// One entry of the section table; `place` is where the section must start and
/// becomes where the next one must.
fn section<'a>(
    image: &'a [u8],
    index: usize,
    bytes: &[u8],
    place: &mut usize,
) -> Result<Section<'a>, ImageError> {
    let number = u16_at(bytes, entry::KIND).unwrap_or(0);
    let kind = SectionKind::from_number(number).ok_or(ImageError::UnknownSection {
        index,
        kind: number,
    })?;
    let problem = |problem| ImageError::Section {
        section: kind,
        problem,
    };
    let field = |field| u32_at(bytes, field).unwrap_or(0) as usize;
    let (start, length) = (field(entry::OFFSET), field(entry::LENGTH));
    let end = start
        .checked_add(length)
        .ok_or(problem(SectionProblem::Place))?;
    let padded = end
        .checked_next_multiple_of(ALIGNMENT)
        .ok_or(problem(SectionProblem::Place))?;
    let (content, padding) = match (image.get(start..end), image.get(end..padded)) {
        (Some(content), Some(padding)) if start == *place => (content, padding),
        _ => return Err(problem(SectionProblem::Place)),
    };
    if padding.iter().any(|byte| *byte != 0) {
        return Err(problem(SectionProblem::Padding));
    }
    if u32_at(bytes, entry::CRC) != Some(crc32(&[content])) {
        return Err(ImageError::SectionChecksum { section: kind });
    }
    *place = padded;
    Ok(Section {
        kind,
        selector: u16_at(bytes, entry::SELECTOR).unwrap_or(0),
        bytes: content,
    })
}

fn optional<'a>(sections: &Sections<'a>, kind: SectionKind) -> Option<Section<'a>> {
    sections
        .iter()
        .copied()
        .find(|section| section.kind == kind)
}

fn required<'a>(sections: &Sections<'a>, kind: SectionKind) -> Result<Section<'a>, ImageError> {
    optional(sections, kind).ok_or(ImageError::Section {
        section: kind,
        problem: SectionProblem::Missing,
    })
}

impl Section<'_> {
    fn length_error(self) -> ImageError {
        ImageError::Section {
            section: self.kind,
            problem: SectionProblem::Length,
        }
    }

    fn field_error(self, field: &'static str, offset: usize) -> ImageError {
        ImageError::Field {
            section: self.kind,
            field,
            offset,
        }
    }
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

fn ambient(section: Section<'_>, count: usize) -> Result<Halfwords<'_>, ImageError> {
    let words = halfwords(section, count)?;
    match words
        .run(0, count)
        .position(|bits| Light::from_bits(bits) > Light::ONE)
    {
        None => Ok(words),
        Some(index) => Err(section.field_error("ambient light", 2 * index)),
    }
}

fn response(section: Section<'_>, channels: u8) -> Result<Halfwords<'_>, ImageError> {
    let words = Halfwords::new(section.bytes).ok_or(section.length_error())?;
    let own = usize::from(channels) * RESPONSE_KNOTS;
    if words.len() != RESPONSE_KNOTS && words.len() != own {
        return Err(section.length_error());
    }
    for start in (0..words.len()).step_by(RESPONSE_KNOTS) {
        let falls = |index: &usize| words.get(*index) < words.get(index.saturating_sub(1));
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
        let differs = |(index, stored): (usize, &u8)| *stored != code(index, response);
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

fn operator<'a>(
    sections: &Sections<'a>,
    meta: &Meta,
    basis: &Basis,
    tiers: usize,
) -> Result<Option<Operator<'a>>, ImageError> {
    let of_operator = |section: &&Section<'a>| section.kind == SectionKind::Operator;
    if !sections.iter().any(|section| of_operator(&section)) {
        return match (meta.accumulator_bound, meta.correction_bound) {
            (0, 0) => Ok(None),
            _ => Err(ImageError::Operator(OperatorError::BoundsDiffer)),
        };
    }
    let mut segments: Vec<Segment<'a>, MAX_SEGMENTS> = Vec::new();
    for (index, section) in sections.iter().filter(of_operator).enumerate() {
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
    let operator =
        Operator::new(basis, segments, meta.channel_scales).map_err(ImageError::Operator)?;
    let bounds = operator.bounds();
    if (bounds.accumulator, bounds.correction) != (meta.accumulator_bound, meta.correction_bound) {
        return Err(ImageError::Operator(OperatorError::BoundsDiffer));
    }
    Ok(Some(operator))
}

/// A tier must cost what the image says: the governor plans with it.
fn check_costs(
    operator: Option<&Operator<'_>>,
    tiers: &[TierInfo],
    channels: u8,
) -> Result<(), ImageError> {
    for (tier, info) in (0_u8..).zip(tiers) {
        let cost = operator.map_or((0, 0), |operator| operator.cost(tier, channels));
        if cost != (info.entries, info.multiplications) {
            return Err(ImageError::Operator(OperatorError::CostDiffers { tier }));
        }
    }
    Ok(())
}

fn provenance(section: Section<'_>) -> Result<&str, ImageError> {
    if section.bytes.len() > MAX_PROVENANCE {
        return Err(section.length_error());
    }
    core::str::from_utf8(section.bytes)
        .map_err(|error| section.field_error("text", error.valid_up_to()))
}
