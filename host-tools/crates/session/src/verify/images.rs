//! Test images: wanted light, one value a cell and channel, or one a pixel of the projector.
//!
//! Cell by cell, natural ones, an even grey, a checkerboard and, where a table has colours,
//! bars; pixel by pixel, natural ones. None wants black beside white, which walls that light
//! each other cannot show; where a table would still have to cut more than a little, the
//! contrast is lowered, so that the error is that of the table and not of the image.

use super::Expected;
use iltm_capture::{CameraPlaces, CellPlanes};
use iltm_picture::{Lattice, Picture};
use iltm_runtime::{FrameSize, Grid, image::Table};
use iltm_solve::{SUPERSAMPLING, fine_natural_images, wanted_images};
use iltm_video::{CompensateOptions, Compensator, VideoError};

/// Natural images among the test images.
const NATURAL: usize = 3;

/// Title of the test image without any shape.
const EVEN_GREY: &str = "Even grey";

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

/// The same for several projectors that overlap: drawn on the camera's picture, so that what both show
/// of a place is one; and an even grey.
///
/// # Errors
/// [`VideoError`] if the table cannot compensate a picture of this size.
pub(super) fn screen_images(
    table: &Table<'_>,
    places: &CameraPlaces,
) -> Result<Vec<TestImage>, VideoError> {
    let drawn = drawn_on_camera(places, usize::from(table.channels()));
    compensated(table, places.frame, drawn)
}

/// Titles and shapes of images of a wide frame, drawn on the camera's picture.
fn drawn_on_camera(places: &CameraPlaces, channels: usize) -> Vec<(String, CellPlanes)> {
    let seen = || places.places.iter().flatten();
    let ends = |axis: usize| {
        let sides = seen().map(move |place| f64::from(place[axis]));
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        sides.fold(start, |(least, most), at| (least.min(at), most.max(at)))
    };
    let ends = [ends(0), ends(1)];
    let pixels = ends.map(|(least, most)| (most - least).floor() + 1.0);
    let cells = pixels.map(|pixels| (pixels / places.cell_side).round().max(1.0) as u16);
    // Of a camera with few pixels, the images are finer than its own.
    let finer = [0, 1].map(|axis| (SUPERSAMPLING * usize::from(cells[axis])) as f64 / pixels[axis]);
    let finer = finer[0].max(finer[1]).max(1.0);
    let [width, height] = pixels.map(|pixels| (pixels * finer).ceil() as u16);
    let size = FrameSize::new(width, height);
    let grid = Grid::new(cells[1], cells[0]).ok();
    let Some((size, grid)) = size.zip(grid) else {
        return Vec::new();
    };
    let on_frame = |plane: &Vec<f64>| -> Vec<f64> {
        let light = |place: &Option<[f32; 2]>| {
            let at =
                |axis: usize, place: &[f32; 2]| finer * (f64::from(place[axis]) - ends[axis].0);
            // Where the camera sees nothing, anything is as good.
            (place.as_ref()).map_or(0.5, |place| {
                between(plane, size, [at(0, place), at(1, place)])
            })
        };
        places.places.iter().map(light).collect()
    };
    let mut drawn = drawn_finely(grid, size, channels);
    for (_, planes) in &mut drawn {
        *planes = planes.iter().map(on_frame).collect();
    }
    if !drawn.is_empty() {
        let grey = vec![0.5; places.frame.pixels()];
        drawn.push((screen_title(drawn.len()), vec![grey; channels]));
    }
    drawn
}

/// Value of a plane between its pixels, linear.
fn between(plane: &[f64], size: FrameSize, place: [f64; 2]) -> f64 {
    let sides = [size.width(), size.height()];
    let first = [0, 1].map(|axis: usize| {
        let at = place[axis].clamp(0.0, sides[axis] as f64 - 1.0);
        (at as usize, at.fract())
    });
    let [(x, right), (y, down)] = first;
    let value = |x: usize, y: usize| plane[y.min(sides[1] - 1) * sides[0] + x.min(sides[0] - 1)];
    let row = |y: usize| value(x, y) + right * (value(x + 1, y) - value(x, y));
    row(y) + down * (row(y + 1) - row(y))
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
    (0..FINE)
        .map(|image| (screen_title(image), shape(image)))
        .collect()
}

/// Title of the image with this number among [`screen_images`].
pub(super) fn screen_title(image: usize) -> String {
    if image < FINE {
        format!("Natural, pixels {}", image + 1)
    } else {
        EVEN_GREY.to_owned()
    }
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
        EVEN_GREY.to_owned(),
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
    use iltm_picture::FramePart;

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

    #[test]
    fn two_projectors_show_the_same_of_the_places_that_both_light() {
        // Two pictures of 40 x 24 pixels. The first has the camera's pixels; the second is turned and
        // smaller on the camera's picture, which does not show one row of it.
        let (width, height) = (40, 24);
        let place = |x: usize, y: usize| {
            let (x, y) = (x as f32, y as f32);
            if x < width as f32 {
                Some([10.0 + x, 20.0 + y])
            } else {
                let (x, y) = (x - width as f32, y);
                (y > 0.0).then_some([35.0 + 0.6 * x - 0.25 * y, 22.0 + 0.7 * y + 0.1 * x])
            }
        };
        let all = (0..height).flat_map(|y| (0..2 * width).map(move |x| place(x, y)));
        let places = CameraPlaces {
            grid: Grid::new(3, 10).unwrap(),
            frame: FrameSize::new(2 * width as u16, height as u16).unwrap(),
            parts: FramePart::side_by_side([[3, 5]; 2]),
            places: all.collect(),
            cell_side: 8.0,
            white: Vec::new(),
            correspondences: Vec::new(),
        };
        let drawn = drawn_on_camera(&places, 3);
        assert_eq!(drawn.len(), FINE + 1);
        for (title, planes) in &drawn {
            assert_eq!(planes.len(), 3);
            let spread = planes[0]
                .iter()
                .fold(0.0_f64, |most, v| most.max((v - 0.5).abs()));
            assert_eq!(spread < 1e-9, title == EVEN_GREY, "{title}: {spread}");
            let mut met = 0;
            for (at, value) in planes[1].iter().enumerate() {
                let (x, y) = (at % (2 * width), at / (2 * width));
                let Some([u, v]) = place(x, y).filter(|_| x >= width) else {
                    continue;
                };
                // The pixel of the first picture at the same place, if there is one.
                let (x, y) = (u - 10.0, v - 20.0);
                if x <= width as f32 - 1.0 && y <= height as f32 - 1.0 {
                    met += 1;
                    let around = [0, 1].map(|dy| {
                        [0, 1].map(|dx| {
                            let (x, y) = (x as usize + dx, y as usize + dy);
                            planes[1][y.min(height - 1) * 2 * width + x.min(width - 1)]
                        })
                    });
                    let least = around.concat().into_iter().fold(f64::INFINITY, f64::min);
                    let most = around.concat().into_iter().fold(0.0, f64::max);
                    let within = (least - 1e-6..=most + 1e-6).contains(value);
                    assert!(within, "{title} {u} {v}: {value} not in {least}..{most}");
                }
            }
            assert!(met > 300, "{met}");
        }
        let coarse = CameraPlaces {
            cell_side: 2.0,
            ..places
        };
        assert_eq!(drawn_on_camera(&coarse, 1).len(), FINE + 1);
    }
}
