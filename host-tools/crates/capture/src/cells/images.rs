//! Images: pictures of any content beside the patterns. What the projector throws on each cell,
//! and on some pixels of the camera, follows from the picture's codes and the projector's response.

use super::measurements::Measurements;
use crate::format::bracket::Bracket;
use crate::format::error::CaptureError;
use crate::format::picture_file::{EXPORT, Opened, Source};
use crate::format::role::Role;
use crate::format::sequence::Sequence;
use crate::photographs::channel_sum;
use crate::photographs::order::{Order, Wrong};
use crate::registration::projector_map::MapSource;
use iltm_picture::statistics::median;
use iltm_picture::{LightPicture, Picture, ProjectorResponse};
use iltm_runtime::resample::area::AreaAverage;
use iltm_runtime::{FrameSize, Grid, placement::ProjectorPixels, units::Light};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Another image explains a photograph if it leaves less than this of what the own one leaves.
const CLEARLY: f64 = 0.5;

/// A photograph of which its image leaves more than this, of the light's variance, and so many times
/// what images usually leave, shows none.
const UNEXPLAINED: (f64, f64) = (0.5, 4.0);

/// Fewer images are compared with too few others to say what is usual.
const LEAST_IMAGES: usize = 4;

/// What a camera without colours sees of red, green and blue, where nothing tells: luminance of
/// ITU-R BT.709.
const GREY: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Smallest eigenvalue of the images' colours, of the largest, from which they tell channels apart.
const LEAST_COLOUR: f64 = 1e-4;

/// Pixels of a cell whose places are looked at.
const MOST_AVERAGED: usize = 64;

/// Places along a side of what a camera pixel sees at which a picture is looked at.
const LOOKS: usize = 3;

/// The images of a sequence: what was shown, and how the projector's light follows it.
pub(crate) struct KnownImages<'i> {
    folder: &'i Path,
    images: &'i [Bracket],
    grid: Grid,
    projector: Option<ProjectorPixels>,
    response: ProjectorResponse,
}

impl<'i> KnownImages<'i> {
    /// `projector` are its pixels, where they are stated.
    pub(crate) fn new(
        folder: &'i Path,
        sequence: &'i Sequence,
        projector: Option<ProjectorPixels>,
        response: ProjectorResponse,
    ) -> Self {
        Self {
            folder,
            images: &sequence.images,
            grid: sequence.grid,
            projector,
            response,
        }
    }

    /// The same images as a projector of this response throws them.
    pub(crate) const fn with_response(&self, response: ProjectorResponse) -> Self {
        Self { response, ..*self }
    }

    pub(crate) const fn len(&self) -> usize {
        self.images.len()
    }

    /// Light of an image, without the border.
    ///
    /// # Errors
    /// A picture's own error; [`CaptureError::Picture`] if it has neither a pixel a cell nor one a
    /// pixel of the projector.
    pub(crate) fn light(&self, at: usize) -> Result<LightPicture, CaptureError> {
        let path = self.path(at);
        let picture = read(self.source(at, &path), self.grid, self.projector)?;
        Ok(LightPicture::decode(&picture, self.response.clone()))
    }

    /// Mean light of an image over each cell, by channel.
    ///
    /// # Errors
    /// As [`KnownImages::light`].
    pub(crate) fn cell_means(&self, at: usize) -> Result<Vec<Vec<f64>>, CaptureError> {
        let light = self.light(at)?;
        let planes = light.planes().iter();
        Ok(planes
            .map(|plane| cell_means(plane, light.size(), self.grid))
            .collect())
    }

    /// The projector's pixels that images have: as stated, or those of the first one; `None` without
    /// images, or if one of them has a pixel a cell: such pixels are even.
    ///
    /// # Errors
    /// As [`KnownImages::light`].
    pub(crate) fn pixels(&self) -> Result<Option<ProjectorPixels>, CaptureError> {
        let (cols, rows) = (self.grid.cols() as u32, self.grid.rows() as u32);
        for at in 0..self.len() {
            let path = self.path(at);
            if Opened::open(self.source(at, &path))?.size() == (cols, rows) {
                return Ok(None);
            }
        }
        if self.images.is_empty() {
            return Ok(None);
        }
        let own = || Ok(ProjectorPixels::whole(self.light(0)?.size()));
        self.projector.map_or_else(own, Ok).map(Some)
    }

    fn path(&self, at: usize) -> PathBuf {
        self.folder.join(&self.images[at].shots[0].pattern)
    }

