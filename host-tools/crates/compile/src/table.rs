//! Compiling: from an inverse to a checked image.

use super::gain::FineGains;
use super::image::{ImageWriter, halfwords, operator_sections, projector_section};
use super::ladder::{self, Ladder, Part};
use super::quantise::{TooStrong, quantise};
use super::reference_white::{brightest_black, uniform_white};
use super::response;
use fixed::types::{U0F32, U1F15, U8F24};
use iltm_picture::ProjectorResponse;
use iltm_runtime::{
    FrameSize, Grid,
    haar::Basis,
    image::{
        ImageError, Label, Meta, Table, TierInfo,
        layout::{MAX_PROVENANCE, SectionKind},
    },
    operator::{Bounds, Channels, Operator, OperatorError, Segment},
    pipeline::raised_curves,
    placement::ProjectorPixels,
    units::Light,
};
use iltm_solve::{Interreflection, InverseTransport, natural_images};
use std::ops::Range;
use thiserror::Error;

/// What a table needs beside the inverse.
#[derive(Clone, Debug, Default)]
pub struct CompileOptions {
    /// The projector's response.
    pub projector: ProjectorResponse,
    /// The projector's pixels, where its size is known.
    pub pixels: Option<ProjectorPixels>,
    /// Light of reference white in camera units; by default the brightest uniform
    /// grey that every live cell reaches.
    pub reference_white: Option<f64>,
    /// Raises black to the brightest that is left of the room's light and the projectors' black.
    pub match_black: bool,
    /// Predicted closed-loop error of the inverse.
    pub inverse_error: f64,
    /// Errors that the tiers above 0 aim for, descending; by default
    /// [`TARGETS`](super::ladder::TARGETS).
    pub targets: Option<Vec<f64>>,
    /// Where the table comes from: text for people, at most 64 KiB.
    pub provenance: String,
    /// What people call the table.
    pub label: Label,
}

/// What the image can hold as the light of reference white, camera units.
const WHITES: Range<f64> = 1.0 / 16_777_216.0..256.0;

/// Light under black that can come from a camera, in camera units.
const MOST_AMBIENT: f64 = 256.0;

/// A table image and how it came about.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// The image, checked.
    pub image: Vec<u8>,
    /// Light of reference white, camera units.
    pub white: f64,
    /// What the tiers leave out.
    pub ladder: Ladder,
}

/// Why an inverse cannot become a table.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum CompileError {
    /// No cell is live, or none can be lit.
    #[error("no cell of the scene can reach any brightness")]
    Dark,
    /// The reference white is not a positive number the image can hold.
    #[error(
        "a reference white of {light} camera units; it must be at least 2^-24 (6e-8) and below 256"
    )]
    ReferenceWhite {
        /// The light asked for.
        light: f64,
    },
    /// The reference white that was asked for is far from what the projector reaches.
    #[error(
        "a reference white of {light} is {:.1} times {uniform:.4}, the brightest even grey that the projector reaches", light / uniform
    )]
    BeyondReach {
        /// The light asked for.
        light: f64,
        /// The brightest even grey that every live cell reaches.
        uniform: f64,
    },
    /// Content to choose the reference white by is grey, and the scene has colours.
    #[error("the content is grey, but the table drives three colours")]
    GreyContent,
    /// A predicted error or a tier's target is no error.
    #[error("an error of {error}; an error is a number from 0")]
    Error {
        /// What was given.
        error: f64,
    },
    /// A number of the inverse is not finite.
    #[error("the inverse has a value that is not finite in {place}")]
    NotFinite {
        /// Where.
        place: &'static str,
    },
    /// Light under black that no camera gives.
    #[error(
        "the ambient light of cell {cell} is {light:.1e} camera units; at most {MOST_AMBIENT:.0} can be"
    )]
    Ambient {
        /// The cell.
        cell: usize,
        /// Its light.
        light: f64,
    },
    /// A row of the operator is too strong to be stored.
    #[error("row {row} of the operator is too strong for the table's number format")]
    TooStrong {
        /// Row of the operator.
        row: usize,
    },
    /// A gain is above what the table can hold.
    #[error(
        "the gain of cell {cell} is {gain:.1} times reference white; at most 32,767 can be stored"
    )]
    Gain {
        /// The cell.
        cell: usize,
        /// Its gain relative to reference white.
        gain: f64,
    },
    /// The provenance text is too long.
    #[error("the provenance text has {bytes} bytes; at most {MAX_PROVENANCE} can be stored")]
    Provenance {
        /// Its length.
        bytes: usize,
    },
    /// The operator could overflow.
    #[error("the operator cannot be stored: {0}")]
    Operator(OperatorError),
    /// The runtime refuses the image.
    #[error("the runtime refuses the table: {0}")]
    Image(ImageError),
}

