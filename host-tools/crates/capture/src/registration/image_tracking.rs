//! Image tracking: which place of the projector's picture each camera pixel sees, from the light of
//! known images over time, without any stripes.
//!
//! The cell of each pixel is known. From its middle on the place is found coarse to fine: at images
//! averaged over fewer and fewer pixels, the pixel's light is fitted by that of the place, its slopes
//! (the step of Lucas and Kanade), a constant, and the image's brightness and the light around the place,
//! which stand for light that bounces. A pixel whose place explains little of its light starts again on the plane through its
//! neighbours' places. What the fit leaves says how sure a place is.

use super::cell_map::{NO_CELL, Registration};
use super::image_matching::RelativeLight;
use super::local_planes;
use super::projector_map::{MapSource, ProjectorMap};
use super::sites::Sites;
use crate::cells::images::KnownImages;
use crate::format::error::CaptureError;
use crate::format::sequence::MIN_MATCHED;
use crate::photographs::Photographs;
use crate::photographs::linearise::LinearPhotographs;
use iltm_picture::progress::Progress;
use iltm_picture::statistics::median;
use iltm_picture::{LightPicture, Response};
use iltm_runtime::Grid;
use iltm_runtime::placement::ProjectorPixels;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

/// Steps at each size of the pictures.
const STEPS: usize = 3;

/// Longest step, in pixels of the averaged picture.
const LONGEST_STEP: f32 = 1.5;

/// Standard error of a place, in cells and at least a projector pixel, up to which it is one.
const MOST_UNCERTAIN: f32 = 0.25;

/// How many times what places usually leave unexplained a good one leaves at most, and share of the
/// usual direct light that a pixel has there at least.
const MOST_OF_GOOD: f32 = 3.0;
const GOOD_DIRECT: f32 = 0.7;

/// Share of the direct light that pixels usually have from which a pixel has its own.
const LEAST_DIRECT_OF_USUAL: f32 = 0.5;

/// How many times what their places usually leave unexplained of pixels' light one may leave.
const MOST_OF_USUAL: f32 = 10.0;

/// Shares of its light that a place may always leave unexplained, and never.
const MOST_UNEXPLAINED: (f32, f32) = (0.1, 0.5);

/// Share of white's light that must come straight from the place.
const LEAST_DIRECT: f64 = 0.05;

/// Pixels by which a response is judged, at least and at most.
const LEAST_JUDGED: usize = 200;
const MOST_JUDGED: usize = 20_000;

/// Powers that are tried as the projector's response: the first, their step and how many follow.
const POWERS: (f64, f64, u32) = (1.0, 0.2, 10);

/// A power that leaves less than this of what sRGB leaves is another response.
const CLEARLY_LESS: f64 = 0.7;

/// Error of a place on the plane of 25, of that of one alone: their mean slope and level have three of
/// 25 parts of the variance, and neighbours share some of their error. Of path-traced photographs it is
/// less, a third.
const ON_PLANE: f32 = 0.5;

/// How much coarser the image is that stands for light from around, and images that it takes to tell
/// that light.
const AROUND: usize = 8;
const LEAST_FOR_AROUND: usize = 30;

/// Colours, two slopes, a constant, brightness, and the light around with its slopes.
const UNKNOWNS: usize = 10;

/// Sums of a fit: the upper half of its normal equations, its right side and the square of the light.
const SUMS: usize = UNKNOWNS * (UNKNOWNS + 1) / 2 + UNKNOWNS + 1;

/// Pixels that one thread works on at a time.
const CHUNK: usize = 2048;

/// An image averaged over squares of pixels.
struct Averaged {
    size: (usize, usize),
    planes: Vec<Vec<f32>>,
    /// Mean of all of it.
    brightness: f32,
}

