//! Made-up tables: any gains, ambient light, response and operator, without a scene behind
//! them.

use fastrand::Rng;
use fixed::types::{U0F32, U1F15, U8F24};
use iltm::compile::image::{
    ImageWriter, StoredRow, neighbours_section, projector_section, segment_bytes,
};
use iltm::compile::response;
use iltm::picture::{ProjectorResponse, Response};
use iltm_runtime::Grid;
use iltm_runtime::haar::Basis;
use iltm_runtime::image::layout::SectionKind;
use iltm_runtime::image::{Label, Meta, TierInfo};
use iltm_runtime::operator::{Bounds, Channels, Operator, OperatorError, Segment};
use iltm_runtime::pipeline::raised_curves;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::units::Light;
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
    /// Ambient light in the same way, bits of [`Light`].
    pub ambient: Option<Vec<u16>>,
    /// Light that black is raised to, bits of [`Light`]; none if zero.
    pub black: u16,
    /// Whether codes follow a projector's response (sRGB).
    pub response: bool,
    /// Whether each channel then has another response.
    pub of_channels: bool,
    /// Gains finer than the cells: rows, columns, and gains as above.
    pub fine_gains: Option<(u16, u16, Vec<u16>)>,
    /// The projector that it was made with, where that is known.
    pub projector: Option<ProjectorPixels>,
    /// Rows of the operator in each tier above 0, those of lower tiers included; no tier
    /// without an operator.
    pub tiers: Vec<Vec<StoredRow>>,
    /// Scale of the operator in each channel that there is.
    pub scales: [U1F15; 3],
    /// Cells of the projectors on the left and on the right, and their ambient light where the own
    /// cells have some.
    pub neighbours: Option<(Grid, [u8; 2], Vec<u16>)>,
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
            black: 0,
            response: false,
            of_channels: false,
            fine_gains: None,
            projector: None,
            tiers: Vec::new(),
            scales,
            neighbours: None,
        }
    }

    /// The same as one of several projectors: with a random entry more in each row, of one of these
    /// cells of its neighbours.
    pub fn with_neighbours(mut self, grid: Grid, around: [u8; 2], seed: u64) -> Self {
        let mut random = Rng::with_seed(seed);
        let own = self.grid.cells();
        for row in self.tiers.iter_mut().flatten() {
            let at = random.usize(own..own + grid.cells()) as u16;
            let most = row.entries.iter().map(|(_, value)| value.abs()).max();
            row.entries.push((at, most.unwrap_or(1).max(1)));
        }
        let samples = grid.cells() * self.channels;
        let light = self.ambient.as_ref().map_or(0, |_| samples);
        let ambient = (0..light).map(|_| random.u16(..900)).collect();
        self.neighbours = Some((grid, around, ambient));
        self
    }

    /// Input coefficients of a channel.
    fn inputs(&self) -> usize {
        let others = self.neighbours.as_ref();
        self.grid.cells() + others.map_or(0, |(grid, ..)| grid.cells())
    }

    /// Just under gain 1, so that natural frames are not clipped more than usual, and with
    /// ambient light if wanted.
    pub fn nearly_plain(grid: Grid, channels: usize, ambient: bool) -> Self {
        let mut table = Self::new(grid, channels);
        table.gains.fill(7_800);
        table.ambient = ambient.then(|| vec![330; table.gains.len()]);
        table
    }

    /// Gains, ambient light and an operator of one tier that are random: up to `entries`
    /// entries a row, as large as the proof of the bounds takes.
    pub fn random(grid: Grid, channels: usize, entries: usize, seed: u64) -> Self {
        let mut random = Rng::with_seed(seed);
        let samples = grid.cells() * channels;
        let mut made = Self::new(grid, channels);
        made.gains = (0..samples).map(|_| random.u16(3_000..9_000)).collect();
        made.ambient = Some((0..samples).map(|_| random.u16(..900)).collect());
        if channels == 3 {
            made.scales[1] = U1F15::from_num(0.7);
        }
        if grid.cells() == 1 {
            // A single cell lights no other.
            return made;
        }
        let basis = Basis::new(grid);
        let rows = (0..).zip(basis.functions()).map(|(index, function)| {
            // Fifteen levels of three functions stay below 2^30 with these.
            let most = (24_000 / function.peak() / entries as u64).clamp(1, 8_000) as i16;
            let mut places: Vec<u16> = (0..=random.usize(..entries))
                .map(|_| random.u16(..grid.cells() as u16))
                .collect();
            places.sort_unstable();
            places.dedup();
            let entry = |at| (at, random.i16(-most..=most));
            StoredRow {
                index,
                shift: 6,
                entries: places.into_iter().map(entry).collect(),
            }
        });
        made.tiers = vec![rows.collect()];
        made
    }

    /// [`random`](Self::random), with every second row in a tier of its own, a response,
    /// and gains four times finer than the cells.
    pub fn of_all_kinds(grid: Grid, channels: usize, entries: usize, seed: u64) -> Self {
        let mut made = Self::random(grid, channels, entries, seed);
        if let Some(rows) = made.tiers.first() {
            let half = rows.iter().step_by(2).cloned().collect();
            made.tiers.insert(0, half);
        }
        made.response = true;
        made.black = if seed.is_multiple_of(2) { 500 } else { 0 };
        let (rows, cols) = (4 * grid.rows(), 4 * grid.cols());
        let mut random = Rng::with_seed(!seed);
        let gains = (0..rows * cols * channels).map(|_| random.u16(3_000..9_000));
        made.fine_gains = Some((rows as u16, cols as u16, gains.collect()));
        made
    }

    fn operator<'a>(&self, segments: &'a [Vec<u8>]) -> Result<Operator<'a>, OperatorError> {
        let segment = |(tier, bytes): (u8, &'a Vec<u8>)| {
            Segment::new(usize::from(tier) - 1, tier, Channels::All, bytes)
        };
        let segments: Result<_, _> = (1..).zip(segments).map(segment).collect();
        Operator::new(
            &Basis::new(self.grid),
            self.inputs(),
            segments?,
            self.scales,
        )
    }

    /// The bytes of the image. Where the runtime refuses the operator, so does it the
    /// image, for the same reason.
    pub fn image(&self) -> Vec<u8> {
        let tiers = self.tiers.iter();
        let segments: Vec<_> = tiers
            .map(|rows| segment_bytes(self.inputs(), rows))
            .collect();
        let operator = (!segments.is_empty()).then(|| self.operator(&segments));
        let operator = operator.and_then(Result::ok);
        let mut image = ImageWriter::default();
        image.section(
            SectionKind::Meta,
            0,
            self.meta(operator.as_ref()).emit().to_vec(),
        );
        let tiers = (0..=segments.len() as u8).flat_map(|number| {
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
        if self.black > 0 {
            let curves = raised_curves(Light::from_bits(self.black));
            image.section(
                SectionKind::Light,
                0,
                curves.as_flattened().as_flattened().to_vec(),
            );
        }
        if self.response {
            let knots = if self.of_channels {
                let of_channel = |gamma| Response::Gamma(gamma).into();
                let all = ProjectorResponse::of_channels([1.8, 2.2, 2.6].map(of_channel).into());
                response::knots(&all.expect("three"), self.channels)
            } else {
                response::knots(&Response::Srgb.into(), 1)
            };
            let knots = knots.expect("not linear");
            image.section(SectionKind::Codes, 0, response::codes(&knots));
            image.section(SectionKind::Response, 0, halfwords(knots));
        }
        if let Some((rows, cols, gains)) = &self.fine_gains {
            let all = [*rows, *cols].into_iter().chain(gains.iter().copied());
            image.section(SectionKind::FineGain, 0, halfwords(all));
        }
        for (tier, segment) in (1..).zip(&segments) {
            image.section(SectionKind::Operator, tier, segment.clone());
        }
        if let Some(projector) = self.projector {
            image.section(SectionKind::Projector, 0, projector_section(projector));
        }
        if let Some((grid, around, ambient)) = &self.neighbours {
            let bytes = neighbours_section(*grid, *around, ambient.clone());
            image.section(SectionKind::Neighbours, 0, bytes);
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
            label: Label::default(),
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