impl CompileError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Dark => "Check that the flood photograph shows the projection.",
            Self::BeyondReach { .. } => {
                "Leave --white away, or give --content FILE: it finds the brightest white for what you show."
            }
            Self::ReferenceWhite { .. } => "Leave the reference white to the default.",
            Self::GreyContent => {
                "Convert it to colour: `ffmpeg -i VIDEO -pix_fmt yuv420p OUT.y4m`."
            }
            Self::Error { .. } => "Solve again: the prediction that was given is not usable.",
            Self::Provenance { .. } => "Shorten the scene's name.",
            Self::NotFinite { .. }
            | Self::Ambient { .. }
            | Self::TooStrong { .. }
            | Self::Gain { .. } => {
                "Take the photographs again: the inverse that they give is not usable."
            }
            Self::Operator(_) | Self::Image(_) => {
                "Please report this with the capture: a table should never get here."
            }
        }
    }
}

/// Compiles an inverse into a checked image.
///
/// # Errors
/// [`CompileError`] if the inverse has no brightness to give, is not finite, or
/// cannot be stored.
pub fn compile(
    inverse: &InverseTransport,
    fine: Option<&FineGains>,
    options: &CompileOptions,
) -> Result<Compiled, CompileError> {
    check_finite(inverse)?;
    if options.provenance.len() > MAX_PROVENANCE {
        return Err(CompileError::Provenance {
            bytes: options.provenance.len(),
        });
    }
    check_options(options)?;
    let white = options.reference_white.or_else(|| uniform_white(inverse));
    let white = white.ok_or(CompileError::Dark)?;
    if !WHITES.contains(&white) {
        return Err(CompileError::ReferenceWhite { light: white });
    }
    let content = natural_images(inverse.grid) * white;
    let ladder = ladder::build(
        inverse,
        &live_only(inverse, content),
        options.targets.as_deref().unwrap_or(&ladder::TARGETS),
    );
    let basis = Basis::new(inverse.grid);
    let operator = StoredOperator::new(inverse, &basis, &ladder, white)?;
    let gains = Gains::new(inverse, fine, white)?;
    let channels = inverse.channels.len() as u8;

    let mut image = ImageWriter::default();
    let head = Meta {
        grid: inverse.grid,
        channels,
        gain_fraction: gains.fraction,
        reference_white: U8F24::saturating_from_num(white).max(U8F24::DELTA),
        inverse_error: U0F32::saturating_from_num(options.inverse_error.max(0.0)),
        bounds: operator.bounds,
        channel_scales: operator.scales,
        label: options.label,
    };
    image.section(SectionKind::Meta, 0, head.emit().to_vec());
    image.section(SectionKind::Tiers, 0, tiers(&ladder, &operator));
    image.section(SectionKind::Gain, 0, halfwords(gains.cells.iter().copied()));
    if let Some(ambient) = ambient(inverse, &gains, white) {
        if options.match_black {
            let black = Light::saturating_from_num(brightest_black(inverse) / white);
            let curves = raised_curves(black.min(Light::ONE));
            let bytes = curves.as_flattened().as_flattened().to_vec();
            image.section(SectionKind::Light, 0, bytes);
        }
        image.section(SectionKind::Ambient, 0, halfwords(ambient));
    }
    if let Some(knots) = response::knots(&options.projector, inverse.channels.len()) {
        image.section(SectionKind::Codes, 0, response::codes(&knots));
        image.section(SectionKind::Response, 0, halfwords(knots));
    }
    if let Some(bytes) = fine.and_then(|fine| gains.fine_section(fine.size)) {
        image.section(SectionKind::FineGain, 0, bytes);
    }
    for (selector, bytes) in operator.sections {
        image.section(SectionKind::Operator, selector, bytes);
    }
    let provenance = options.provenance.clone().into_bytes();
    image.section(SectionKind::Provenance, 0, provenance);
    if let Some(pixels) = options.pixels {
        image.section(SectionKind::Projector, 0, projector_section(pixels));
    }
    let image = image.finish();
    Table::check(&image).map_err(CompileError::Image)?;
    Ok(Compiled {
        image,
        white,
        ladder,
    })
}