impl Averaged {
    fn new(light: &LightPicture, whole: (usize, usize), side: usize) -> Self {
        let (width, height) = (light.size().width(), light.size().height());
        // An image of one pixel a cell is averaged less.
        let side = (side * width / whole.0).max(1);
        let size = (width.div_ceil(side), height.div_ceil(side));
        let plane = |plane: &Vec<f32>| {
            let mean = |square: usize| {
                let (left, top) = (square % size.0 * side, square / size.0 * side);
                let (right, bottom) = ((left + side).min(width), (top + side).min(height));
                let rows = (top..bottom).map(|y| &plane[y * width + left..y * width + right]);
                let sum: f32 = rows.flatten().sum();
                sum / ((right - left) * (bottom - top)) as f32
            };
            (0..size.0 * size.1).map(mean).collect::<Vec<f32>>()
        };
        let planes: Vec<Vec<f32>> = light.planes().iter().map(plane).collect();
        let all = planes.iter().map(Vec::len).sum::<usize>() as f32;
        Self {
            brightness: planes.iter().flatten().sum::<f32>() / all,
            size,
            planes,
        }
    }

    /// Light of a plane at a place, in parts of the picture, and its slopes over the picture.
    fn at(&self, plane: &[f32], place: [f32; 2]) -> [f32; 3] {
        let (width, height) = self.size;
        // Beyond the border light goes on as it ends there, a pixel at most.
        let along = |at: f32, pixels: usize| {
            let at = (at * pixels as f32 - 0.5).clamp(-1.0, pixels as f32);
            let before = (at.max(0.0) as usize).min(pixels.saturating_sub(2));
            (before, (before + 1).min(pixels - 1), at - before as f32)
        };
        let ((left, right, u), (top, bottom, v)) =
            (along(place[0], width), along(place[1], height));
        let value = |x: usize, y: usize| plane[y * width + x];
        let (a, b) = (value(left, top), value(right, top));
        let (c, d) = (value(left, bottom), value(right, bottom));
        [
            (1.0 - v) * ((1.0 - u) * a + u * b) + v * ((1.0 - u) * c + u * d),
            ((1.0 - v) * (b - a) + v * (d - c)) * width as f32,
            ((1.0 - u) * (c - a) + u * (d - b)) * height as f32,
        ]
    }
}

/// A pixel on its way to its place.
#[derive(Clone, Copy)]
struct Tracked {
    pixel: usize,
    /// In parts of the picture.
    place: [f32; 2],
    /// What each colour adds to the pixel's light, in all 1.
    colours: [f32; 3],
    /// Standard error of the place in each direction, in parts of the picture.
    error: [f32; 2],
    explained: f32,
    /// Part of white's light that comes straight from the place.
    direct: f32,
}

impl Tracked {
    const fn new(pixel: usize) -> Self {
        Self {
            pixel,
            place: [f32::NAN; 2],
            colours: [1.0 / 3.0; 3],
            error: [f32::INFINITY; 2],
            explained: 0.0,
            direct: 0.0,
        }
    }
}

/// What pixels usually get straight from their places, and what these leave unexplained of their
/// light: medians.
struct Usual {
    direct: f32,
    unexplained: f32,
}

impl Usual {
    fn of(tracked: &[Tracked]) -> Self {
        let usual = |of: &dyn Fn(&Tracked) -> f32| {
            let all = tracked.iter().filter(|found| found.direct > 0.0).map(of);
            median(all.map(f64::from).collect()).unwrap_or(0.0) as f32
        };
        Self {
            direct: usual(&|found| found.direct),
            unexplained: usual(&|found| 1.0 - found.explained),
        }
    }

    /// Whether a pixel's place tells those of its neighbours.
    fn is_good(&self, found: &Tracked) -> bool {
        found.direct > GOOD_DIRECT * self.direct
            && 1.0 - found.explained <= MOST_OF_GOOD * self.unexplained
    }

    /// Whether a pixel's light comes from its place.
    fn is_own(&self, found: &Tracked) -> bool {
        let (least, most) = MOST_UNEXPLAINED;
        found.direct > LEAST_DIRECT_OF_USUAL * self.direct
            && 1.0 - found.explained < (MOST_OF_USUAL * self.unexplained).clamp(least, most)
    }
}

