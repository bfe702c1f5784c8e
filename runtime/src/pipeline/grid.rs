//! Grid-size frames: one pixel a cell.

use super::FrameError;
use super::pixels::Pixels;
use super::sample::{Encoding, Sample};
use super::stages::Workspace;
use crate::haar::ShortSlice;
use crate::image::Table;
use crate::kernel::Plane;
use crate::units::ClippedSamples;

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
        workspace: &mut Workspace<'_>,
    ) -> Result<ClippedSamples, FrameError> {
        let top = self.table.top_tier();
        if tier > top {
            return Err(FrameError::NoSuchTier { tier, top });
        }
        self.check("input", input.len())?;
        if self.operates(tier) {
            self.analyse(encoding, wanted, workspace)?;
            self.operate(tier, workspace)?;
        }
        self.finish(tier, encoding, wanted, input, workspace)
    }

    /// First stage: from pixels to input coefficients, which stay in the workspace.
    ///
    /// # Errors
    /// [`FrameError::Short`] if a slice is too short.
    pub fn analyse<S: Sample>(
        &self,
        encoding: Encoding,
        wanted: &[[S; C]],
        workspace: &mut Workspace<'_>,
    ) -> Result<(), FrameError> {
        self.check("wanted", wanted.len())?;
        workspace.check(self.table)?;
        for channel in 0..C {
            let pixels = self.pixels(encoding, wanted, channel);
            workspace.analyse(self.table, channel, &pixels)?;
        }
        Ok(())
    }

    /// Second stage: from input coefficients to those of the corrections.
    ///
    /// # Errors
    /// [`FrameError::Short`] if the workspace is too short.
    pub fn operate(&self, tier: u8, workspace: &mut Workspace<'_>) -> Result<(), FrameError> {
        workspace.check(self.table)?;
        Ok(workspace.operate(self.table, tier)?)
    }

    /// Third stage: corrections, gain, clip and code; returns how many samples were
    /// clipped. At a tier without operator there are no corrections.
    ///
    /// # Errors
    /// [`FrameError::Short`] if a slice is too short.
    pub fn finish<S: Sample>(
        &self,
        tier: u8,
        encoding: Encoding,
        wanted: &[[S; C]],
        input: &mut [[S; C]],
        workspace: &mut Workspace<'_>,
    ) -> Result<ClippedSamples, FrameError> {
        self.check("wanted", wanted.len())?;
        self.check("input", input.len())?;
        workspace.check(self.table)?;
        let cells = self.table.grid().cells();
        let operates = self.operates(tier);
        if !operates {
            let unused = workspace.cells.get_mut(..cells).unwrap_or_default();
            unused.fill(0);
        }
        let gains = self.table.gains().as_chunks::<C>().0;
        let fraction = u32::from(self.table.gain_fraction());
        let mut clipped = ClippedSamples::default();
        for channel in 0..C {
            if operates {
                workspace.synthesise(self.table, channel)?;
            }
            let corrections = workspace.cells.get(..cells).unwrap_or_default();
            let pixels = self.pixels(encoding, wanted, channel);
            clipped += S::finish(&pixels, fraction, gains, corrections, input);
        }
        Ok(clipped)
    }

    /// Whether frames of `tier` go through the operator.
    #[must_use]
    pub const fn operates(&self, tier: u8) -> bool {
        tier > 0 && self.table.operator().is_some()
    }

    fn check(self, what: &'static str, given: usize) -> Result<(), ShortSlice> {
        let needed = self.table.grid().cells();
        ShortSlice::check(what, needed, given)
    }

    fn pixels<'f, S: Sample>(
        &'f self,
        encoding: Encoding,
        wanted: &'f [[S; C]],
        channel: usize,
    ) -> Pixels<'f, S, C> {
        let grid = self.table.grid();
        Pixels {
            plane: Plane {
                codes: wanted.get(..grid.cells()).unwrap_or_default(),
                ambient: self.table.ambient().map(|light| light.as_chunks::<C>().0),
                cols: grid.cols(),
                channel,
            },
            curves: S::curves(self.table, encoding, channel),
        }
    }
}