fn check_options(options: &CompileOptions) -> Result<(), CompileError> {
    let targets = options.targets.iter().flatten();
    let errors = std::iter::once(&options.inverse_error).chain(targets);
    for error in errors {
        if !(0.0..=f64::MAX).contains(error) {
            return Err(CompileError::Error { error: *error });
        }
    }
    Ok(())
}

fn check_finite(inverse: &InverseTransport) -> Result<(), CompileError> {
    let refuse = |place| Err(CompileError::NotFinite { place });
    let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    if !inverse.shared.is_finite() {
        return refuse("the shared operator");
    }
    for channel in &inverse.channels {
        let deviation = channel.deviation.as_ref();
        if !deviation.is_none_or(Interreflection::is_finite) || !channel.scale.is_finite() {
            return refuse("a channel's operator");
        }
        if !finite(&channel.gain) {
            return refuse("the gains");
        }
        if !finite(&channel.ambient) {
            return refuse("the ambient light");
        }
        let ambient = channel.ambient.iter().enumerate();
        let largest = ambient.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        if let Some((cell, light)) = largest.filter(|(_, light)| light.abs() > MOST_AMBIENT) {
            return Err(CompileError::Ambient {
                cell,
                light: *light,
            });
        }
    }
    Ok(())
}

/// Content with the cells dark that took no part in the solve.
fn live_only(
    inverse: &InverseTransport,
    mut content: nalgebra::DMatrix<f64>,
) -> nalgebra::DMatrix<f64> {
    for (mut row, live) in content.row_iter_mut().zip(&inverse.live) {
        if !live {
            row.fill(0.0);
        }
    }
    content
}

/// The operator as sections, with its proof.
struct StoredOperator {
    sections: Vec<(u16, Vec<u8>)>,
    scales: [U1F15; 3],
    bounds: Bounds,
    costs: Vec<(u32, u32)>,
}

impl StoredOperator {
    fn new(
        inverse: &InverseTransport,
        basis: &Basis,
        ladder: &Ladder,
        white: f64,
    ) -> Result<Self, CompileError> {
        let largest = inverse.channels.iter().map(|c| c.scale).fold(0.0, f64::max);
        let mut scales = [U1F15::ZERO; 3];
        for (scale, channel) in scales.iter_mut().zip(&inverse.channels) {
            *scale = if largest > 0.0 {
                U1F15::saturating_from_num((channel.scale / largest).clamp(0.0, 1.0))
            } else {
                U1F15::ONE
            };
        }
        let factor = |part| match part {
            Part::Shared => white * largest,
            // The runtime multiplies by the channel's scale afterwards.
            Part::Channel(channel) => {
                white
                    / scales[usize::from(channel)]
                        .max(U1F15::DELTA)
                        .to_num::<f64>()
            }
        };
        let functions: Vec<_> = basis.functions().collect();
        let mut quantised = Vec::new();
        for (tier, info) in (1..).zip(&ladder.tiers) {
            let entries = &ladder.entries[..info.entries];
            let segments = quantise(&functions, tier, entries, factor)
                .map_err(|TooStrong { row }| CompileError::TooStrong { row })?;
            quantised.extend(segments);
        }
        let sections = operator_sections(basis.grid().cells(), &quantised);
        let (bounds, costs) = {
            let operator = load(basis, functions.len(), &sections, scales)?;
            let channels = inverse.channels.len() as u8;
            let tiers = 0..=ladder.tiers.len() as u8;
            let costs = tiers.map(|tier| operator.cost(tier, channels)).collect();
            (operator.bounds(), costs)
        };
        Ok(Self {
            sections,
            scales,
            bounds,
            costs,
        })
    }
}