/// Finds the place of each pixel whose cell is known; `None` with too few images, or one that is no
/// finer than the cells.
///
/// # Errors
/// A picture's or a photograph's own error.
pub(crate) fn map(
    grid: Grid,
    linear: &LinearPhotographs<'_>,
    (images, photographs): (&KnownImages<'_>, &mut Photographs<'_>),
    registration: &Registration,
    progress: &dyn Progress,
) -> Result<Option<ProjectorMap>, CaptureError> {
    let Some(projector) = images.pixels()?.filter(|_| images.len() >= MIN_MATCHED) else {
        return Ok(None);
    };
    let inner = projector.inner();
    let whole = (inner.width(), inner.height());
    let cell = [whole.0 / grid.cols(), whole.1 / grid.rows()];
    if cell[0].max(cell[1]) < 2 {
        return Ok(None);
    }
    let camera = registration.camera;
    let covered = registration.pixel_in_cells(grid);
    // Projector pixels that a camera's covers.
    let pixel = (covered[0] * cell[0] as f64 * covered[1] * cell[1] as f64).sqrt();
    // Of a camera that sees no cell it is none.
    if !pixel.is_finite() {
        return Ok(None);
    }
    let finest = power_of_two(pixel / 1.5);
    let mut side = power_of_two(cell[0].max(cell[1]) as f64 / 2.0).max(finest);
    let relative = RelativeLight::new(linear);
    let lit: Vec<bool> = (registration.seen_cell.iter())
        .map(|cell| *cell != NO_CELL)
        .collect();
    let start = |pixel: usize| {
        let cell = registration.seen_cell[pixel] as usize;
        let (row, col) = (cell / grid.cols(), cell % grid.cols());
        [
            (col as f32 + 0.5) / grid.cols() as f32,
            (row as f32 + 0.5) / grid.rows() as f32,
        ]
    };
    let mut places: Option<(Sites, Vec<Option<[f32; 2]>>)> = None;
    loop {
        let raster = if side == finest {
            1
        } else {
            (side as f64 / pixel.max(1e-6)).round().max(1.0) as usize
        };
        let sites = Sites::new(&lit, camera, raster);
        let from = |at: usize| match &places {
            None => start(at),
            Some((sites, known)) => {
                known[sites.square_of(at, camera.0)].unwrap_or_else(|| start(at))
            }
        };
        let pixels = sites.pixel.iter().flatten();
        let mut tracked: Vec<Tracked> = pixels
            .map(|&pixel| Tracked {
                place: from(pixel),
                ..Tracked::new(pixel)
            })
            .collect();
        for number in 0..STEPS {
            if number > 0 {
                straighten(&sites, &mut tracked, whole, side);
            }
            step(
                &mut tracked,
                (images, photographs),
                &relative,
                (whole, side),
                progress,
            )?;
        }
        if side <= finest {
            return Ok(Some(finished(
                &tracked,
                projector,
                registration,
                cell[0].max(cell[1]) as f32,
            )));
        }
        let found = spread(&sites, &tracked);
        places = Some((sites, found));
        side /= 2;
    }
}

/// The largest power of two that is not larger, at least 1.
fn power_of_two(size: f64) -> usize {
    1 << (size as usize).max(1).ilog2()
}

/// Moves pixels whose place explains little of their light, or lies beside the plane of the others
/// around, to that plane.
fn straighten(sites: &Sites, tracked: &mut [Tracked], whole: (usize, usize), side: usize) {
    let usual = Usual::of(tracked);
    let whole = [whole.0 as f32, whole.1 as f32];
    let mut place = spread(sites, tracked);
    for at in place.iter_mut().flatten() {
        *at = [at[0] * whole[0], at[1] * whole[1]];
    }
    let mut all = tracked.iter();
    let good = |pixel: &Option<usize>| {
        let found = pixel.and_then(|_| all.next());
        found.is_some_and(|found| usual.is_good(found))
    };
    let good: Vec<bool> = sites.pixel.iter().map(good).collect();
    sites.straighten(&mut place, &good, LONGEST_STEP * side as f32);
    for (tracked, at) in tracked.iter_mut().zip(place.into_iter().flatten()) {
        tracked.place = [at[0] / whole[0], at[1] / whole[1]];
    }
}

