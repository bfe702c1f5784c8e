//! Check of an image: what its sections say, and that no frame can overflow.

use super::bytes::{Halfwords, u16_at, u32_at};
use super::layout::{MAX_PROVENANCE, MAX_TIERS, SectionKind, fine_gain, header, projector, tier};
use super::sections::{Section, Whole};
use super::table::curve;
use super::{FineGain, ImageError, Meta, Neighbours, SectionProblem, Table, TierInfo};
use crate::features::Stage;
use crate::haar::Basis;
use crate::operator::layout::MAX_SEGMENTS;
use crate::operator::{Bounds, Channels, Operator, OperatorError, Segment};
use crate::pipeline::{LightCurve, plain, raised};
use crate::placement::ProjectorPixels;
use crate::response::{CODES, RESPONSE_KNOTS, code_of_index};
use crate::units::{Halfword, Light};
use crate::yield_budget::{YieldBudget, cost};
use crate::{FrameSize, Grid};
use heapless::Vec;

/// An image that passed the check: small, and all that a [`Table`] is made from.
///
/// A check needs its memory while it runs and a table needs its own for as long as it
/// is used; on a small device the two should not be there at once.
#[derive(Clone, Copy, Debug)]
pub struct Checked<'a> {
    whole: Whole<'a>,
    meta: Meta,
    gain: Halfwords<'a>,
    ambient: Option<Halfwords<'a>>,
    response: Option<Halfwords<'a>>,
    codes: &'a [[u8; CODES]],
    fine_gain: Option<FineGain<'a>>,
    provenance: &'a [u8],
    projector: Option<ProjectorPixels>,
    neighbours: Option<Neighbours<'a>>,
    light: Option<[&'a LightCurve; 2]>,
}

impl<'a> Checked<'a> {
    /// Checks an image as [`Table::check_with`] does.
    ///
    /// # Errors
    /// [`ImageError`] with the section and field at fault.
    pub fn new(
        image: &'a [u8],
        yield_now: &mut (impl FnMut() + ?Sized),
    ) -> Result<Self, ImageError> {
        let mut budget = YieldBudget::new(yield_now);
        Self::of(Whole::new(image, &mut budget)?, &mut budget)
    }

    /// Checks what the sections of an image say whose checksums hold.
    pub(crate) fn of(
        whole: Whole<'a>,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<Self, ImageError> {
        let meta = Meta::parse(whole.required(SectionKind::Meta)?.bytes)?;
        let (grid, values) = (meta.grid, meta.grid.cells() * usize::from(meta.channels));
        let _ = tiers(whole.required(SectionKind::Tiers)?)?;
        check_stages(&whole, &meta)?;
        let gain = halfwords(whole.required(SectionKind::Gain)?, values)?;
        let ambient = of_stage(Stage::Ambient, &whole, SectionKind::Ambient)
            .map(|section| ambient(section, values, budget))
            .transpose()?;
        let response = of_stage(Stage::Response, &whole, SectionKind::Response)
            .map(|section| response(section, meta.channels, budget))
            .transpose()?;
        let fine_gain = of_stage(Stage::FullResolution, &whole, SectionKind::FineGain)
            .map(|section| fine_gains(section, grid, meta.channels))
            .transpose()?;
        let neighbours = of_stage(Stage::Neighbours, &whole, SectionKind::Neighbours)
            .map(|section| Neighbours::parse(section, &meta, ambient.is_some(), budget))
            .transpose()?;
        check_operator(&whole, &meta, inputs(grid, neighbours), budget)?;
        Ok(Self {
            whole,
            meta,
            gain,
            ambient,
            response,
            fine_gain,
            neighbours,
            light: of_stage(Stage::Ambient, &whole, SectionKind::Light)
                .map(|section| light_curves(section, budget))
                .transpose()?,
            provenance: whole
                .optional(SectionKind::Provenance)
                .map_or(Ok(&[][..]), |section| provenance(section, budget))?,
            projector: whole
                .optional(SectionKind::Projector)
                .map(projector_pixels)
                .transpose()?,
            codes: codes(
                of_stage(Stage::Response, &whole, SectionKind::Codes),
                response,
                budget,
            )?,
        })
    }

