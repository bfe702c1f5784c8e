//! Table in floating point: its gains and the entries of its operator, read back from the
//! image, and what they do to a frame.
//!
//! Light is relative to reference white, drives to the projector's white. Ambient light
//! is left out: what is wanted is wanted above it.

use iltm_compile::haar_entries::{HaarEntry, haar_entries};
use iltm_picture::Lattice;
use iltm_runtime::{FrameSize, Grid, image::Table, operator::Segment};
use iltm_solve::Haar;
use nalgebra::DMatrix;

/// Bounces that are followed at most.
const MOST_BOUNCES: usize = 400;

/// Light that a bounce adds, relative to all, below which it has settled.
const SETTLED: f64 = 1e-7;

/// The entries of one channel.
pub(super) type HaarEntries = Vec<HaarEntry>;

/// A table's numbers.
pub(super) struct FloatTable<'t> {
    table: &'t Table<'t>,
    haar: Haar,
    /// Frames of one pixel each of these cells.
    pixels: Grid,
    /// Between those and the table's cells, where they are not the same.
    lattice: Option<Lattice>,
    /// Gains, a column a channel.
    gains: DMatrix<f64>,
}

impl<'t> FloatTable<'t> {
    /// For frames of one pixel a cell.
    pub(super) fn new(table: &'t Table<'t>) -> Self {
        let (grid, channels) = (table.grid(), usize::from(table.channels()));
        let unit = (-f64::from(table.gain_fraction())).exp2();
        let gain = |channel: usize| {
            let rows = 0..grid.rows();
            rows.flat_map(move |row| table.gain_row(row, channel))
                .map(move |bits| f64::from(bits) * unit)
        };
        let gains = DMatrix::from_iterator(grid.cells(), channels, (0..channels).flat_map(gain));
        Self {
            table,
            haar: Haar::new(grid),
            pixels: grid,
            lattice: None,
            gains,
        }
    }

    /// For frames of one pixel for each of `pixels`, whose gains are the table's fine
    /// ones; `None` if the table has no such gains.
    pub(super) fn finer(table: &'t Table<'t>, pixels: Grid) -> Option<Self> {
        let size = FrameSize::of_grid(pixels);
        let fine = table.fine_gain().filter(|fine| fine.size() == size)?;
        let unit = (-f64::from(table.gain_fraction())).exp2();
        let gain = |channel: usize| {
            let rows = 0..size.height();
            rows.flat_map(|row| fine.row(row, channel).collect::<Vec<_>>())
                .map(|bits| f64::from(bits) * unit)
                .collect::<Vec<_>>()
        };
        let channels = usize::from(table.channels());
        let gains = DMatrix::from_iterator(size.pixels(), channels, (0..channels).flat_map(gain));
        Some(Self {
            pixels,
            lattice: Some(Lattice::new(table.grid(), size)?),
            gains,
            ..Self::new(table)
        })
    }

    pub(super) fn channels(&self) -> usize {
        usize::from(self.table.channels())
    }

    pub(super) const fn pixels(&self) -> Grid {
        self.pixels
    }

    /// Whether a pixel has a gain in a channel: the others stay dark.
    pub(super) fn is_lit(&self, pixel: usize, channel: usize) -> bool {
        self.gains[(pixel, channel)] > 0.0
    }