/// Places by square.
fn spread(sites: &Sites, tracked: &[Tracked]) -> Vec<Option<[f32; 2]>> {
    let mut all = tracked.iter();
    let next = |pixel: &Option<usize>| pixel.and_then(|_| Some(all.next()?.place));
    sites.pixel.iter().map(next).collect()
}

/// One step of all pixels, at images averaged over squares of `side` pixels.
fn step(
    tracked: &mut [Tracked],
    (images, photographs): (&KnownImages<'_>, &mut Photographs<'_>),
    relative: &RelativeLight,
    (whole, side): ((usize, usize), usize),
    progress: &dyn Progress,
) -> Result<(), CaptureError> {
    let all: Vec<usize> = (0..images.len()).collect();
    progress.begin("finding pixels in images", all.len() as u64);
    let mut sums = vec![[0.0_f32; SUMS]; tracked.len()];
    let (mut wrong, mut coloured) = (None, false);
    photographs.for_batches(&all, progress, |photos| {
        let averaged: Result<Vec<[Averaged; 2]>, CaptureError> = (photos.par_iter())
            .map(|(at, _)| {
                let light = images.light(*at)?;
                Ok([side, AROUND * side].map(|side| Averaged::new(&light, whole, side)))
            })
            .collect();
        let averaged = match averaged {
            Ok(averaged) => averaged,
            Err(error) => {
                wrong = wrong.take().or(Some(error));
                return;
            }
        };
        coloured |= averaged.iter().any(|[image, _]| image.planes.len() == 3);
        let chunks = sums.par_chunks_mut(CHUNK).zip(tracked.par_chunks(CHUNK));
        chunks.for_each(|(sums, tracked)| {
            for ((_, photo), [image, around]) in photos.iter().zip(&averaged) {
                for (sums, tracked) in sums.iter_mut().zip(tracked) {
                    add(
                        sums,
                        tracked,
                        [image, around],
                        relative.of(photo, tracked.pixel),
                    );
                }
            }
        });
    })?;
    progress.end();
    if let Some(error) = wrong {
        return Err(error);
    }
    let colours = if coloured { 3 } else { 1 };
    let longest = [whole.0, whole.1].map(|pixels| LONGEST_STEP * side as f32 / pixels as f32);
    tracked
        .par_iter_mut()
        .zip(&sums)
        .for_each(|(tracked, sums)| {
            take(tracked, sums, (images.len(), colours), longest);
        });
    Ok(())
}

/// Adds one photograph of an image to the fit of a pixel.
fn add(sums: &mut [f32; SUMS], tracked: &Tracked, [image, around]: [&Averaged; 2], light: f32) {
    let mut known = [0.0_f32; UNKNOWNS];
    if let [grey] = image.planes.as_slice() {
        let [value, across, down] = image.at(grey, tracked.place);
        known[..3].fill(value);
        (known[3], known[4]) = (across, down);
    } else {
        for (channel, plane) in image.planes.iter().enumerate() {
            let [value, across, down] = image.at(plane, tracked.place);
            known[channel] = value;
            known[3] += tracked.colours[channel] * across;
            known[4] += tracked.colours[channel] * down;
        }
    }
    (known[5], known[6]) = (1.0, image.brightness);
    for plane in &around.planes {
        let at = around.at(plane, tracked.place);
        for (known, light) in known[7..].iter_mut().zip(at) {
            *known += light / around.planes.len() as f32;
        }
    }
    let mut sums = sums.iter_mut();
    let mut add = |value: f32| {
        if let Some(sum) = sums.next() {
            *sum += value;
        }
    };
    for (at, value) in known.iter().enumerate() {
        known[at..].iter().for_each(|other| add(value * other));
    }
    for value in &known {
        add(value * light);
    }
    add(light * light);
}