    /// The table, ready for frames.
    #[must_use]
    pub fn table(&self) -> Table<'a> {
        let mut listed = Vec::new();
        for tier in self
            .whole
            .required(SectionKind::Tiers)
            .and_then(tiers)
            .into_iter()
            .flatten()
        {
            // There are no more than fit; collecting would have code for a panic.
            let _ = listed.push(tier);
        }
        Table {
            basis: Basis::new(self.meta.grid),
            channels: self.meta.channels,
            gain_fraction: self.meta.gain_fraction,
            reference_white: self.meta.reference_white,
            inverse_error: self.meta.inverse_error,
            tiers: listed,
            gain: self.gain,
            ambient: self.ambient,
            response: self.response,
            codes: self.codes,
            fine_gain: self.fine_gain,
            operator: if Stage::Operator.is_built() {
                let inputs = inputs(self.meta.grid, self.neighbours);
                operator(&self.whole, &self.meta, inputs).unwrap_or_default()
            } else {
                None
            },
            provenance: self.provenance,
            projector: self.projector,
            neighbours: self.neighbours,
            light: self.light,
            bytes: self.whole.image.len(),
            id: self.id(),
            label: self.meta.label,
        }
    }

    /// What tells it from other tables; see [`Table::id`].
    #[must_use]
    pub fn id(&self) -> u32 {
        u32_at(self.whole.image, header::CRC).unwrap_or(0)
    }

    /// What its meta section says.
    #[must_use]
    pub const fn meta(&self) -> &Meta {
        &self.meta
    }
}

fn tiers(section: Section<'_>) -> Result<impl ExactSizeIterator<Item = TierInfo>, ImageError> {
    let (entries, rest) = section.bytes.as_chunks::<{ tier::SIZE }>();
    if !rest.is_empty() || entries.is_empty() || entries.len() > MAX_TIERS {
        return Err(section.length_error());
    }
    Ok(entries.iter().map(TierInfo::parse))
}

fn halfwords(section: Section<'_>, count: usize) -> Result<Halfwords<'_>, ImageError> {
    Halfwords::new(section.bytes)
        .filter(|words| words.len() == count)
        .ok_or(section.length_error())
}

fn ambient<'a>(
    section: Section<'a>,
    count: usize,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Result<Halfwords<'a>, ImageError> {
    let words = halfwords(section, count)?;
    let too_much = |bits| {
        budget.spend(1, cost::VALUE);
        Light::from_bits(bits) > Light::ONE
    };
    match words.run(0, count).position(too_much) {
        None => Ok(words),
        Some(index) => Err(section.field_error("ambient light", 2 * index)),
    }
}

/// The light of codes, which must be that of a black that is raised.
fn light_curves<'a>(
    section: Section<'a>,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Result<[&'a LightCurve; 2], ImageError> {
    let words = Halfwords::new(section.bytes).map_or(&[][..], Halfwords::words);
    let (curves, rest) = words.as_chunks();
    let ([display, linear], []) = (curves, rest) else {
        return Err(section.length_error());
    };
    let black = words.first().map_or(0, |black| u16::from_le_bytes(*black));
    if Light::from_bits(black) > Light::ONE {
        return Err(section.field_error("light of black", 0));
    }
    let mut pairs = words.iter().zip(plain().into_iter().flatten());
    let differs = |(stored, plain): (&Halfword, &Halfword)| {
        budget.spend(1, cost::VALUE);
        let [stored, plain] =
            [stored, plain].map(|light| Light::from_bits(u16::from_le_bytes(*light)));
        stored != raised(plain, Light::from_bits(black))
    };
    match pairs.position(differs) {
        None => Ok([display, linear]),
        Some(index) => Err(section.field_error("light", 2 * index)),
    }
}

