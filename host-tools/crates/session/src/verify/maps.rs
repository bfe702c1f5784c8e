//! Pictures of a verdict: maps of the cells, and the test images as the wall showed
//! them.

use super::judge::over_images;
use super::{Readings, TableVerdict};
use iltm_capture::CellPlanes;
use iltm_picture::{
    ColourScale, LightPicture, Palette, Picture,
    html::{PictureFile, picture_file},
};
use iltm_runtime::{FrameSize, Grid, image::Table};

/// Pixels that the longer side of a map should have at least.
const MAP_SIDE: usize = 480;

/// Grey of cells that were not compared.
const UNKNOWN: [u8; 3] = [88, 92, 100];

/// Every picture of the page, by name: `worst-cells`, `worst-cells-before`, `drift`, and
/// of each test image `K-wanted`, `K-before`, `K-after`.
#[must_use]
pub fn pictures(
    table: &Table<'_>,
    readings: &Readings,
    verdict: &TableVerdict,
) -> Vec<PictureFile> {
    let grid = table.grid();
    let errors = |half| {
        map(
            grid,
            &error_scale(verdict, half),
            &over_images(&verdict.images, half),
        )
    };
    let mut files = vec![
        picture_file("worst-cells", &errors(1)),
        picture_file("worst-cells-before", &errors(0)),
    ];
    if let Some(white) = &verdict.drift.white {
        let change: Vec<Option<f64>> = white.cells.iter().map(|c| c.map(f64::abs)).collect();
        let change = map(grid, &drift_scale(verdict), &change);
        files.push(picture_file("drift", &change));
    }
    for (shown, image) in readings.shown.iter().zip(&verdict.images) {
        let number = image.image;
        let wall = |half: usize| as_seen(grid, &shown.seen[half], &shown.wanted, &readings.live);
        files.push(picture_file(
            &format!("{number}-wanted"),
            &lit(grid, &shown.wanted),
        ));
        files.push(picture_file(&format!("{number}-before"), &wall(0)));
        files.push(picture_file(&format!("{number}-after"), &wall(1)));
    }
    files
}

/// Colours of the map of errors with (1) or without (0) compensation: each has its own, or
/// nothing would be seen of what is left.
pub(super) fn error_scale(verdict: &TableVerdict, half: usize) -> ColourScale {
    let errors = over_images(&verdict.images, half).into_iter().flatten();
    ColourScale::linear(Palette::Magma, rounded(errors.fold(0.0, f64::max)))
}

/// Colours of the map of changes.
pub(super) fn drift_scale(verdict: &TableVerdict) -> ColourScale {
    let white = verdict.drift.white.iter();
    let cells = white.flat_map(|white| white.cells.iter().flatten());
    let largest = cells.fold(0.0_f64, |a, b| a.max(b.abs()));
    ColourScale::linear(Palette::Viridis, rounded(largest.max(0.01)))
}

/// The next number up with one digit.
fn rounded(value: f64) -> f64 {
    let value = value.max(1e-3);
    let power = 10_f64.powf(value.log10().floor());
    (value / power).ceil() * power
}

fn map(grid: Grid, scale: &ColourScale, cells: &[Option<f64>]) -> Picture {
    let colour = |cell: Option<f64>| cell.map_or(UNKNOWN, |value| scale.colour(value));
    let size = FrameSize::of_grid(grid);
    blocks(&Picture::from_fn(size, |col, row| {
        colour(cells[row * grid.cols() + col])
    }))
}

/// A photograph's cells at the brightness that suits the wanted image best, as its error is
/// taken.
fn as_seen(grid: Grid, seen: &CellPlanes, wanted: &CellPlanes, live: &[bool]) -> Picture {
    let pairs = || {
        let planes = seen.iter().zip(wanted);
        let cells = planes.flat_map(|(seen, wanted)| seen.iter().zip(wanted).zip(live));
        cells.filter(|(_, live)| **live).map(|(pair, _)| pair)
    };
    let both: f64 = pairs().map(|(seen, wanted)| seen * wanted).sum();
    let own: f64 = pairs().map(|(seen, _)| seen * seen).sum();
    let scale = if own > 0.0 { both / own } else { 0.0 };
    let light = |plane: &Vec<f64>| {
        let cells = plane.iter().zip(live);
        let scaled = cells.map(|(light, live)| if *live { scale * light } else { 0.0 });
        scaled.collect()
    };
    lit(grid, &seen.iter().map(light).collect())
}

/// Light of the cells as a screen shows it.
fn lit(grid: Grid, light: &CellPlanes) -> Picture {
    let light = LightPicture::from_fn(FrameSize::of_grid(grid), light.len(), |channel, cell| {
        light[channel][cell] as f32
    });
    blocks(&light.for_display())
}

/// Cells as squares of pixels.
fn blocks(cells: &Picture) -> Picture {
    let size = cells.size();
    cells.enlarged(MAP_SIDE.div_ceil(size.width().max(size.height())))
}