/// Moves a pixel by what its fit says.
fn take(
    tracked: &mut Tracked,
    sums: &[f32; SUMS],
    (photographs, colours): (usize, usize),
    longest: [f32; 2],
) {
    let mut values = sums.iter().map(|sum| f64::from(*sum));
    let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    for row in 0..UNKNOWNS {
        for col in row..UNKNOWNS {
            let value = values.next().unwrap_or_default();
            (normal[(row, col)], normal[(col, row)]) = (value, value);
        }
    }
    let mut right = SVector::<f64, UNKNOWNS>::from_iterator(values.by_ref().take(UNKNOWNS));
    let square = values.next().unwrap_or_default();
    // One colour has all of the light, and few images do not tell what comes from around.
    let of_colours = if colours == 1 { 1..3 } else { 0..0 };
    let of_around = if photographs < LEAST_FOR_AROUND {
        7..UNKNOWNS
    } else {
        0..0
    };
    for at in of_colours.chain(of_around.clone()) {
        normal.row_mut(at).fill(0.0);
        normal.column_mut(at).fill(0.0);
        normal[(at, at)] = 1.0;
        right[at] = 0.0;
    }
    let size = normal.diagonal();
    for at in 0..UNKNOWNS {
        normal[(at, at)] += 1e-6 * size[at].max(1e-12);
    }
    tracked.explained = 0.0;
    tracked.error = [f32::INFINITY; 2];
    let Some(inverse) = normal.cholesky().map(|cholesky| cholesky.inverse()) else {
        return;
    };
    let found = inverse * right;
    let left = (square - found.dot(&right)).max(0.0);
    // Beside a constant: light without changes tells nothing.
    let mean = right[5] / photographs as f64;
    let changes = square - photographs as f64 * mean * mean;
    let direct = if colours == 1 {
        found[0]
    } else {
        found.rows(0, 3).sum()
    };
    if direct < LEAST_DIRECT || changes <= 0.0 {
        return;
    }
    let weight: f64 = if colours == 1 {
        direct
    } else {
        let own = tracked.colours.map(f64::from);
        let both: f64 = (0..3).map(|at| own[at] * found[at]).sum();
        both / own.iter().map(|own| own * own).sum::<f64>()
    };
    if weight <= 0.0 {
        return;
    }
    let unknowns = 7 + colours - of_around.len();
    let variance = left / photographs.saturating_sub(unknowns).max(1) as f64;
    for axis in 0..2 {
        let step = (found[3 + axis] / weight) as f32;
        tracked.place[axis] += step.clamp(-longest[axis], longest[axis]);
        tracked.error[axis] = ((variance * inverse[(3 + axis, 3 + axis)]).sqrt() / weight) as f32;
    }
    tracked.direct = direct as f32;
    tracked.explained = (1.0 - left / changes) as f32;
    if colours == 3 {
        let positive: [f64; 3] = std::array::from_fn(|at| found[at].max(0.0));
        let sum: f64 = positive.iter().sum();
        tracked.colours = positive.map(|share| (share / sum) as f32);
    }
}