/// The stored operator as the runtime will see it, with its proof.
pub(crate) fn load<'a>(
    basis: &Basis,
    inputs: usize,
    sections: &'a [(u16, Vec<u8>)],
    scales: [U1F15; 3],
) -> Result<Operator<'a>, CompileError> {
    let mut segments = heapless::Vec::new();
    for (index, (selector, bytes)) in sections.iter().enumerate() {
        let [tier, channel] = selector.to_le_bytes();
        let channels = channel.checked_sub(1).map_or(Channels::All, Channels::One);
        let segment = Segment::new(index, tier, channels, bytes).map_err(CompileError::Operator)?;
        segments
            .push(segment)
            .map_err(|_| CompileError::Operator(OperatorError::Segments))?;
    }
    Operator::new(basis, inputs, segments, scales).map_err(CompileError::Operator)
}

/// The tiers section.
fn tiers(ladder: &Ladder, operator: &StoredOperator) -> Vec<u8> {
    let errors = ladder.tiers.iter().map(|tier| tier.error);
    let errors = std::iter::once(ladder.gain_only).chain(errors);
    let entry = |(error, &(entries, multiplications)): (f64, &(u32, u32))| {
        let predicted_error = U0F32::saturating_from_num(error.max(0.0));
        TierInfo {
            predicted_error,
            entries,
            multiplications,
        }
        .emit()
    };
    errors.zip(&operator.costs).flat_map(entry).collect()
}

/// Gains as the image stores them.
pub(crate) struct Gains {
    pub(crate) fraction: u8,
    pub(crate) cells: Vec<u16>,
    pub(crate) fine: Option<Vec<u16>>,
}

impl Gains {
    fn new(
        inverse: &InverseTransport,
        fine: Option<&FineGains>,
        white: f64,
    ) -> Result<Self, CompileError> {
        let cells: Vec<&[f64]> = inverse.channels.iter().map(|c| c.gain.as_slice()).collect();
        Self::stored(&cells, fine, white)
    }

    /// All gains, of light relative to `white`, with the most fraction bits that the largest one
    /// leaves.
    pub(crate) fn stored(
        cells: &[&[f64]],
        fine: Option<&FineGains>,
        white: f64,
    ) -> Result<Self, CompileError> {
        let fine: Option<Vec<&[f64]>> =
            fine.map(|fine| fine.channels.iter().map(Vec::as_slice).collect());
        let all = cells.iter().chain(fine.iter().flatten());
        let largest = all
            .flat_map(|gain| gain.iter())
            .fold(0.0_f64, |a, b| a.max(*b))
            * white;
        let fits = |fraction: &u8| largest * f64::from(*fraction).exp2() <= f64::from(u16::MAX);
        let Some(fraction) = (1..=15).rev().find(fits) else {
            let own = cells.iter().flat_map(|gain| gain.iter().enumerate());
            let cell = own
                .max_by(|a, b| a.1.total_cmp(b.1))
                .map_or(0, |(cell, _)| cell);
            return Err(CompileError::Gain {
                cell,
                gain: largest,
            });
        };
        let unit = white * f64::from(fraction).exp2();
        let store = |channels: &[&[f64]]| interleave(channels, |gain| (gain * unit).round() as u16);
        Ok(Self {
            fraction,
            cells: store(cells),
            fine: fine.as_deref().map(store),
        })
    }

    /// The section of the fine ones, of this size.
    pub(crate) fn fine_section(&self, size: FrameSize) -> Option<Vec<u8>> {
        let values = self.fine.clone()?;
        let sides = [size.height(), size.width()];
        let mut bytes = halfwords(sides.map(|side| side as u16));
        bytes.extend(halfwords(values));
        Some(bytes)
    }
}

