//! Neighbours' light: what the device of one of several projectors gets of a wide frame.
//!
//! Its own part, pixel for pixel, and the mean light of the other frames' cells
//! ([`Neighbours`]), for whatever brings frames to devices: a splitter's hardware
//! may do the same.

use iltm_picture::FramePart;
use iltm_runtime::image::{Neighbours, Table};
use iltm_runtime::pipeline::{Encoding, Sample};
use iltm_runtime::resample::area::AreaAverage;
use iltm_runtime::units::{Halfword, Light};
use iltm_runtime::{FrameSize, Grid};
use std::iter;

/// Splits wide frames for the device of one projector.
#[derive(Debug)]
pub struct FrameSplitter {
    /// Columns of a wide frame.
    wide: usize,
    /// The pixels of the own frame.
    part: FramePart,
    own: FrameSize,
    /// Those of the others, from left to right, and the means of their cells.
    others: Vec<(FramePart, AreaAverage)>,
    cells: Grid,
    channels: usize,
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
    /// projector alone, or the wide frame has no whole pixels for each. `frames` are rows and columns of
    /// cells of the frames of all, from left to right; none if they are all as the table's own.
    #[must_use]
    pub fn new(
        (table, frames): (&Table<'_>, &[[u16; 2]]),
        wide: FrameSize,
        encoding: Encoding,
    ) -> Option<Self> {
        let neighbours = table.neighbours()?;
        let [before, after] = neighbours.around();
        let parts = parts(table, neighbours, frames)?;
        let grid = FramePart::grid(&parts)?;
        let pixels = parts.iter().map(|part| part.pixels(grid, wide));
        let mut pixels: Vec<FramePart> = pixels.collect::<Option<_>>()?;
        let part = pixels.remove(before);
        let cols = neighbours.grid().cols() / (before + after);
        let of_one = Grid::new(neighbours.grid().rows() as u16, cols as u16).ok()?;
        let averaged = |part: FramePart| {
            let average = AreaAverage::new(of_one, part.frame()?)?;
            Some((part, average))
        };
        let curve = |channel| {
            let curves = u8::curves(table, encoding, channel);
            std::array::from_fn(|code| (code as u8).light(curves))
        };
        Some(Self {
            wide: wide.width(),
            own: part.frame()?,
            part,
            others: pixels.into_iter().map(averaged).collect::<Option<_>>()?,
            cells: neighbours.grid(),
            channels: table.channels().into(),
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
        let row = self.wide * self.channels;
        let of = |part: &FramePart| {
            let columns = part.columns.start * self.channels..part.columns.end * self.channels;
            let rows = wide.chunks_exact(row).take(part.rows);
            rows.map(move |row| &row[columns.clone()])
        };
        let mut light = vec![[0; 2]; self.cells.cells() * self.channels];
        let cols = self.cells.cols() / self.others.len();
        for (place, (part, average)) in self.others.iter().enumerate() {
            for (channel, curve) in self.curves.iter().enumerate() {
                let mut sums = vec![0; self.cells.rows() * cols];
                for (y, row) in of(part).enumerate() {
                    let codes = row.iter().skip(channel).step_by(self.channels);
                    let line: Vec<Light> = codes.map(|code| curve[usize::from(*code)]).collect();
                    average.add_row(y, &line, &mut sums);
                }
                for (cell, sum) in sums.into_iter().enumerate() {
                    let (row, col) = (cell / cols, place * cols + cell % cols);
                    let at = (row * self.cells.cols() + col) * self.channels + channel;
                    light[at] = average.mean(sum).to_bits().to_le_bytes();
                }
            }
        }
        OwnFrame {
            pixels: of(&self.part).flatten().copied().collect(),
            light,
        }
    }
}

/// The cells of each projector; `None` where `frames` are not those of as many, or not of the table.
fn parts(
    table: &Table<'_>,
    neighbours: &Neighbours<'_>,
    frames: &[[u16; 2]],
) -> Option<Vec<FramePart>> {
    let [before, after] = neighbours.around();
    let (count, grid) = (before + 1 + after, table.grid());
    let own = [grid.rows(), grid.cols()];
    if frames.is_empty() {
        return Some(FramePart::side_by_side(iter::repeat_n(own, count)));
    }
    let frames = || frames.iter().map(|frame| frame.map(usize::from));
    let fits = frames().len() == count && frames().nth(before) == Some(own);
    fits.then(|| FramePart::side_by_side(frames()))
}

/// The wide frames that the devices of several projectors get their own of, one of `own` size; `None` if
/// the table is that of a projector alone, or others would have parts of pixels. `frames` are as for
/// [`FrameSplitter::new`].
#[must_use]
pub fn wide_size((table, frames): (&Table<'_>, &[[u16; 2]]), own: FrameSize) -> Option<FrameSize> {
    let neighbours = table.neighbours()?;
    let parts = parts(table, neighbours, frames)?;
    let grid = FramePart::grid(&parts)?;
    let [before, _] = neighbours.around();
    let wide = parts[before].wide(grid, own)?;
    let whole = parts.iter().all(|part| part.pixels(grid, wide).is_some());
    whole.then_some(wide)
}
