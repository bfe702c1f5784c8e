//! Compensation table, checked: its accessors.

use super::bytes::Halfwords;
use super::layout::MAX_TIERS;
use super::{Checked, ImageError, Label, Neighbours, TierInfo};
use crate::features::Stage;
use crate::haar::Basis;
use crate::operator::Operator;
use crate::pipeline::LightCurve;
use crate::placement::{PixelArea, ProjectorPixels};
use crate::response::{CODES, RESPONSE_KNOTS, ResponseCurve};
use crate::units::Light;
use crate::{FrameSize, Grid};
use fixed::types::{U0F32, U8F24};
use heapless::Vec;

/// A compensation table, checked.
///
/// Made from a [`Checked`] image only, so whoever holds one knows that every section
/// is whole and that no frame can overflow.
#[derive(Clone, Debug)]
pub struct Table<'a> {
    pub(super) basis: Basis,
    pub(super) channels: u8,
    pub(super) gain_fraction: u8,
    pub(super) reference_white: U8F24,
    pub(super) inverse_error: U0F32,
    pub(super) tiers: Vec<TierInfo, MAX_TIERS>,
    pub(super) gain: Halfwords<'a>,
    pub(super) ambient: Option<Halfwords<'a>>,
    pub(super) response: Option<Halfwords<'a>>,
    pub(super) codes: &'a [[u8; CODES]],
    pub(super) fine_gain: Option<FineGain<'a>>,
    pub(super) operator: Option<Operator<'a>>,
    pub(super) provenance: &'a [u8],
    pub(super) projector: Option<ProjectorPixels>,
    pub(super) neighbours: Option<Neighbours<'a>>,
    pub(super) light: Option<[&'a LightCurve; 2]>,
    pub(super) bytes: usize,
    pub(super) id: u32,
    pub(super) label: Label,
}

/// Gains on a grid finer than the cells, for frames larger than the grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FineGain<'a> {
    pub(super) size: FrameSize,
    pub(super) channels: u8,
    pub(super) gain: Halfwords<'a>,
}

impl FineGain<'_> {
    /// Its size.
    #[must_use]
    pub const fn size(&self) -> FrameSize {
        self.size
    }

    /// Gains of one channel along one row of the fine grid.
    pub fn row(&self, row: usize, channel: usize) -> impl Iterator<Item = u16> {
        channel_row(self.gain, self.size.width(), self.channels, row, channel)
    }
}

/// Every `channels`-th value of a row of cells.
fn channel_row(
    values: Halfwords<'_>,
    cols: usize,
    channels: u8,
    row: usize,
    channel: usize,
) -> impl Iterator<Item = u16> {
    let channels = usize::from(channels).max(1);
    let start = row
        .saturating_mul(cols)
        .saturating_mul(channels)
        .saturating_add(channel);
    values
        .run(start, cols.saturating_mul(channels))
        .step_by(channels)
}

