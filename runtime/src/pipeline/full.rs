//! Full-resolution rows: frames larger than the grid, row by row.
//!
//! `p(x) = g(x) d'(x) - (U K A d')(x)`. A frame passes twice: once to average
//! its light over the cells ([`FullPipeline::average_row`]), once to apply gain
//! and correction ([`FullPipeline::finish_row`]). Rows may come in any order and
//! from several threads; nothing of the frame is kept here.
//! [`FullPipeline::compensate`] does a whole frame on one thread.

#![allow(
    clippy::inline_always,
    reason = "a host compiles rows for its widest vectors, which a call would leave"
)]

use super::FrameError;
use super::stages::{Workspace, correct, drive_row, driven};
use crate::FrameSize;
use crate::features::Stage;
use crate::haar::ShortSlice;
use crate::image::{FineGain, Table};
use crate::placement::PixelArea;
use crate::resample::area::AreaAverage;
use crate::resample::interpolation::{Axis, blend, blend_rows};
use crate::units::{ClippedSamples, Drive, GAIN_GUARD_BITS, Light};

/// Half of the last place that is kept of an interpolated gain.
const GAIN_HALF: i32 = 1 << (GAIN_GUARD_BITS - 1);

/// Compensates frames of one size, `C` channels. The cells cover all of a frame, or the
/// area of it that [`within`](Self::within) names; rows and their pixels are those of the
/// area.
#[derive(Clone, Copy, Debug)]
pub struct FullPipeline<'t, 'a, const C: usize> {
    table: &'t Table<'a>,
    whole: FrameSize,
    area: PixelArea,
    average: AreaAverage,
    fine_gain: Option<FineGain<'a>>,
    cells: [Axis; 2],
    gains: [Axis; 2],
}

/// Memory for one row of one channel.
#[derive(Debug)]
pub struct RowBuffers<'w> {
    /// Values of the cells that the row crosses,
    /// [`line_len`](FullPipeline::line_len) elements.
    pub line: &'w mut [i32],
    /// Interpolated values along the row, one element a pixel.
    pub spread: &'w mut [i32],
}

impl<'t, 'a, const C: usize> FullPipeline<'t, 'a, C> {
    /// A pipeline for frames of this size.
    ///
    /// # Errors
    /// [`FrameError`] if the table has not `C` channels, the frame is smaller
    /// than the grid, or this build takes no frames larger than it.
    #[inline]
    pub fn new(table: &'t Table<'a>, frame: FrameSize) -> Result<Self, FrameError> {
        Self::within(table, frame, PixelArea::all(frame))
    }

    /// A pipeline for frames of size `whole`, whose cells lie in `area`. What is outside
    /// becomes black; what of the area is outside of the frame is not shown.
    ///
    /// # Errors
    /// As [`new`](Self::new), of the area instead of the frame.
    #[inline]
    pub fn within(
        table: &'t Table<'a>,
        whole: FrameSize,
        area: PixelArea,
    ) -> Result<Self, FrameError> {
        if Stage::FullResolution.is_built() {
            Self::sized(table, whole, area)
        } else {
            Err(FrameError::NotBuilt(Stage::FullResolution))
        }
    }

    fn sized(table: &'t Table<'a>, whole: FrameSize, area: PixelArea) -> Result<Self, FrameError> {
        let frame = area.size;
        if usize::from(table.channels()) != C {
            return Err(FrameError::Channels {
                table: table.channels(),
                pipeline: C as u8,
            });
        }
        Ok(Self {
            whole,
            area,
            ..Self::of_any(table, frame)?
        })
    }

    /// Of frames that cells cover all of, without a look at the number of channels.
    pub(super) fn of_any(table: &'t Table<'a>, frame: FrameSize) -> Result<Self, FrameError> {
        let smaller = FrameError::SmallerThanGrid {
            width: frame.width() as u16,
            height: frame.height() as u16,
        };
        let grid = table.grid();
        // Fine gains are used where the frame can show them, else the cells' own.
        let fine_gain = table.fine_gain().filter(|fine| {
            fine.size().width() <= frame.width() && fine.size().height() <= frame.height()
        });
        let gains = fine_gain.map_or(FrameSize::of_grid(grid), |fine| fine.size());
        let axes = |size: FrameSize| {
            let rows = Axis::new(size.height(), frame.height())?;
            let cols = Axis::new(size.width(), frame.width())?;
            Some([rows, cols])
        };
        Ok(Self {
            table,
            whole: frame,
            area: PixelArea::all(frame),
            average: AreaAverage::new(grid, frame).ok_or(smaller)?,
            fine_gain,
            cells: axes(FrameSize::of_grid(grid)).ok_or(smaller)?,
            gains: axes(gains).ok_or(smaller)?,
        })
    }

