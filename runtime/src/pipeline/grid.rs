//! Frames of one pixel a cell.

use super::FrameError;
use super::response::Response;
use super::sample::{Encoding, Sample};
use super::stages::{Workspace, correct, drive};
use crate::haar::ShortSlice;
use crate::image::Table;
use crate::units::Light;

/// Compensates frames of the grid's own size, `C` channels side by side.
#[derive(Clone, Copy, Debug)]
pub struct GridPipeline<'t, 'a, const C: usize> {
    table: &'t Table<'a>,
}

impl<'t, 'a, const C: usize> GridPipeline<'t, 'a, C> {
    /// A pipeline for `table`.
    ///
    /// # Errors
    /// [`FrameError::Channels`] if the table has not `C` channels.
    pub fn new(table: &'t Table<'a>) -> Result<Self, FrameError> {
        if usize::from(table.channels()) != C {
            return Err(FrameError::Channels {
                table: table.channels(),
                pipeline: C as u8,
            });
        }
        Ok(Self { table })
    }

    /// Compensates one frame at `tier`; returns how many samples were clipped.
    ///
    /// `wanted` and `input` have `N` pixels of `C` samples.
    ///
    /// # Errors
    /// [`FrameError`] if the tier does not exist or a slice is too short; `input`
    /// is left as it was then.
    pub fn compensate<S: Sample>(
        &self,
        tier: u8,
        encoding: Encoding,
        wanted: &[[S; C]],
        input: &mut [[S; C]],
        workspace: &mut Workspace<'_, C>,
    ) -> Result<u32, FrameError> {
        let (top, needed) = (self.table.top_tier(), self.table.grid().cells());
        if tier > top {
            return Err(FrameError::NoSuchTier { tier, top });
        }
        for (what, given) in [("wanted", wanted.len()), ("input", input.len())] {
            if given < needed {
                return Err(FrameError::Short(ShortSlice {
                    what,
                    needed,
                    given,
                }));
            }
        }
        for channel in 0..C {
            let light = self.light(encoding, wanted, channel);
            for (cell, light) in workspace.values.iter_mut().zip(light) {
                if let Some(cell) = cell.get_mut(channel) {
                    *cell = i32::from(light.to_bits());
                }
            }
        }
        correct(self.table, tier, workspace)?;
        let mut clipped = 0;
        for channel in 0..C {
            clipped += self.finish(encoding, wanted, input, workspace, channel);
        }
        Ok(clipped)
    }

    /// Light without ambient of one channel, cell by cell.
    fn light<S: Sample>(
        &self,
        encoding: Encoding,
        wanted: &[[S; C]],
        channel: usize,
    ) -> impl Iterator<Item = Light> {
        let cols = self.table.grid().cols();
        let lines = wanted.chunks_exact(cols).take(self.table.grid().rows());
        lines.enumerate().flat_map(move |(row, line)| {
            let mut ambient = self.table.ambient_row(row, channel);
            line.iter().map(move |pixel| {
                let sample = pixel.get(channel).copied().unwrap_or_default();
                let ambient = ambient.as_mut().and_then(Iterator::next);
                sample
                    .light(encoding)
                    .saturating_sub(ambient.unwrap_or_default())
            })
        })
    }

    /// Gain, correction, clip and code of one channel.
    fn finish<S: Sample>(
        self,
        encoding: Encoding,
        wanted: &[[S; C]],
        input: &mut [[S; C]],
        workspace: &Workspace<'_, C>,
        channel: usize,
    ) -> u32 {
        let fraction = u32::from(self.table.gain_fraction());
        let response = Response::new(self.table, channel);
        let gains = (0..self.table.grid().rows()).flat_map(|row| self.table.gain_row(row, channel));
        let light = self.light(encoding, wanted, channel);
        let corrections = workspace.values.iter();
        let mut clipped = 0;
        for (((pixel, light), gain), correction) in
            input.iter_mut().zip(light).zip(gains).zip(corrections)
        {
            let correction = correction.get(channel).copied().unwrap_or(0);
            let (reached, was_clipped) = drive(light, gain, fraction, correction);
            clipped += u32::from(was_clipped);
            if let Some(sample) = pixel.get_mut(channel) {
                *sample = S::code(reached, encoding, response);
            }
        }
        clipped
    }
}