/// The response of a channel: its own, or that of all.
pub(super) fn curve(response: Option<Halfwords<'_>>, channel: usize) -> ResponseCurve<'_> {
    let knots = response.map_or(&[][..], Halfwords::words);
    let curve = |channel: usize| {
        let start = channel.checked_mul(RESPONSE_KNOTS)?;
        knots.get(start..)?.get(..RESPONSE_KNOTS)
    };
    ResponseCurve::new(curve(channel).or_else(|| curve(0)).unwrap_or_default())
}

impl<'a> Table<'a> {
    /// Checks an image and proves that no frame can overflow.
    ///
    /// Takes time in the order of the image's length; on the reference device
    /// that is once at boot.
    ///
    /// # Errors
    /// [`ImageError`] with the section and field at fault.
    ///
    /// # Fuzzing
    /// Total: any bytes give a table or an error. `tests/fuzz/fuzz_targets/image.rs`
    /// holds it to that.
    pub fn check(image: &'a [u8]) -> Result<Self, ImageError> {
        Self::check_with(image, &mut || {})
    }

    /// The same, with a `yield_now` every few thousand instructions for what cannot wait
    /// until the check is done.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn check_with(
        image: &'a [u8],
        yield_now: &mut (impl FnMut() + ?Sized),
    ) -> Result<Self, ImageError> {
        Ok(Checked::new(image, yield_now)?.table())
    }

    /// The grid of cells.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.basis.grid()
    }

    /// The Haar basis of the grid.
    #[must_use]
    pub const fn basis(&self) -> &Basis {
        &self.basis
    }

    /// Colour channels: 1 or 3.
    #[must_use]
    #[inline]
    pub const fn channels(&self) -> u8 {
        if Stage::Colour.is_built() {
            self.channels
        } else {
            1
        }
    }

    /// What tells it from other tables: the CRC-32 in its header, which covers those
    /// of all sections.
    #[must_use]
    pub const fn id(&self) -> u32 {
        self.id
    }

    /// What people call it.
    #[must_use]
    pub const fn label(&self) -> &Label {
        &self.label
    }

    /// Bytes of the image.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.bytes
    }

    /// Light of reference white in camera units (1 is full scale of the
    /// photographs).
    #[must_use]
    pub const fn reference_white(&self) -> U8F24 {
        self.reference_white
    }

    /// Closed-loop error of the inverse itself, predicted from photographs that
    /// the solve had not seen: `|photograph - wanted| / |wanted|`. Zero where none
    /// could be held out.
    #[must_use]
    pub const fn inverse_error(&self) -> U0F32 {
        self.inverse_error
    }

    /// Fraction bits of [`gain`](Self::gain_row) and of the fine gains.
    #[must_use]
    pub const fn gain_fraction(&self) -> u8 {
        self.gain_fraction
    }

    /// The ladder, tier 0 (gain only) first.
    #[must_use]
    pub fn tiers(&self) -> &[TierInfo] {
        &self.tiers
    }

    /// The most accurate tier.
    #[must_use]
    pub fn top_tier(&self) -> u8 {
        self.tiers.len().saturating_sub(1) as u8
    }

    /// Gains of one channel along a row of cells.
    pub fn gain_row(&self, row: usize, channel: usize) -> impl Iterator<Item = u16> {
        channel_row(self.gain, self.grid().cols(), self.channels, row, channel)
    }

    /// Ambient light of one channel along a row of cells; `None` if the scene is
    /// dark.
    pub fn ambient_row(&self, row: usize, channel: usize) -> Option<impl Iterator<Item = Light>> {
        let ambient = self.lit()?;
        let row = channel_row(ambient, self.grid().cols(), self.channels, row, channel);
        Some(row.map(Light::from_bits))
    }

    /// Light of the codes of frames where black is raised: of sRGB codes, and of codes in
    /// proportion to light.
    #[inline]
    pub(crate) const fn light_curves(&self) -> Option<[&'a LightCurve; 2]> {
        if Stage::Ambient.is_built() {
            self.light
        } else {
            None
        }
    }

    /// Light that is wanted where a frame is black; zero, unless the table raises black to what
    /// projectors leave where they overlap.
    #[must_use]
    pub fn black(&self) -> Light {
        let first = self.light_curves().and_then(|[display, _]| display.first());
        first.map_or(Light::ZERO, |light| {
            Light::from_bits(u16::from_le_bytes(*light))
        })
    }

    /// The projector's response in a channel; [`has_response`](Self::has_response)
    /// says whether it is more than a straight line.
    #[must_use]
    pub fn response(&self, channel: usize) -> ResponseCurve<'a> {
        curve(self.response.filter(|_| self.has_response()), channel)
    }

    /// Whether codes follow a response; otherwise they are proportional to drives.
    #[must_use]
    #[inline]
    pub const fn has_response(&self) -> bool {
        Stage::Response.is_built() && self.response.is_some()
    }

    /// 8-bit projector codes of a channel by the upper bits of the drive
    /// ([`codes`](crate::response)); `None` if the projector is linear.
    #[must_use]
    #[inline]
    pub fn codes(&self, channel: usize) -> Option<&'a [u8; CODES]> {
        if Stage::Response.is_built() {
            self.codes.get(channel).or(self.codes.first())
        } else {
            None
        }
    }

    /// Gains of all cells, little-endian `u16`, channels of a cell side by side.
    pub(crate) const fn gains(&self) -> &'a [[u8; 2]] {
        self.gain.words()
    }

    /// Ambient light of all cells in the same way, [`Light`] bits; `None` if the
    /// scene is dark.
    #[inline]
    pub(crate) fn ambient(&self) -> Option<&'a [[u8; 2]]> {
        self.lit().map(Halfwords::words)
    }

    #[inline]
    const fn lit(&self) -> Option<Halfwords<'a>> {
        if Stage::Ambient.is_built() {
            self.ambient
        } else {
            None
        }
    }

    /// Gains finer than the cells, where the table has them.
    #[must_use]
    pub const fn fine_gain(&self) -> Option<FineGain<'a>> {
        self.fine_gain
    }

    /// The interreflection operator; `None` for a scene without.
    #[must_use]
    #[inline]
    pub const fn operator(&self) -> Option<&Operator<'a>> {
        if Stage::Operator.is_built() {
            self.operator.as_ref()
        } else {
            None
        }
    }

    /// The projector that the table was made with, where that is known.
    #[must_use]
    pub const fn projector(&self) -> Option<ProjectorPixels> {
        self.projector
    }

    /// The other projectors, if this is the table of one of several.
    #[must_use]
    #[inline]
    pub const fn neighbours(&self) -> Option<&Neighbours<'a>> {
        if Stage::Neighbours.is_built() {
            self.neighbours.as_ref()
        } else {
            None
        }
    }

    /// Input coefficients of a channel: of its own cells, then of its neighbours'.
    #[must_use]
    pub fn inputs(&self) -> usize {
        let others = self.neighbours().map_or(0, |others| others.grid().cells());
        self.grid().cells() + others
    }

    /// The pixels that cells cover of a frame of more than one pixel a cell: all, where
    /// nothing is known of the projector. `None` if the frame has another aspect than the
    /// projector, or a cell would have no pixel.
    #[must_use]
    pub fn area(&self, frame: FrameSize) -> Option<PixelArea> {
        let area = match self.projector {
            None => Some(PixelArea::all(frame)),
            Some(projector) if projector.has_aspect_of(frame) => projector.area(frame),
            Some(_) => None,
        };
        area.filter(|area| area.size.holds(self.grid()))
    }

    /// Where the table comes from, for people and host tools.
    #[must_use]
    pub fn provenance(&self) -> &'a str {
        core::str::from_utf8(self.provenance).unwrap_or_default()
    }
}
