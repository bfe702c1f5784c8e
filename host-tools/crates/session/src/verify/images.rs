//! Test images: wanted light, one value a cell and channel, or one a pixel of the projector.
//!
//! Cell by cell, natural ones, an even grey, a checkerboard and, where a table has colours,
//! bars; pixel by pixel, natural ones. None wants black beside white, which walls that light
//! each other cannot show; where a table would still have to cut more than a little, the
//! contrast is lowered, so that the error is that of the table and not of the image.

use super::Expected;
use iltm_capture::CellPlanes;
use iltm_picture::{Lattice, Picture};
use iltm_runtime::{FrameSize, Grid, image::Table};
use iltm_solve::{SUPERSAMPLING, fine_natural_images, wanted_images};
use iltm_video::{CompensateOptions, Compensator, VideoError};

/// Natural images among the test images.
const NATURAL: usize = 3;

/// Test images of one pixel a pixel of the projector.
const FINE: usize = 4;

/// The first natural image that they are made of: those before are the others'.
const FIRST_FINE: usize = 4 * NATURAL;

/// Share of an image's light that its colours have in common: they differ less than brightness
/// does in what people watch.
const COMMON: f64 = 0.65;

/// Share of an image's samples that the table may have to cut.
pub(super) const MOST_CLIPPED: f64 = 0.005;

/// Darkest and brightest light that images are squeezed between, until they fit.
pub(super) const RANGES: [(f64, f64); 6] = [
    (0.2, 1.0),
    (0.2, 0.85),
    (0.3, 0.85),
    (0.3, 0.7),
    (0.4, 0.7),
    (0.45, 0.6),
];

/// Cells along the side of a checkerboard's field.
const FIELD: usize = 3;

/// Red, green and blue of the bars: 1 where lit.
const BARS: [[f64; 3]; 7] = [
    [1.0, 1.0, 1.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, 0.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0],
];

/// A test image, of one pixel a cell or one a pixel of the projector inside its border.
#[derive(Clone, PartialEq, Debug)]
pub struct TestImage {
    /// What it is, for people.
    pub title: String,
    /// sRGB codes, as many channels as the table has.
    pub wanted: Picture,
    /// The same, compensated: codes for the projector.
    pub compensated: Picture,
    /// Share of the samples that the table has to cut.
    pub clipped: f64,
}

/// The images that a table is verified with, of one pixel a cell.
///
/// # Errors
/// [`VideoError`] if the table cannot compensate a picture of its own size.
pub fn test_images(table: &Table<'_>) -> Result<Vec<TestImage>, VideoError> {
    let drawn = drawn(table.grid(), usize::from(table.channels()));
    compensated(table, FrameSize::of_grid(table.grid()), drawn)
}

/// The images that a table is judged by pixel by pixel, of `size`; none if it has fewer than four
/// pixels along a cell's sides.
///
/// # Errors
/// [`VideoError`] if the table cannot compensate a picture of this size.
pub fn fine_images(table: &Table<'_>, size: FrameSize) -> Result<Vec<TestImage>, VideoError> {
    let drawn = drawn_finely(table.grid(), size, usize::from(table.channels()));
    compensated(table, size, drawn)
}

/// Shapes as images that the table can show.
fn compensated(
    table: &Table<'_>,
    size: FrameSize,
    drawn: Vec<(String, CellPlanes)>,
) -> Result<Vec<TestImage>, VideoError> {
    let compensator = Compensator::new(table, CompensateOptions::default())?;
    // Where white is brighter than the wall can be everywhere, images are darker.
    let most = Expected::new(table).even_grey().min(1.0);
    let mut images = Vec::new();
    for (title, shape) in drawn {
        for (index, (dark, bright)) in RANGES.into_iter().enumerate() {
            let wanted = codes(size, &shape, (most * dark, most * bright));
            let mut compensated = wanted.clone();
            let summary = compensator.picture(&mut compensated)?;
            let clipped = summary.clipped as f64 / summary.samples.max(1) as f64;
            if clipped <= MOST_CLIPPED || index + 1 == RANGES.len() {
                images.push(TestImage {
                    title,
                    wanted,
                    compensated,
                    clipped,
                });
                break;
            }
        }
    }
    Ok(images)
}

/// An image's channels: each has a share of its own beside the common one.
fn coloured<'i>(
    common: &'i [f64],
    own: impl Fn(usize) -> &'i [f64],
    channels: usize,
) -> CellPlanes {
    let plane = |channel: usize| {
        let mix = |(common, own): (&f64, &f64)| COMMON * common + (1.0 - COMMON) * own;
        if channels == 1 {
            common.to_vec()
        } else {
            common.iter().zip(own(channel)).map(mix).collect()
        }
    };
    (0..channels).map(plane).collect()
}

