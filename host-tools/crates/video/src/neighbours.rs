//! Neighbours' light: what the device of one of several projectors gets of a wide frame.
//!
//! Its own part, pixel for pixel, and the mean light of the other frames' cells
//! ([`Neighbours`]), for whatever brings frames to devices: a splitter's hardware
//! may do the same.

use iltm_runtime::image::{Neighbours, Table};
use iltm_runtime::pipeline::{Encoding, Sample};
use iltm_runtime::resample::area::AreaAverage;
use iltm_runtime::units::{Halfword, Light};
use iltm_runtime::{FrameSize, Grid};

/// Splits wide frames for the device of one projector.
#[derive(Debug)]
pub struct FrameSplitter {
    /// Frames on the left of the own one, and on its right.
    around: [usize; 2],
    own: FrameSize,
    cells: Grid,
    channels: usize,
    average: AreaAverage,
    /// Light of a code by channel.
    curves: Vec<[Light; 256]>,
}

/// What a device gets of one of them.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct OwnFrame {
    /// Its own pixels, channels side by side.
    pub pixels: Vec<u8>,
    /// Light of its neighbours' cells, as [`Neighbours`] has it.
    pub light: Vec<Halfword>,
}

impl FrameSplitter {
    /// Frames whose codes mean this, for the device that has `table`; `None` if it is the table of a
    /// projector alone, or the frames are not as many of one size, side by side.
    #[must_use]
    pub fn new(table: &Table<'_>, wide: FrameSize, encoding: Encoding) -> Option<Self> {
        let neighbours = table.neighbours()?;
        let [before, after] = neighbours.around();
        let count = before + 1 + after;
        let own = wide.width().is_multiple_of(count);
        let own = own.then_some(wide.width() / count)?;
        let own = FrameSize::new(own as u16, wide.height() as u16)?;
        let cols = neighbours.grid().cols() / (before + after);
        let of_one = Grid::new(neighbours.grid().rows() as u16, cols as u16).ok()?;
        let curve = |channel| {
            let curves = u8::curves(table, encoding, channel);
            std::array::from_fn(|code| (code as u8).light(curves))
        };
        Some(Self {
            around: [before, after],
            own,
            cells: neighbours.grid(),
            channels: table.channels().into(),
            average: AreaAverage::new(of_one, own)?,
            curves: (0..table.channels().into()).map(curve).collect(),
        })
    }

    /// Pixels of the own frame.
    #[must_use]
    pub const fn own(&self) -> FrameSize {
        self.own
    }

    /// The cells whose light comes with it.
    #[must_use]
    pub const fn cells(&self) -> Grid {
        self.cells
    }

    /// What the device gets of a frame, 8-bit samples with channels side by side.
    #[must_use]
    pub fn of_frame(&self, wide: &[u8]) -> OwnFrame {
        let [before, after] = self.around;
        let width = self.own.width() * self.channels;
        let rows = || wide.chunks_exact(width * (before + 1 + after));
        let of = |row, projector: usize| -> &[u8] {
            let row: &[u8] = row;
            &row[projector * width..][..width]
        };
        let mut light = vec![[0; 2]; self.cells.cells() * self.channels];
        let others = (0..before).chain(before + 1..=before + after);
        let cols = self.cells.cols() / (before + after);
        for (place, projector) in others.enumerate() {
            for (channel, curve) in self.curves.iter().enumerate() {
                let mut sums = vec![0; self.cells.rows() * cols];
                for (y, row) in rows().enumerate() {
                    let codes = of(row, projector).iter().skip(channel);
                    let codes = codes.step_by(self.channels);
                    let line: Vec<Light> = codes.map(|code| curve[usize::from(*code)]).collect();
                    self.average.add_row(y, &line, &mut sums);
                }
                for (cell, sum) in sums.into_iter().enumerate() {
                    let (row, col) = (cell / cols, place * cols + cell % cols);
                    let at = (row * self.cells.cols() + col) * self.channels + channel;
                    light[at] = self.average.mean(sum).to_bits().to_le_bytes();
                }
            }
        }
        OwnFrame {
            pixels: rows().flat_map(|row| of(row, before)).copied().collect(),
            light,
        }
    }
}

/// The wide frames that the devices of several projectors get their own of.
#[must_use]
pub fn wide_size(neighbours: &Neighbours<'_>, own: FrameSize) -> Option<FrameSize> {
    let [before, after] = neighbours.around();
    let width = own.width() * (before + 1 + after);
    FrameSize::new(u16::try_from(width).ok()?, own.height() as u16)
}