    fn source<'p>(&self, at: usize, path: &'p Path) -> Source<'p> {
        Source {
            path,
            what: "pattern",
            line: self.images[at].shots[0].line,
        }
    }
}

/// Adds the images of a sequence to the patterns: their photographs are observed already.
///
/// # Errors
/// A picture's own error; [`CaptureError::Picture`] if it has neither a pixel a cell nor one a
/// pixel of the projector.
pub(crate) fn add(
    folder: &Path,
    sequence: &Sequence,
    measurements: &mut Measurements,
) -> Result<(), CaptureError> {
    let images = &sequence.images;
    if images.is_empty() {
        return Ok(());
    }
    let grid = measurements.grid;
    let projector = measurements.settings.projector.pixels();
    let response = measurements.devices.projector.clone();
    let known = KnownImages::new(folder, sequence, projector, response);
    let places = measurements.places();
    let pixel = measurements.registration.pixel_in_cells(grid);
    let averaged = averaged(measurements);
    let mut all = Vec::with_capacity(images.len());
    for at in 0..images.len() {
        let light = known.light(at)?;
        let size = light.size();
        let of_cells = size == FrameSize::of_grid(grid);
        let look = |plane: &[f32], place: &Option<[f32; 2]>| match place {
            // An edge between cells lies anywhere in a pixel.
            Some(place) if !of_cells => seen_at(plane, size, (*place, pixel), grid),
            _ => f32::NAN,
        };
        let on_cells = |plane: &[f32]| {
            let mut means = cell_means(plane, size, grid);
            if of_cells {
                return means;
            }
            for (mean, pixels) in means.iter_mut().zip(&averaged) {
                let seen = |(place, share): &([f32; 2], f32)| {
                    share * seen_at(plane, size, (*place, pixel), grid)
                };
                if !pixels.is_empty() {
                    *mean = f64::from(pixels.iter().map(seen).sum::<f32>());
                }
            }
            means
        };
        let planes = light.planes().par_iter().map(|plane| Thrown {
            cells: DVector::from_vec(on_cells(plane)),
            pixels: places.iter().map(|place| look(plane, place)).collect(),
        });
        all.push(planes.collect::<Vec<Thrown>>());
    }
    let shares = shares(measurements, &all);
    let first = measurements.roles.len();
    for (channel, shares) in measurements.channels.iter_mut().zip(&shares) {
        let patterns = std::mem::replace(&mut channel.patterns, DMatrix::zeros(0, 0));
        channel.patterns = patterns.resize_horizontally(first + images.len(), 0.0);
        for (at, planes) in all.iter().enumerate() {
            let mut column = channel.patterns.column_mut(first + at);
            for (plane, share) in planes.iter().zip(shares_of(*shares, planes.len())) {
                column.axpy(share, &plane.cells, 1.0);
            }
        }
    }
    for (thrown, shares) in measurements.pixel_light.thrown.iter_mut().zip(&shares) {
        let of_image = |planes: &Vec<Thrown>| {
            let mut pixels = vec![0.0; places.len()];
            for (plane, share) in planes.iter().zip(shares_of(*shares, planes.len())) {
                for (sum, light) in pixels.iter_mut().zip(&plane.pixels) {
                    *sum += share as f32 * light;
                }
            }
            pixels
        };
        thrown.extend(all.iter().map(of_image));
    }
    measurements
        .roles
        .extend(images.iter().map(|_| Role::Image));
    measurements.repeats.extend(images.iter().map(|_| 1));
    Ok(())
}

/// Places, in cells, of the pixels that a cell's light is the mean of, and how much each of them counts
/// in it, in all 1; nothing of a cell where they are not known finely.
///
/// An image is not even within a cell: what is observed of it is what its pixels see.
fn averaged(measurements: &Measurements) -> Vec<Vec<([f32; 2], f32)>> {
    let grid = measurements.grid;
    let mut of_cells = vec![Vec::new(); grid.cells()];
    let Some(Ok(map)) = &measurements.map else {
        return of_cells;
    };
    if !matches!(map.source, MapSource::Waves | MapSource::Images) {
        return of_cells;
    }
    let flood = channel_sum(&measurements.flood);
    let cells = measurements.registration.cell_of_pixel.iter();
    for (pixel, cell) in cells.enumerate() {
        let place = map.in_cells(map.position[pixel], grid);
        let known = !place[0].is_nan() && flood[pixel] > 0.0;
        if let Some(pixels) = of_cells.get_mut(*cell as usize).filter(|_| known) {
            pixels.push((place, flood[pixel]));
        }
    }
    for pixels in &mut of_cells {
        let step = pixels.len().div_ceil(MOST_AVERAGED).max(1);
        let mut kept: Vec<_> = pixels.iter().copied().step_by(step).collect();
        let sum: f32 = kept.iter().map(|(_, light)| light).sum();
        for (_, light) in &mut kept {
            *light /= sum;
        }
        *pixels = kept;
    }
    of_cells
}