/// Ambient light as the image stores it; `None` if every cell rounds to none.
fn ambient(inverse: &InverseTransport, gains: &Gains, white: f64) -> Option<Vec<u16>> {
    let channels = inverse.channels.iter();
    let channels: Vec<&[f64]> = channels.map(|c| c.ambient.as_slice()).collect();
    stored_ambient(&channels, (gains, inverse.grid), white)
}

/// Ambient light relative to `white` as the image stores it; `None` if every cell rounds to none.
///
/// Cells that the projector does not reach have no gain. Stored is the drive, not the light, that the
/// cells beside them have on average, because pixels of those cells are interpolated towards it.
pub(crate) fn stored_ambient(
    channels: &[&[f64]],
    (gains, grid): (&Gains, Grid),
    white: f64,
) -> Option<Vec<u16>> {
    let one = Light::ONE.to_bits();
    let bits = |light: f64| {
        let bits = (light / white * f64::from(one)).round();
        (bits as u16).min(one)
    };
    let mut stored = interleave(channels, bits);
    let own = stored.clone();
    let unit = f64::from(gains.fraction).exp2();
    let (rows, cols) = (grid.rows(), grid.cols());
    let unreached = stored.iter_mut().zip(&gains.cells).enumerate();
    for (at, (value, _)) in unreached.filter(|(_, (_, gain))| **gain == 0) {
        let (cell, channel) = (at / channels.len(), at % channels.len());
        let (row, col) = (cell / cols, cell % cols);
        let above = row.checked_sub(1).map(|row| (row, col));
        let left = col.checked_sub(1).map(|col| (row, col));
        let below = (row + 1 < rows).then_some((row + 1, col));
        let right = (col + 1 < cols).then_some((row, col + 1));
        let beside = [above, left, below, right].into_iter().flatten();
        let beside = beside.map(|(row, col)| (row * cols + col) * channels.len() + channel);
        let reached = beside.filter(|at| gains.cells[*at] > 0);
        let drives = reached.map(|at| f64::from(gains.cells[at]) / unit * f64::from(own[at]));
        let (sum, count) = drives.fold((0.0, 0.0), |(sum, count), d| (sum + d, count + 1.0));
        *value = ((sum / f64::max(count, 1.0)).round() as u16).min(one);
    }
    stored.iter().any(|bits| *bits > 0).then_some(stored)
}

/// Channels of a cell side by side.
fn interleave(channels: &[&[f64]], store: impl Fn(f64) -> u16) -> Vec<u16> {
    let cells = channels.first().map_or(0, |channel| channel.len());
    let at = |cell: usize| channels.iter().map(move |channel| channel[cell]);
    (0..cells).flat_map(at).map(store).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_that_the_projector_does_not_reach_have_the_drive_of_those_beside_them() {
        // Gains 1, 2, 0 above and 0, 4, 0 below, in two channels, the second half as bright.
        let grid = Grid::new(2, 3).unwrap();
        let gains = Gains {
            fraction: 12,
            cells: [1, 2, 0, 0, 4, 0]
                .into_iter()
                .flat_map(|gain| [gain << 12; 2])
                .collect(),
            fine: None,
        };
        let light = [0.2, 0.1, 0.7, 0.7, 0.1, 0.7];
        let half = light.map(|light| light / 2.0);
        let stored = stored_ambient(&[&light, &half], (&gains, grid), 1.0).unwrap();
        let expected = [0.2, 0.1, 0.2, 0.3, 0.1, 0.4];
        for (cell, light) in expected.into_iter().enumerate() {
            for (channel, light) in [light, light / 2.0].into_iter().enumerate() {
                let bits = f64::from(stored[2 * cell + channel]);
                let off = (bits / f64::from(Light::ONE.to_bits()) - light).abs();
                assert!(off < 2e-4, "{cell} {channel}: {bits}");
            }
        }
        assert!(stored_ambient(&[&[0.0; 6]], (&gains, grid), 1.0).is_none());
    }
}
