//! Pictures of a verdict: maps of the cells, and the photographs of the wall.

use super::judge::over_images;
use super::pixels::{compared, on_camera, seen, wanted};
use super::{PixelVerdict, Readings, TableVerdict};
use iltm_capture::NO_CELL;
use iltm_picture::{
    ColourScale, LightPicture, Palette, Picture,
    canvas::{Canvas, Colour, FontWeight, RasterHeight, Type},
    html::{PictureFile, picture_file},
    statistics::quantile,
};
use iltm_runtime::{FrameSize, Grid, image::Table};

/// Pixels that the longer side of a map should have at least.
const MAP_SIDE: usize = 480;

/// Most pixels across a picture of the camera's own.
const MOST_WIDTH: usize = 900;

/// Grey of cells that were not compared.
const UNKNOWN: [u8; 3] = [88, 92, 100];

/// Worst cells that are marked.
pub(super) const MARKED: usize = 3;

/// Colour of marks: seen on light and dark.
const MARK: Colour = [255, 64, 32];

/// Every picture of the page, by name: `worst-cells`, `worst-cells-before`, `worst-seen`,
/// `drift`, of each test image `K-wanted`, `K-before`, `K-after`, and of finer ones
/// `pixel-errors`, `fine-wanted`, `fine-before`, `fine-after`.
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
        picture_file("worst-cells", &marked_map(grid, &errors(1), verdict)),
        picture_file("worst-cells-before", &errors(0)),
    ];
    if let Some(white) = &verdict.drift.white {
        let change: Vec<Option<f64>> = white.cells.iter().map(|c| c.map(f64::abs)).collect();
        let change = map(grid, &drift_scale(verdict), &change);
        files.push(picture_file("drift", &change));
    }
    let scale = display_scale(readings);
    for (shown, image) in readings.shown.iter().zip(&verdict.images) {
        let Some(seen) = &shown.views[1] else {
            continue;
        };
        let number = image.image;
        let size = seen.size();
        let wanted = LightPicture::from_fn(size, shown.wanted.len(), |channel, at| {
            let cell = cell_at(readings, size, at).map(|cell| shown.wanted[channel][cell]);
            (scale * image.white * cell.unwrap_or(0.0)) as f32
        });
        let [before, after] = shown.views.each_ref().map(|view| {
            let view = view.as_ref();
            view.map(|view| view.scaled(scale))
        });
        let all = [
            ("wanted", Some(wanted)),
            ("before", before),
            ("after", after),
        ];
        for (name, light) in all {
            let name = format!("{number}-{name}");
            files.extend(light.map(|light| picture_file(&name, &light.for_display())));
        }
    }
    files.extend(pixel_pictures(table, readings, verdict, scale));
    // The most even image shows the marks best.
    let last = readings.shown.iter().rev().find(|shown| {
        let light = shown.wanted.iter().flatten();
        let least = light.clone().fold(f64::INFINITY, |a, b| a.min(*b));
        light.fold(0.0_f64, |a, b| a.max(*b)) - least < 1e-6
    });
    let shown = last.or_else(|| readings.shown.first());
    if let Some(view) = shown.and_then(|shown| shown.views[1].as_ref()) {
        let picture = marked_view(&view.scaled(scale), readings, verdict);
        files.push(picture_file("worst-seen", &picture));
    }
    files
}

