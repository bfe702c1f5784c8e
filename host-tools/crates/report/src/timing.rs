//! What a tier costs on the machine that writes the report.

use iltm_picture::Response;
use iltm_runtime::{
    FrameSize, Grid,
    image::Table,
    pipeline::{
        Encoding, FrameError, FrameJob, FullMemory, RowBuffers, compensate_cells, compensate_pixels,
    },
    units::Halfword,
};
use iltm_solve::natural_images;
use iltm_video::OperatorMemory;
use std::time::Instant;

/// Runs of which the median counts: odd, and few enough to take no time.
const RUNS: usize = 51;

/// Microseconds that one core takes for a frame of the grid's own size, for each
/// tier: the median over some natural images.
///
/// Numbers of this machine, not of the device.
///
/// # Errors
/// [`FrameError`] if the table has another number of channels than one or three.
pub fn microseconds(table: &Table<'_>) -> Result<Vec<f64>, FrameError> {
    microseconds_at(table, table.grid())
}

/// The same for frames of one pixel a cell of another, finer grid.
///
/// # Errors
/// [`FrameError`] if that grid is not as fine as the table's on both axes.
pub fn microseconds_at(table: &Table<'_>, pixels: Grid) -> Result<Vec<f64>, FrameError> {
    let channels = usize::from(table.channels());
    let size = FrameSize::of_grid(pixels);
    let of_grid = pixels == table.grid();
    let code = |light: &f64| (Response::Srgb.value(*light) * 255.0).round() as u8;
    let images: Vec<Vec<u8>> = natural_images(pixels)
        .column_iter()
        .map(|image| {
            let codes = image.iter().map(code);
            codes
                .flat_map(|code| std::iter::repeat_n(code, channels))
                .collect()
        })
        .collect();
    let mut input = vec![0_u8; size.pixels() * channels];
    let mut memory = OperatorMemory::new(table);
    let mut frame = FrameMemory::new(table, size);
    let mut medians = Vec::new();
    let mut prepared = false;
    for tier in 0..=table.top_tier() {
        let encoding = Encoding::Display;
        let mut runs = Vec::with_capacity(RUNS);
        for image in images.iter().cycle().take(RUNS) {
            let mut workspace = memory.workspace();
            let start = Instant::now();
            if of_grid {
                compensate_cells(table, tier, encoding, image, &mut input, &mut workspace)?;
            } else {
                let job = FrameJob {
                    table,
                    size,
                    prepared,
                    tier,
                    encoding,
                };
                compensate_pixels(&job, image, &mut input, &mut frame.lent(), &mut workspace)?;
                prepared = true;
            }
            runs.push(start.elapsed().as_secs_f64() * 1e6);
        }
        runs.sort_by(f64::total_cmp);
        medians.push(runs[RUNS / 2]);
    }
    Ok(medians)
}

/// What the runtime's [`FullMemory`] borrows.
struct FrameMemory {
    gains: Vec<Halfword>,
    ambient: Vec<Halfword>,
    sums: Vec<u64>,
    corrections: Vec<i32>,
    columns: Vec<u32>,
    line: Vec<i32>,
    spread: Vec<i32>,
    values: Vec<u16>,
}

impl FrameMemory {
    /// Enough for frames of `size`.
    fn new(table: &Table<'_>, size: FrameSize) -> Self {
        let channels = usize::from(table.channels());
        let (samples, width) = (size.pixels() * channels, size.width());
        let cells = table.grid().cells() * channels;
        let fine = table.fine_gain().map_or(0, |fine| fine.size().width());
        Self {
            gains: vec![Halfword::default(); samples],
            ambient: vec![Halfword::default(); samples],
            sums: vec![0; cells],
            corrections: vec![0; cells],
            columns: vec![0; 2 * width * channels],
            line: vec![0; table.grid().cols().max(fine)],
            spread: vec![0; width],
            values: vec![0; width],
        }
    }

    fn lent(&mut self) -> FullMemory<'_> {
        FullMemory {
            gains: &mut self.gains,
            ambient: &mut self.ambient,
            sums: &mut self.sums,
            corrections: &mut self.corrections,
            columns: &mut self.columns,
            row: RowBuffers {
                line: &mut self.line,
                spread: &mut self.spread,
            },
            values: &mut self.values,
        }
    }
}