    /// The table it works with.
    #[must_use]
    pub const fn table(&self) -> &'t Table<'a> {
        self.table
    }

    /// The size of the area that cells cover: of the frame, unless that has a border.
    #[must_use]
    pub const fn frame(&self) -> FrameSize {
        self.area.size
    }

    /// The size of its frames.
    #[must_use]
    pub const fn whole(&self) -> FrameSize {
        self.whole
    }

    /// Where in a frame the cells lie.
    #[must_use]
    pub const fn area(&self) -> PixelArea {
        self.area
    }

    /// Where its pixels lie between the centres of the cells: rows, then columns.
    #[must_use]
    pub const fn cell_axes(&self) -> [Axis; 2] {
        self.cells
    }

    /// Where its pixels lie between the places of the gains that it uses: rows, then columns.
    #[must_use]
    pub const fn gain_axes(&self) -> [Axis; 2] {
        self.gains
    }

    /// The table's finer gains, where its frames are large enough to show them.
    #[must_use]
    pub const fn fine_gain(&self) -> Option<FineGain<'a>> {
        self.fine_gain
    }

    /// Whether frames of `tier` go through the operator. Those of others need neither
    /// averages nor corrections.
    #[must_use]
    pub const fn operates(&self, tier: u8) -> bool {
        tier > 0 && self.table.operator().is_some()
    }

    pub(super) fn check_tier(&self, tier: u8) -> Result<(), FrameError> {
        let top = self.table.top_tier();
        if tier > top {
            return Err(FrameError::NoSuchTier { tier, top });
        }
        Ok(())
    }

    /// Elements that [`RowBuffers::line`] needs.
    #[must_use]
    pub fn line_len(&self) -> usize {
        let fine = self.fine_gain.map_or(0, |fine| fine.size().width());
        self.table.grid().cols().max(fine)
    }

    /// Ambient light of one channel along row `y`, [`Light`] bits, in the place of the row's
    /// [gains](Self::gain_row); `false` and nothing done in a dark room.
    ///
    /// A table has it by cell, `a`, and paint within a cell reflects it as it reflects all
    /// light: it is `(U g a)(x) / g(x)`. For cells of gain 0 a table has `g a` itself.
    ///
    /// It depends on the frame's size alone, as gains do.
    pub fn ambient_row(
        &self,
        y: usize,
        channel: usize,
        row: &mut RowBuffers<'_>,
        values: &mut [u16],
    ) -> bool {
        let [rows, cols] = self.cells;
        let place = rows.place(y);
        let fraction = u32::from(self.table.gain_fraction());
        let count = self.table.grid().cols();
        let line = row.line.get_mut(..count).unwrap_or_default();
        // All of the first row, then its share of the second one.
        for (at, share) in [(place.before, 1 << 31), (place.after, place.fraction)] {
            let Some(ambient) = self.table.ambient_row(at, channel) else {
                return false;
            };
            let cells = self.table.gain_row(at, channel).zip(ambient);
            for (slot, (gain, ambient)) in line.iter_mut().zip(cells) {
                let driven = i32::from(driven(ambient, gain, fraction));
                *slot = blend(*slot, driven << GAIN_GUARD_BITS, share);
            }
        }
        cols.expand(line, row.spread);
        for (value, driven) in values.iter_mut().zip(row.spread.iter()) {
            // A step is rounded, so a row that falls to no light may end below it.
            let driven = (driven.wrapping_add(GAIN_HALF) >> GAIN_GUARD_BITS).max(0) as u32;
            let gain = u32::from(*value);
            let light = driven.wrapping_shl(fraction).wrapping_add(gain / 2);
            let light = light.checked_div(gain);
            *value = light.unwrap_or(0).min(u32::from(u16::MAX)) as u16;
        }
        true
    }

    /// Adds up the light of a frame by cells: `add` adds the light of a row of pixels,
    /// times a weight, to columns. `columns` has two elements a pixel of a row.
    pub(super) fn average(
        &self,
        columns: &mut [u32],
        sums: &mut [u64],
        add: impl Fn(usize, u32, &mut [u32]),
    ) {
        self.average.add_frame(columns, sums, add);
    }

    /// Adds the light (without ambient) of row `y` of one channel to the sums of
    /// its cells; `sums` has `N` elements and starts at zero.
    #[inline(always)]
    pub fn average_row(&self, y: usize, light: &[Light], sums: &mut [u64]) {
        self.average.add_row(y, light, sums);
    }

    /// Turns the sums of a whole frame into the corrections of its cells, both `N`
    /// for each channel.
    ///
    /// # Errors
    /// [`FrameError`] if the tier does not exist or a slice is too short.
    pub fn correct(
        &self,
        tier: u8,
        sums: &[u64],
        corrections: &mut [i32],
        workspace: &mut Workspace<'_>,
    ) -> Result<(), FrameError> {
        self.check_tier(tier)?;
        let needed = C * self.table.grid().cells();
        for (what, given) in [("sums", sums.len()), ("corrections", corrections.len())] {
            ShortSlice::check(what, needed, given)?;
        }
        for (value, sum) in corrections.iter_mut().zip(sums).take(needed) {
            *value = i32::from(self.average.mean(*sum).to_bits());
        }
        Ok(correct(self.table, tier, corrections, workspace)?)
    }

    /// Gains of one channel along row `y`, to nearest.
    ///
    /// They depend on the frame's size alone: whoever has the memory computes
    /// them once.
    pub fn gain_row(&self, y: usize, channel: usize, row: &mut RowBuffers<'_>, gains: &mut [u16]) {
        let [rows, cols] = self.gains;
        let place = rows.place(y);
        let used = if let Some(fine) = self.fine_gain {
            let line = |at| fine.row(at, channel);
            fill_line(
                row.line,
                line(place.before).zip(line(place.after)),
                place.fraction,
            )
        } else {
            let line = |at| self.table.gain_row(at, channel);
            fill_line(
                row.line,
                line(place.before).zip(line(place.after)),
                place.fraction,
            )
        };
        cols.expand(row.line.get(..used).unwrap_or_default(), row.spread);
        for (gain, spread) in gains.iter_mut().zip(row.spread.iter()) {
            *gain = (spread.wrapping_add(GAIN_HALF) >> GAIN_GUARD_BITS)
                .clamp(0, i32::from(u16::MAX)) as u16;
        }
    }

    /// Interpolates the corrections of one channel along row `y` into `row.spread`.
    #[inline(always)]
    pub fn correct_row(&self, y: usize, corrections: &[i32], row: &mut RowBuffers<'_>) {
        let [rows, cols] = self.cells;
        let place = rows.place(y);
        let count = self.table.grid().cols();
        let line = |at: usize| {
            let line = corrections.get(at * count..).unwrap_or_default();
            line.get(..count).unwrap_or(line)
        };
        let blended = row.line.get_mut(..count).unwrap_or_default();
        blend_rows(
            line(place.before),
            line(place.after),
            place.fraction,
            blended,
        );
        cols.expand(blended, row.spread);
    }

    /// Drives of one channel along row `y`; returns how many were clipped.
    ///
    /// `light` is the row without ambient and `gain` its
    /// [`gain_row`](Self::gain_row), side by side; `corrections` are the channel's,
    /// as [`correct`](Self::correct) left them.
    #[inline(always)]
    pub fn finish_row(
        &self,
        y: usize,
        light: &[Light],
        gain: &[u16],
        corrections: &[i32],
        row: &mut RowBuffers<'_>,
        drives: &mut [Drive],
    ) -> ClippedSamples {
        self.correct_row(y, corrections, row);
        let fraction = u32::from(self.table.gain_fraction());
        drive_row(light, gain, fraction, row.spread, drives)
    }
}

/// Blends two rows of gains, widened by the guard bits; returns how many.
fn fill_line(line: &mut [i32], pairs: impl Iterator<Item = (u16, u16)>, fraction: u32) -> usize {
    let widen = |gain: u16| i32::from(gain) << GAIN_GUARD_BITS;
    let mut used = 0;
    for (slot, (before, after)) in line.iter_mut().zip(pairs) {
        *slot = blend(widen(before), widen(after), fraction);
        used += 1;
    }
    used
}
