//! Frames of one pixel a cell.

use super::FrameError;
use super::pixels::Pixels;
use super::sample::{Encoding, Sample};
use super::stages::Workspace;
use crate::haar::ShortSlice;
use crate::image::Table;

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
    ) -> Result<u32, FrameError> {
        let table = self.table;
        let (top, cells) = (table.top_tier(), table.grid().cells());
        if tier > top {
            return Err(FrameError::NoSuchTier { tier, top });
        }
        let short = |what, given: usize| ShortSlice {
            what,
            needed: cells,
            given,
        };
        let given = (wanted.len(), input.len());
        let wanted = wanted.get(..cells).ok_or(short("wanted", given.0))?;
        let input = input.get_mut(..cells).ok_or(short("input", given.1))?;
        workspace.check(table)?;
        let ambient = table.ambient().map(|ambient| ambient.as_chunks::<C>().0);
        let pixels = |channel| Pixels {
            codes: wanted,
            ambient,
            cols: table.grid().cols(),
            channel,
            curves: S::curves(table, encoding, channel),
        };
        let operates = tier > 0 && table.operator().is_some();
        if operates {
            for channel in 0..C {
                workspace.analyse(table, channel, &pixels(channel))?;
            }
            workspace.operate(table, tier);
        } else {
            let unused = workspace.cells.get_mut(..cells).unwrap_or_default();
            unused.fill(0);
        }
        let (gains, fraction) = (table.gains().as_chunks::<C>().0, table.gain_fraction());
        let mut clipped = 0;
        for channel in 0..C {
            if operates {
                workspace.synthesise(table, channel)?;
            }
            let corrections = workspace.cells.get(..cells).unwrap_or_default();
            let pixels = pixels(channel);
            clipped += S::finish(&pixels, fraction.into(), gains, corrections, input);
        }
        Ok(clipped)
    }
}