/// The projector's response with which images explain most of the light of pixels whose places are
/// known: sRGB, unless a power leaves clearly less. The camera's response has to be the one that
/// photographs were read with; without inverses, light does not tell the two apart.
///
/// # Errors
/// A picture's or a photograph's own error.
pub(crate) fn response(
    map: &ProjectorMap,
    linear: &LinearPhotographs<'_>,
    (images, photographs): (&KnownImages<'_>, &mut Photographs<'_>),
    progress: &dyn Progress,
) -> Result<Option<Response>, CaptureError> {
    let known = |pixel: &usize| !map.position[*pixel][0].is_nan();
    let pixels: Vec<usize> = (0..map.position.len()).filter(known).collect();
    if images.len() < MIN_MATCHED || pixels.len() < LEAST_JUDGED {
        return Ok(None);
    }
    let inner = map.projector.inner();
    let whole = (inner.width(), inner.height());
    let first = f32::from(map.projector.border()) - 0.5;
    let every = pixels.len().div_ceil(MOST_JUDGED);
    let placed = pixels.iter().step_by(every).map(|&pixel| {
        let [x, y] = map.position[pixel];
        Tracked {
            place: [(x - first) / whole.0 as f32, (y - first) / whole.1 as f32],
            ..Tracked::new(pixel)
        }
    });
    let tracked: Vec<Tracked> = placed.collect();
    let powers = (0..=POWERS.2).map(|k| POWERS.0 + f64::from(k) * POWERS.1);
    let tried: Vec<Response> = std::iter::once(Response::Srgb)
        .chain(powers.map(Response::Gamma))
        .collect();
    let relative = RelativeLight::new(linear);
    let mut left = Vec::with_capacity(tried.len());
    for response in &tried {
        let mut tracked = tracked.clone();
        let assumed = images.with_response((*response).into());
        step(
            &mut tracked,
            (&assumed, photographs),
            &relative,
            (whole, 1),
            progress,
        )?;
        left.push(f64::from(Usual::of(&tracked).unexplained));
    }
    let (srgb, powers) = (left[0], &left[1..]);
    let least = (0..powers.len()).min_by(|a, b| powers[*a].total_cmp(&powers[*b]));
    let Some(least) = least.filter(|least| powers[*least] < CLEARLY_LESS * srgb) else {
        return Ok(Some(Response::Srgb));
    };
    // Where a parabola through the three best has its lowest point.
    let around =
        (least.checked_sub(1)).and_then(|before| Some([powers[before], *powers.get(least + 1)?]));
    let off = around.map_or(0.0, |[before, after]| {
        let bend = before - 2.0 * powers[least] + after;
        if bend > 0.0 {
            0.5 * (before - after) / bend
        } else {
            0.0
        }
    });
    let power = POWERS.0 + POWERS.1 * (least as f64 + off);
    Ok(Some(Response::Gamma((20.0 * power).round() / 20.0)))
}

/// The map of what was found.
fn finished(
    tracked: &[Tracked],
    projector: ProjectorPixels,
    registration: &Registration,
    cell: f32,
) -> ProjectorMap {
    let inner = projector.inner();
    let whole = [inner.width() as f32, inner.height() as f32];
    let shift = f32::from(projector.border()) - 0.5;
    let pixels = registration.seen_cell.len();
    let mut position = vec![None; pixels];
    let mut own = vec![f32::NAN; pixels];
    let usual = Usual::of(tracked);
    for found in tracked {
        let error = (found.error[0] * whole[0]).hypot(found.error[1] * whole[1]);
        let inside = found.place.iter().all(|at| (0.0..=1.0).contains(at));
        let sure = error < (MOST_UNCERTAIN * cell).max(1.0);
        if inside && sure && usual.is_own(found) {
            let at = [0, 1].map(|axis: usize| found.place[axis] * whole[axis] + shift);
            position[found.pixel] = Some(at);
            own[found.pixel] = error;
        }
    }
    let left = local_planes::settle(&mut position, registration.camera);
    let uncertainty = own.iter().zip(left);
    ProjectorMap {
        source: MapSource::Images,
        projector,
        camera: registration.camera,
        binning: registration.binning,
        uncertainty: uncertainty
            .map(|(own, left)| left.map_or(*own, |left| ON_PLANE * left.max(*own)))
            .collect(),
        position: position
            .into_iter()
            .map(|at| at.unwrap_or([f32::NAN; 2]))
            .collect(),
    }
}