/// The error of every pixel, and the first of the finer images, at the camera's resolution or as
/// near to it as a page has room for.
fn pixel_pictures(
    table: &Table<'_>,
    readings: &Readings,
    verdict: &TableVerdict,
    scale: f64,
) -> Vec<PictureFile> {
    let (Some(judged), Some(Ok(pixels))) = (&verdict.pixels, &readings.revisited.pixels) else {
        return Vec::new();
    };
    let fitting = |mut picture: LightPicture| {
        while picture.size().width() > MOST_WIDTH {
            picture = picture.halved();
        }
        picture
    };
    let mut files = Vec::new();
    let colours = pixel_scale(judged);
    if let Some(errors) = on_camera(pixels, std::slice::from_ref(&judged.errors)) {
        let errors = fitting(errors);
        let values = errors.planes()[0].iter().map(|error| f64::from(*error));
        files.push(picture_file(
            "pixel-errors",
            &colours.picture(errors.size(), values),
        ));
    }
    let (Some(first), Some(white)) = (readings.fine.first(), judged.white.first()) else {
        return files;
    };
    let wanted = wanted(pixels, first);
    let all = [
        ("fine-wanted", wanted, scale * white),
        ("fine-before", seen(table, pixels, 0), scale),
        ("fine-after", seen(table, pixels, 1), scale),
    ];
    let compared = compared(pixels);
    for (name, planes, scale) in all {
        let light = on_camera(pixels, &planes).map(|light| {
            let size = light.size();
            let whole = light.with_planes(|_, plane| filled(size, plane, &compared));
            fitting(whole).scaled(scale).for_display()
        });
        files.extend(light.map(|light| picture_file(name, &light)));
    }
    files
}

/// A plane whose pixels that are not compared have the mean of those beside them, where at least
/// half of these are: pixels that see the edge of two of the projector's would be dots.
fn filled(size: FrameSize, plane: &[f32], compared: &[bool]) -> Vec<f32> {
    let (width, height) = (size.width(), size.height());
    let mut filled = plane.to_vec();
    for (at, value) in filled
        .iter_mut()
        .enumerate()
        .filter(|(at, _)| !compared[*at])
    {
        let (x, y) = (at % width, at / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let beside = rows
            .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x));
        let known: Vec<f32> = beside
            .filter(|at| compared[*at])
            .map(|at| plane[at])
            .collect();
        if known.len() >= 4 {
            *value = known.iter().sum::<f32>() / known.len() as f32;
        }
    }
    filled
}

/// Colours of the map of the pixels' errors: up to what 99 of 100 are below.
pub(super) fn pixel_scale(judged: &PixelVerdict) -> ColourScale {
    let worst = quantile(&mut judged.errors.clone(), 0.99).unwrap_or(0.0);
    ColourScale::linear(Palette::Magma, rounded(f64::from(worst)))
}

/// What photographs are multiplied by on a screen: all by the same, so that one that is darker
/// looks darker.
fn display_scale(readings: &Readings) -> f64 {
    let views = readings
        .shown
        .iter()
        .flat_map(|shown| shown.views.iter().flatten());
    let bright = views.map(|view| view.quantile(0.995));
    1.0 / bright.fold(0.0, f64::max).max(1e-12)
}

/// The cell that a pixel of a photograph for people sees.
fn cell_at(readings: &Readings, size: FrameSize, at: usize) -> Option<usize> {
    let step = readings.revisited.step;
    let (x, y) = (at % size.width(), at / size.width());
    let (x, y) = (x * step + step / 2, y * step + step / 2);
    let registration = &readings.revisited.registration;
    let cell = registration.seen_cell.get(y * registration.camera.0 + x)?;
    (*cell != NO_CELL).then_some(*cell as usize)
}

const LETTERS: Type = Type {
    height: RasterHeight::Size16,
    weight: FontWeight::Bold,
    colour: MARK,
};