/// What one channel of an image throws.
struct Thrown {
    /// On each cell.
    cells: DVector<f64>,
    /// On each sampled pixel of the camera.
    pixels: Vec<f32>,
}

/// A grey image throws the same in all channels.
fn shares_of(shares: [f64; 3], planes: usize) -> [f64; 3] {
    match planes {
        1 => [1.0, 0.0, 0.0],
        _ => shares,
    }
}

/// How much each of the projector's channels counts in each channel of the measurements, in all 1:
/// the channel alone where the measurements are the projector's, as they were measured where there is
/// a ramp; else by the images themselves, as a camera without colours needs it.
fn shares(measurements: &Measurements, images: &[Vec<Thrown>]) -> Vec<[f64; 3]> {
    let alone = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let channels = measurements.channels.len();
    if channels == 3 && measurements.devices.unmixed {
        return alone.to_vec();
    }
    if channels == 3
        && let Some(mixing) = measurements.devices.mixing()
    {
        let of_row = |row: [f64; 3]| row.map(|share| share / row.iter().sum::<f64>());
        return mixing.matrix.map(of_row).to_vec();
    }
    let found = |channel: usize| found_shares(measurements, channel, images);
    (0..channels)
        .map(|channel| found(channel).unwrap_or(if channels == 3 { alone[channel] } else { GREY }))
        .collect()
}

/// The same of one channel: by what differs between a cell and those beside it, to which light
/// that bounces adds little, or where images are even, by all of their light. `None` where they
/// have no colours that tell channels apart.
fn found_shares(
    measurements: &Measurements,
    channel: usize,
    images: &[Vec<Thrown>],
) -> Option<[f64; 3]> {
    let grid = measurements.grid;
    let observed = &measurements.channels[channel].observations;
    let first = measurements.roles.len();
    let white = observed.column(Measurements::WHITE);
    let usable = |cell: &usize| measurements.live[*cell] && white[*cell] > 0.0;
    let cells: Vec<usize> = (0..grid.cells()).filter(usable).collect();
    let (mut steps, mut levels) = (ShareFit::default(), ShareFit::default());
    for (at, planes) in images.iter().enumerate() {
        let [red, green, blue] = planes.as_slice() else {
            continue;
        };
        let light = observed.column(first + at);
        let thrown = |cell: usize| {
            let of = |plane: &Thrown| plane.cells[cell];
            Vector3::new(of(red), of(green), of(blue))
        };
        let (mut all_thrown, mut all_light) = (Vector3::zeros(), 0.0);
        for &cell in &cells {
            all_thrown += thrown(cell) * white[cell];
            all_light += light[cell];
            let beside = [
                (cell % grid.cols() + 1 < grid.cols(), cell + 1),
                (cell / grid.cols() + 1 < grid.rows(), cell + grid.cols()),
            ];
            for (within, other) in beside {
                if within && usable(&other) {
                    // Dark cells are noisy.
                    let weight = white[cell].min(white[other]);
                    let step = light[cell] / white[cell] - light[other] / white[other];
                    steps.add((thrown(cell) - thrown(other)) * weight, step * weight);
                }
            }
        }
        levels.add(all_thrown, all_light);
    }
    steps.shares().or_else(|| levels.shares())
}

/// Least squares of the shares.
#[derive(Default)]
struct ShareFit {
    normal: Matrix3<f64>,
    right: Vector3<f64>,
}

impl ShareFit {
    fn add(&mut self, thrown: Vector3<f64>, light: f64) {
        self.normal += thrown * thrown.transpose();
        self.right += thrown * light;
    }

    /// None is negative, and all together are 1.
    fn shares(&self) -> Option<[f64; 3]> {
        let values = self.normal.symmetric_eigenvalues();
        // Written so that no colour at all is none as well.
        let told = values.min() > LEAST_COLOUR * values.max();
        let found = told.then(|| self.normal.try_inverse()).flatten()? * self.right;
        let sum: f64 = found.iter().map(|share| share.max(0.0)).sum();
        (sum > 0.0).then(|| [0, 1, 2].map(|k: usize| found[k].max(0.0) / sum))
    }
}

