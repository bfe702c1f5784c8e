//! What a tier costs on the machine that writes the report.

use crate::capture::Response;
use crate::compile::content::natural_images;
use crate::video::OperatorMemory;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::{Encoding, FrameError, GridPipeline};
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
    match table.channels() {
        1 => of_channels::<1>(table),
        _ => of_channels::<3>(table),
    }
}

fn of_channels<const C: usize>(table: &Table<'_>) -> Result<Vec<f64>, FrameError> {
    let pipeline = GridPipeline::<C>::new(table)?;
    let cells = table.grid().cells();
    let code = |light: f64| (Response::Srgb.value(light) * 255.0).round() as u8;
    let images: Vec<Vec<[u8; C]>> = natural_images(table.grid())
        .column_iter()
        .map(|image| image.iter().map(|light| [code(*light); C]).collect())
        .collect();
    let mut input = vec![[0_u8; C]; cells];
    let mut memory = OperatorMemory::new(table);
    let mut medians = Vec::new();
    for tier in 0..=table.top_tier() {
        let mut runs = Vec::with_capacity(RUNS);
        for image in images.iter().cycle().take(RUNS) {
            let mut workspace = memory.workspace();
            let start = Instant::now();
            pipeline.compensate(tier, Encoding::Display, image, &mut input, &mut workspace)?;
            runs.push(start.elapsed().as_secs_f64() * 1e6);
        }
        runs.sort_by(f64::total_cmp);
        medians.push(runs[RUNS / 2]);
    }
    Ok(medians)
}