    /// The segments of a tier.
    pub(super) fn segments(&self, tier: u8) -> Vec<Segment<'t>> {
        let operator = self.table.operator();
        let segments = operator.map_or(&[][..], |operator| operator.segments());
        let own = segments.iter().filter(|segment| segment.tier == tier);
        own.copied().collect()
    }

    /// The entries of segments by channel, scales of the channels included.
    pub(super) fn entries(&self, segments: &[Segment<'_>]) -> Vec<HaarEntries> {
        haar_entries(self.table, segments)
    }

    /// `K d` of every column of `wanted`, one a pixel.
    pub(super) fn bounced(&self, entries: &[HaarEntry], wanted: &DMatrix<f64>) -> DMatrix<f64> {
        let cells = match &self.lattice {
            Some(lattice) => by_column(wanted, |column| {
                let light: Vec<f32> = column.iter().map(|light| *light as f32).collect();
                lattice.average(&light)
            }),
            None => wanted.clone(),
        };
        let inputs = self.haar.analyse_columns(&cells);
        let mut outputs = DMatrix::zeros(inputs.nrows(), inputs.ncols());
        for entry in entries {
            for image in 0..inputs.ncols() {
                outputs[(entry.row, image)] += entry.value * inputs[(entry.col, image)];
            }
        }
        let corrections = self.haar.synthesise_columns(&outputs);
        match &self.lattice {
            Some(lattice) => by_column(&corrections, |column| {
                let spread = lattice.expand(column);
                spread.into_iter().map(f64::from).collect()
            }),
            None => corrections,
        }
    }

    /// `p = g .* d - K d` of one channel, clipped to what a projector can show.
    pub(super) fn drives(
        &self,
        channel: usize,
        entries: &[HaarEntry],
        wanted: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut drives = wanted.clone();
        let gain = self.gains.column(channel);
        for mut image in drives.column_iter_mut() {
            image.component_mul_assign(&gain);
        }
        drives -= self.bounced(entries, wanted);
        drives.map(|drive| drive.clamp(0.0, 1.0))
    }

    /// Light that `drives` make where `entries` are the whole operator: `T p` by bounces.
    /// `None` if they do not fade.
    pub(super) fn light(
        &self,
        channel: usize,
        entries: &[HaarEntry],
        drives: &DMatrix<f64>,
    ) -> Option<DMatrix<f64>> {
        let fade = self
            .gains
            .column(channel)
            .map(|gain| if gain > 0.0 { gain.recip() } else { 0.0 });
        let reflect = |drives: &DMatrix<f64>| {
            let mut light = drives.clone();
            for mut image in light.column_iter_mut() {
                image.component_mul_assign(&fade);
            }
            light
        };
        let mut bounce = reflect(drives);
        let mut light = bounce.clone();
        for _ in 0..MOST_BOUNCES {
            bounce = reflect(&self.bounced(entries, &bounce));
            light += &bounce;
            if bounce.norm() <= SETTLED * light.norm() {
                return Some(light);
            }
        }
        None
    }
}

fn by_column(matrix: &DMatrix<f64>, of: impl Fn(&[f64]) -> Vec<f64>) -> DMatrix<f64> {
    let rows = matrix.nrows();
    let columns = matrix.as_slice().chunks_exact(rows.max(1));
    let columns: Vec<Vec<f64>> = columns.map(of).collect();
    let rows = columns.first().map_or(0, Vec::len);
    DMatrix::from_iterator(rows, columns.len(), columns.into_iter().flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene;
    use iltm_compile::{CompileOptions, compile};
    use iltm_solve::{InverseTransport, natural_images};

    /// Two facing rows of cells that light each other, with a deviation in blue.
    fn inverse(channels: usize) -> InverseTransport {
        let grid = Grid::new(5, 6).unwrap();
        let gain = |cell: usize, _| 2.0 + 0.1 * (cell % 4) as f64;
        let near = |i: usize, j: usize| {
            let (a, b) = ((i % 6) as f64, (j % 6) as f64);
            let apart = (i / 6).abs_diff(j / 6) as f64;
            if i == j {
                0.0
            } else {
                0.02 / (1.0 + apart + (a - b).abs())
            }
        };
        let mut inverse = test_scene::inverse(grid, channels, gain, near);
        for (channel, scale) in inverse.channels.iter_mut().zip([1.0, 0.8, 0.5]) {
            channel.scale = scale;
        }
        if let Some(blue) = inverse.channels.get_mut(2) {
            let added = DMatrix::from_fn(grid.cells(), grid.cells(), |i, j| {
                if (i + 2 * j) % 11 == 1 { 0.003 } else { 0.0 }
            });
            blue.deviation = Some(added.into());
        }
        inverse
    }

    #[test]
    fn a_table_with_all_entries_gives_back_the_operator_it_was_compiled_from() {
        for channels in [1, 3] {
            let inverse = inverse(channels);
            let options = CompileOptions {
                targets: Some(vec![1e-9]),
                ..CompileOptions::default()
            };
            let compiled = compile(&inverse, None, &options).unwrap();
            let table = Table::check(&compiled.image).unwrap();
            let numbers = FloatTable::new(&table);
            let wanted = natural_images(inverse.grid);
            let entries = numbers.entries(&numbers.segments(1));
            for (channel, entries) in entries.iter().enumerate().take(channels) {
                let expected = inverse.channel(channel);
                let bounced = &expected.operator * &wanted * compiled.white;
                let found = numbers.bounced(entries, &wanted);
                let error = (&found - &bounced).norm() / bounced.norm();
                // 16 bits a value.
                assert!(error < 2e-4, "channel {channel} of {channels}: {error}");
                let light = numbers.light(channel, entries, &wanted).unwrap();
                let expected = expected.light(&wanted).unwrap() / compiled.white;
                let error = (&light - &expected).norm() / expected.norm();
                assert!(
                    error < 2e-4,
                    "light, channel {channel} of {channels}: {error}"
                );
            }
        }
    }
}