fn response<'a>(
    section: Section<'a>,
    channels: u8,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Result<Halfwords<'a>, ImageError> {
    let words = Halfwords::new(section.bytes).ok_or(section.length_error())?;
    let own = usize::from(channels) * RESPONSE_KNOTS;
    if words.len() != RESPONSE_KNOTS && words.len() != own {
        return Err(section.length_error());
    }
    for start in (0..words.len()).step_by(RESPONSE_KNOTS) {
        let falls = |index: &usize| {
            budget.spend(1, cost::VALUE);
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
    response: Option<Halfwords<'_>>,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Result<&'a [[u8; CODES]], ImageError> {
    let Some(section) = section else {
        return match response {
            None => Ok(&[]),
            Some(_) => Err(ImageError::Section {
                section: SectionKind::Codes,
                problem: SectionProblem::Missing,
            }),
        };
    };
    let curves = response.map_or(0, Halfwords::len) / RESPONSE_KNOTS;
    let (codes, rest) = section.bytes.as_chunks::<CODES>();
    if !rest.is_empty() || codes.len() != curves {
        return Err(section.length_error());
    }
    for (channel, of_channel) in codes.iter().enumerate() {
        let response = curve(response, channel);
        let differs = |(index, stored): (usize, &u8)| {
            budget.spend(1, cost::CODE);
            *stored != code_of_index(index, response)
        };
        if let Some(index) = of_channel.iter().enumerate().position(differs) {
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

/// The projector, with a border that leaves pixels.
fn projector_pixels(section: Section<'_>) -> Result<ProjectorPixels, ImageError> {
    if section.bytes.len() != projector::SIZE {
        return Err(section.length_error());
    }
    let field = |field| u16_at(section.bytes, field).unwrap_or(0);
    if field(projector::RESERVED) != 0 {
        return Err(section.field_error("reserved", projector::RESERVED.start));
    }
    let size = FrameSize::new(field(projector::WIDTH), field(projector::HEIGHT))
        .ok_or(section.field_error("size", projector::WIDTH.start))?;
    ProjectorPixels::new(size, field(projector::BORDER))
        .ok_or(section.field_error("border", projector::BORDER.start))
}

/// A table with a stage that is not built is refused as a whole: half of its stages
/// would show a frame that is neither the wanted nor the compensated one.
fn check_stages(whole: &Whole<'_>, meta: &Meta) -> Result<(), ImageError> {
    for stage in Stage::ALL {
        let sections: &[SectionKind] = match stage {
            Stage::Operator => &[SectionKind::Operator],
            Stage::Ambient => &[SectionKind::Ambient, SectionKind::Light],
            Stage::Response => &[SectionKind::Response, SectionKind::Codes],
            Stage::Colour => &[],
            Stage::FullResolution => &[SectionKind::FineGain],
            Stage::Neighbours => &[SectionKind::Neighbours],
        };
        let by_section = sections.iter().any(|kind| whole.optional(*kind).is_some());
        let listed = by_section || stage == Stage::Colour && meta.channels > 1;
        if listed && !stage.is_built() {
            return Err(ImageError::NotBuilt(stage));
        }
    }
    Ok(())
}

/// The section of a stage; none where the stage is not built.
#[allow(
    clippy::inline_always,
    reason = "the compiler leaves out what handles a section only where it sees that there is none"
)]
#[inline(always)]
fn of_stage<'a>(stage: Stage, whole: &Whole<'a>, kind: SectionKind) -> Option<Section<'a>> {
    if stage.is_built() {
        whole.optional(kind)
    } else {
        None
    }
}

/// Input coefficients of a channel: of its own cells, and of its neighbours'.
fn inputs(grid: Grid, neighbours: Option<Neighbours<'_>>) -> usize {
    let neighbours = neighbours.filter(|_| Stage::Neighbours.is_built());
    grid.cells() + neighbours.map_or(0, |neighbours| neighbours.grid().cells())
}

/// The operator with the bounds that the image states; `None` for a scene without.
fn operator<'a>(
    whole: &Whole<'a>,
    meta: &Meta,
    inputs: usize,
) -> Result<Option<Operator<'a>>, ImageError> {
    let tiers = tiers(whole.required(SectionKind::Tiers)?)?.len();
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
    if segments.is_empty() {
        return Ok(None);
    }
    Ok(Some(Operator::stated(
        meta.grid,
        inputs,
        segments,
        meta.channel_scales,
        meta.bounds,
    )))
}