/// Which image each photograph of one shows: by what is left of the cells' light beside what the image
/// throws there, white's light times the image's, and even light. `None` of fewer than four.
pub(crate) fn order(measurements: &Measurements) -> Option<Order> {
    let count = measurements.diagnostics.images;
    let first = measurements.roles.len() - count;
    if count < LEAST_IMAGES {
        return None;
    }
    let live = (0..measurements.grid.cells()).filter(|cell| measurements.live[*cell]);
    let live: Vec<usize> = live.collect();
    let mut seen = vec![Vec::new(); count];
    let mut thrown = seen.clone();
    for channel in &measurements.channels {
        let white = channel.observations.column(Measurements::WHITE);
        for at in 0..count {
            let (light, image) = (
                channel.observations.column(first + at),
                channel.patterns.column(first + at),
            );
            seen[at].extend(live.iter().map(|cell| light[*cell]));
            thrown[at].extend(live.iter().map(|cell| white[*cell] * image[*cell]));
        }
    }
    let [seen, thrown] = [seen, thrown].map(|all| {
        let without_mean = |values: Vec<f64>| {
            let mut values = DVector::from_vec(values);
            values.add_scalar_mut(-values.mean());
            values
        };
        all.into_iter().map(without_mean).collect::<Vec<_>>()
    });
    let left = |photo: usize, image: usize| {
        let (photo, image) = (&seen[photo], &thrown[image]);
        let both = photo.dot(image);
        // An even image explains nothing, and even light needs no explanation.
        let along = both.max(0.0) * both / image.norm_squared().max(f64::MIN_POSITIVE);
        1.0 - along / photo.norm_squared().max(f64::MIN_POSITIVE)
    };
    let own: Vec<f64> = (0..count).map(|at| left(at, at)).collect();
    let usual = median(own.clone()).unwrap_or(0.0);
    let none = UNEXPLAINED.0.max(UNEXPLAINED.1 * usual);
    let wrong = (0..count).filter_map(|shot| {
        let (shows, least) = (0..count)
            .map(|image| (image, left(shot, image)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        if least < CLEARLY * own[shot] && least < none {
            let shows = Some(shows);
            return Some(Wrong { shot, shows });
        }
        (own[shot] > none).then_some(Wrong { shot, shows: None })
    });
    Some(Order {
        wrong: wrong.collect(),
        // Half of the variance is as far as two random patterns are.
        distances: own.iter().map(|left| 0.5 * left).collect(),
        none: 0.5 * none,
    })
}

/// Reads a picture of one pixel a cell, or of the projector's size, of which the border is cut
/// away; where that size is not stated, of any that has a pixel a cell or more.
fn read(
    source: Source<'_>,
    grid: Grid,
    projector: Option<ProjectorPixels>,
) -> Result<Picture, CaptureError> {
    let refuse = |reason: String, next_step| CaptureError::Picture {
        path: source.path.to_owned(),
        reason,
        next_step,
    };
    let opened = Opened::open(source)?;
    let (width, height) = opened.size();
    let samples = opened.decode()?.codes();
    let samples = samples.ok_or_else(|| {
        refuse(
            "it holds floating point numbers and no codes".to_owned(),
            EXPORT,
        )
    })?;
    let side = |side: u32| u16::try_from(side).unwrap_or(0);
    let picture = FrameSize::new(side(width), side(height))
        .and_then(|size| Picture::new(size, samples))
        .filter(|picture| AreaAverage::new(grid, picture.size()).is_some());
    let fits = match (picture, projector) {
        (Some(picture), _) if picture.size() == FrameSize::of_grid(grid) => Some(picture),
        (Some(picture), Some(projector)) if picture.size() == projector.size() => picture
            .without_border(projector.border())
            .filter(|inner| AreaAverage::new(grid, inner.size()).is_some()),
        (picture, None) => picture,
        _ => None,
    };
    fits.ok_or_else(|| {
        let sizes = projector.map_or_else(
            || format!("an image has {} x {} or more", grid.cols(), grid.rows()),
            |projector| {
                format!(
                    "an image has {} x {}, as the projector has, or {} x {}, one a cell",
                    projector.size().width(),
                    projector.size().height(),
                    grid.cols(),
                    grid.rows()
                )
            },
        );
        refuse(
            format!("it has {width} x {height} pixels; {sizes}"),
            "Name the picture as it was sent to the projector.",
        )
    })
}

/// Mean light over each cell, by the device's own rule.
fn cell_means(plane: &[f32], size: FrameSize, grid: Grid) -> Vec<f64> {
    let mut sums = vec![0_u64; grid.cells()];
    let Some(average) = AreaAverage::new(grid, size) else {
        return vec![0.0; grid.cells()];
    };
    for (y, row) in plane.chunks_exact(size.width()).enumerate() {
        let light: Vec<Light> = row.iter().map(|v| Light::saturating_from_num(*v)).collect();
        average.add_row(y, &light, &mut sums);
    }
    let mean = |sum: &u64| average.mean(*sum).to_num();
    sums.iter().map(mean).collect()
}

/// Light of a picture that a camera pixel sees: the mean over `pixel`, in cells, around a place.
fn seen_at(
    plane: &[f32],
    size: FrameSize,
    ([across, down], pixel): ([f32; 2], [f64; 2]),
    grid: Grid,
) -> f32 {
    let sides = [(size.width(), grid.cols()), (size.height(), grid.rows())];
    let along = |axis: usize, at: f32| {
        let (pixels, cells) = sides[axis];
        std::array::from_fn::<_, LOOKS, _>(|k| {
            let step = (k as f32 + 0.5) / LOOKS as f32 - 0.5;
            let at = (at + step * pixel[axis] as f32) * pixels as f32 / cells as f32 - 0.5;
            let at = at.clamp(0.0, (pixels - 1) as f32);
            let before = at as usize;
            (before, (before + 1).min(pixels - 1), at - before as f32)
        })
    };
    let (columns, rows) = (along(0, across), along(1, down));
    let mut sum = 0.0;
    for (top, bottom, v) in rows {
        for (left, right, u) in columns {
            let value = |y: usize, x: usize| plane[y * size.width() + x];
            let of_row = |y: usize| (1.0 - u) * value(y, left) + u * value(y, right);
            sum += (1.0 - v) * of_row(top) + v * of_row(bottom);
        }
    }
    sum / (LOOKS * LOOKS) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_of_cells_and_pixels_is_the_mean_over_them() {
        let grid = Grid::new(2, 3).unwrap();
        // Cells of two and a half pixels by two.
        let size = FrameSize::new(8, 4).unwrap();
        let ramp = |x: usize, y: usize| (x as f32 + 0.5) / 16.0 + (y as f32 + 0.5) / 16.0;
        let plane: Vec<f32> = (0..32).map(|at| ramp(at % 8, at / 8)).collect();
        for (cell, mean) in cell_means(&plane, size, grid).into_iter().enumerate() {
            let (row, col) = (cell / 3, cell % 3);
            let centre = (8.0 * (col as f64 + 0.5) / 3.0) / 16.0 + (2.0 * row as f64 + 1.0) / 16.0;
            // A border within a pixel gives each side the pixel's mean.
            assert!((mean - centre).abs() < 0.02, "{cell}: {mean} {centre}");
        }
        for place in [[0.9, 1.1], [1.7, 0.6], [2.2, 1.5]] {
            let seen = seen_at(&plane, size, (place, [0.3, 0.2]), grid);
            let there = place[0] * 8.0 / 3.0 / 16.0 + place[1] * 2.0 / 16.0;
            assert!((seen - there).abs() < 1e-5, "{place:?}: {seen} {there}");
        }
        let cells: Vec<f32> = (0..6).map(|cell| cell as f32 / 8.0).collect();
        let means = cell_means(&cells, FrameSize::of_grid(grid), grid);
        assert!((0..6).all(|cell| (means[cell] - f64::from(cells[cell])).abs() < 1e-4));
    }

    #[test]
    fn a_picture_is_taken_in_the_projectors_size_or_the_grids() {
        let folder = tempfile::tempdir().unwrap();
        let grid = Grid::new(2, 3).unwrap();
        let projector = ProjectorPixels::new(FrameSize::new(14, 10).unwrap(), 1);
        let path = folder.path().join("p.png");
        let read_of = |width: u32, height: u32, projector| {
            image::RgbImage::new(width, height).save(&path).unwrap();
            let what = "pattern";
            let source = Source {
                path: &path,
                what,
                line: 2,
            };
            read(source, grid, projector)
                .map(|picture| (picture.size().width(), picture.size().height()))
        };
        assert_eq!(read_of(14, 10, projector).unwrap(), (12, 8));
        assert_eq!(read_of(3, 2, projector).unwrap(), (3, 2));
        assert_eq!(read_of(9, 7, None).unwrap(), (9, 7));
        for (projector, says) in [
            (
                projector,
                "it has 2 x 9 pixels; an image has 14 x 10, as the projector has, or 3 x 2",
            ),
            (None, "it has 2 x 9 pixels; an image has 3 x 2 or more"),
        ] {
            let error = read_of(2, 9, projector).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