/// A photograph with the worst cells outlined and numbered.
fn marked_view(view: &LightPicture, readings: &Readings, verdict: &TableVerdict) -> Picture {
    let size = view.size();
    let cols = readings.revisited.grid.cols();
    let mut canvas = Canvas::new(size, [0; 3]);
    canvas.place(0, 0, &view.for_display());
    let cells: Vec<Option<usize>> = (0..size.pixels())
        .map(|at| cell_at(readings, size, at))
        .collect();
    for (number, worst) in verdict.worst.iter().take(MARKED).enumerate() {
        let own = Some(worst.row * cols + worst.col);
        let inside = |x: usize, y: usize| {
            x < size.width() && y < size.height() && cells[y * size.width() + x] == own
        };
        let mut right = None;
        for at in (0..size.pixels()).filter(|at| cells[*at] == own) {
            let (x, y) = (at % size.width(), at / size.width());
            right = right.max(Some((x, y)));
            let around = [
                (x + 1, y),
                (x.wrapping_sub(1), y),
                (x, y + 1),
                (x, y.wrapping_sub(1)),
            ];
            if around.iter().any(|(x, y)| !inside(*x, *y)) {
                canvas.set(x, y, MARK);
            }
        }
        if let Some((x, y)) = right {
            canvas.write(
                x + 3,
                y.saturating_sub(8),
                &(number + 1).to_string(),
                LETTERS,
            );
        }
    }
    canvas.finish()
}

/// A map of cells with the worst framed and numbered.
fn marked_map(grid: Grid, map: &Picture, verdict: &TableVerdict) -> Picture {
    let size = map.size();
    let (width, height) = (size.width() / grid.cols(), size.height() / grid.rows());
    let mut canvas = Canvas::new(size, [0; 3]);
    canvas.place(0, 0, map);
    for (number, worst) in verdict.worst.iter().take(MARKED).enumerate() {
        let (left, top) = (worst.col * width, worst.row * height);
        for x in 0..width {
            for edge in [0, 1, height.saturating_sub(2), height.saturating_sub(1)] {
                canvas.set(left + x, top + edge, MARK);
            }
        }
        for y in 0..height {
            for edge in [0, 1, width.saturating_sub(2), width.saturating_sub(1)] {
                canvas.set(left + edge, top + y, MARK);
            }
        }
        canvas.write(left + 4, top + 3, &(number + 1).to_string(), LETTERS);
    }
    canvas.finish()
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

/// Cells as squares of pixels.
fn blocks(cells: &Picture) -> Picture {
    let size = cells.size();
    cells.enlarged(MAP_SIDE.div_ceil(size.width().max(size.height())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Samples;

    #[test]
    fn a_pixel_that_is_not_compared_shows_those_beside_it_and_none_beyond_the_picture_does() {
        let size = FrameSize::new(5, 3).unwrap();
        let mut compared = vec![false; 15];
        let mut plane = vec![0.0; 15];
        // The left 3 x 3 pixels but for their middle.
        for at in [0, 1, 2, 5, 7, 10, 11, 12] {
            compared[at] = true;
            plane[at] = if at < 3 { 0.8 } else { 0.4 };
        }
        let mut wanted = plane.clone();
        wanted[6] = (3.0 * 0.8 + 5.0 * 0.4) / 8.0;
        for (at, (found, wanted)) in filled(size, &plane, &compared)
            .iter()
            .zip(wanted)
            .enumerate()
        {
            assert!((found - wanted).abs() < 1e-6, "{at}: {found} {wanted}");
        }
    }

    #[test]
    fn a_map_shows_every_cell_in_its_place() {
        let grid = Grid::new(2, 3).unwrap();
        let scale = ColourScale::linear(Palette::Magma, 1.0);
        let cells = [Some(0.0), Some(0.5), None, Some(1.0), None, Some(0.25)];
        let picture = map(grid, &scale, &cells);
        let (width, height) = (picture.size().width(), picture.size().height());
        let Samples::Eight(samples) = picture.samples() else {
            panic!("8 bits");
        };
        for (cell, value) in cells.into_iter().enumerate() {
            let (row, col) = (cell / 3, cell % 3);
            let (x, y) = ((2 * col + 1) * width / 6, (2 * row + 1) * height / 4);
            let at = 3 * (y * width + x);
            let wanted = value.map_or(UNKNOWN, |value| scale.colour(value));
            assert_eq!(samples[at..at + 3], wanted, "{cell}");
        }
    }
}