/// Titles and shapes of natural images of `size`; none if it has fewer pixels than they have
/// samples.
fn drawn_finely(grid: Grid, size: FrameSize, channels: usize) -> Vec<(String, CellPlanes)> {
    let [cols, rows] = [grid.cols(), grid.rows()].map(|side| (side * SUPERSAMPLING) as u16);
    let samples = FrameSize::new(cols, rows);
    let Some(lattice) = samples.and_then(|samples| Lattice::between(samples, size)) else {
        return Vec::new();
    };
    let enlarged = |image: Vec<f64>| lattice.expand(&image).into_iter().map(f64::from).collect();
    let natural: Vec<Vec<f64>> = fine_natural_images(grid).map(enlarged).collect();
    let shape = |image: usize| {
        let own = |channel: usize| &natural[(image * 3 + channel) % FIRST_FINE][..];
        coloured(&natural[FIRST_FINE + image], own, channels)
    };
    let title = |image: usize| format!("Natural, pixels {}", image + 1);
    (0..FINE)
        .map(|image| (title(image), shape(image)))
        .collect()
}

/// Titles and shapes, 0 where darkest and 1 where brightest, one entry a channel.
fn drawn(grid: Grid, channels: usize) -> Vec<(String, CellPlanes)> {
    let (rows, cols) = (grid.rows(), grid.cols());
    let cells = move || (0..rows * cols).map(move |cell| (cell / cols, cell % cols));
    // Back from the range that `wanted_images` has to 0 to 1.
    let darkest = iltm_solve::DARKEST_WANTED;
    let natural = wanted_images(grid).map(|light| (light - darkest) / (1.0 - darkest));
    let columns: Vec<Vec<f64>> = natural
        .column_iter()
        .map(|column| column.iter().copied().collect())
        .collect();
    let mut drawn: Vec<(String, CellPlanes)> = (0..NATURAL)
        .map(|image| {
            let own = |channel: usize| columns[NATURAL + image * 3 + channel].as_slice();
            let planes = coloured(&columns[image], own, channels);
            (format!("Natural image {}", image + 1), planes)
        })
        .collect();
    drawn.push((
        "Even grey".to_owned(),
        vec![vec![0.5; grid.cells()]; channels],
    ));
    let fields =
        |(row, col): (usize, usize)| f64::from((row / FIELD + col / FIELD).is_multiple_of(2));
    drawn.push((
        "Checkerboard".to_owned(),
        vec![cells().map(fields).collect(); channels],
    ));
    if channels == 3 {
        let bar = |col: usize, channel: usize| BARS[col * BARS.len() / cols][channel];
        let plane = |channel| cells().map(|(_, col)| bar(col, channel)).collect();
        drawn.push(("Colour bars".to_owned(), (0..channels).map(plane).collect()));
    }
    drawn
}

/// A shape as sRGB codes between two lights.
fn codes(size: FrameSize, shape: &CellPlanes, (dark, bright): (f64, f64)) -> Picture {
    let code = |shape: f64| {
        let light = dark + (bright - dark) * shape;
        (iltm_picture::Response::Srgb.value(light) * 255.0).round() as u8
    };
    Picture::of_codes(size, shape.len(), |pixel, channel| {
        code(shape[channel][pixel])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn natural_images_are_of_all_brightness_and_each_colour_has_a_share_of_its_own() {
        let grid = Grid::new(12, 16).unwrap();
        let drawn = drawn(grid, 3);
        let natural = &drawn[..NATURAL];
        let planes: Vec<&Vec<f64>> = natural.iter().flat_map(|(_, planes)| planes).collect();
        assert_eq!(planes.len(), 9);
        for plane in &planes {
            assert!(
                plane
                    .iter()
                    .all(|light| (-1e-9..=1.0 + 1e-9).contains(light))
            );
        }
        // What is not common to an image's channels is no other channel's share.
        let own = |image: usize, channel: usize| -> Vec<f64> {
            let grey = super::drawn(grid, 1);
            let common = grey[image].1[0].iter().zip(&natural[image].1[channel]);
            common
                .map(|(common, mixed)| (mixed - 0.65 * common) / 0.35)
                .collect()
        };
        let shares: Vec<Vec<f64>> = (0..9).map(|k| own(k / 3, k % 3)).collect();
        for (k, share) in shares.iter().enumerate() {
            for other in &shares[..k] {
                let apart = share.iter().zip(other).map(|(a, b)| (a - b).abs());
                assert!(apart.fold(0.0, f64::max) > 0.1);
            }
        }
        let titles: Vec<&str> = drawn[NATURAL..].iter().map(|d| d.0.as_str()).collect();
        assert_eq!(titles, ["Even grey", "Checkerboard", "Colour bars"]);
    }

    #[test]
    fn fine_images_need_as_many_pixels_as_natural_ones_have_samples() {
        let grid = Grid::new(3, 5).unwrap();
        let size = FrameSize::new(5 * 8, 3 * 8).unwrap();
        let drawn = drawn_finely(grid, size, 3);
        assert_eq!(drawn.len(), FINE);
        for (_, planes) in &drawn {
            assert_eq!(planes.len(), 3);
            assert!(planes.iter().all(|plane| plane.len() == size.pixels()));
            assert_ne!(planes[0], planes[1]);
        }
        let fewer = FrameSize::new(5 * 4 - 1, 3 * 4).unwrap();
        assert!(drawn_finely(grid, fewer, 3).is_empty());
    }
}