/// The bounds and the costs that the image states must be those of its entries: no
/// frame may overflow, and the governor plans with the costs.
///
/// Not inlined: what it needs, other checks need not stand on.
#[inline(never)]
fn check_operator(
    whole: &Whole<'_>,
    meta: &Meta,
    inputs: usize,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Result<(), ImageError> {
    let operator = if Stage::Operator.is_built() {
        operator(whole, meta, inputs)?
    } else {
        None
    };
    let bounds = match &operator {
        Some(operator) => operator.prove(meta.grid, budget),
        None => Ok(Bounds::default()),
    };
    if bounds.map_err(ImageError::Operator)? != meta.bounds {
        return Err(ImageError::Operator(OperatorError::BoundsDiffer));
    }
    let tiers = tiers(whole.required(SectionKind::Tiers)?)?;
    for (tier, info) in (0_u8..).zip(tiers) {
        let cost = operator.as_ref().map_or((0, 0), |operator| {
            operator.cost_yielding(tier, meta.channels, budget)
        });
        if cost != (info.entries, info.multiplications) {
            return Err(ImageError::Operator(OperatorError::CostDiffers { tier }));
        }
    }
    Ok(())
}

/// Checks the text piece by piece, for it may be long.
fn provenance<'a>(
    section: Section<'a>,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Result<&'a [u8], ImageError> {
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
        budget.spend(piece.len(), cost::VALUE);
    }
    Ok(section.bytes)
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{flat, image};
    use super::*;
    use crate::pipeline::raised_curves;
    use std::vec::Vec;

    fn with_projector(fields: &[u16]) -> Result<Option<ProjectorPixels>, ImageError> {
        let bytes: Vec<u8> = fields
            .iter()
            .flat_map(|field| field.to_le_bytes())
            .collect();
        let mut sections = flat(2, 3);
        sections.push((SectionKind::Projector, bytes));
        Table::check(&image(&sections)).map(|table| table.projector())
    }

    /// A table of 4 x 6 cells with this light section: its black.
    fn with_light(bytes: Vec<u8>) -> Result<Light, ImageError> {
        let mut sections = flat(4, 6);
        sections.push((SectionKind::Light, bytes));
        Ok(Table::check(&image(&sections))?.black())
    }

    #[test]
    fn the_light_of_codes_is_that_of_a_raised_black_or_refused() {
        let curves = |black| {
            let curves = raised_curves(Light::from_bits(black));
            curves.as_flattened().as_flattened().to_vec()
        };
        for black in [0, 1, 131, 32_768] {
            assert_eq!(with_light(curves(black)), Ok(Light::from_bits(black)));
        }
        let section = SectionKind::Light;
        let refused = |bytes, error| assert_eq!(with_light(bytes), Err(error));
        let of = |field, offset| ImageError::Field {
            section,
            field,
            offset,
        };
        for length in [0, 1, 512, 1_022, 1_023, 1_026, 2_048] {
            let mut bytes = curves(131);
            bytes.resize(length, 0);
            let problem = SectionProblem::Length;
            refused(bytes, ImageError::Section { section, problem });
        }
        // More than white, and one step off in the first curve and in the last value of all.
        refused([1, 128].repeat(512), of("light of black", 0));
        for at in [2, 511, 512, 1_022] {
            let mut bytes = curves(131);
            bytes[at] ^= 1;
            refused(bytes, of("light", at / 2 * 2));
        }
    }

    #[test]
    fn a_projector_has_a_size_and_a_border_that_leaves_pixels() {
        let projector = with_projector(&[1280, 800, 100, 0]).unwrap().unwrap();
        assert_eq!(
            (projector.size().width(), projector.size().height()),
            (1280, 800)
        );
        assert_eq!(projector.border(), 100);
        let refused = [
            (&[0, 800, 0, 0][..], "size"),
            (&[1280, 0, 0, 0], "size"),
            (&[1280, 800, 400, 0], "border"),
            (&[1280, 800, u16::MAX, 0], "border"),
            (&[1280, 800, 0, 1], "reserved"),
            (&[1280, 800, 0], "length"),
            (&[1280, 800, 0, 0, 0], "length"),
        ];
        for (fields, why) in refused {
            let error = with_projector(fields).unwrap_err();
            assert!(std::format!("{error}").contains(why), "{error}");
        }
    }
}
