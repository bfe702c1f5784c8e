//! Pixel errors: what a viewer sees of the test images of the projector's own pixels, at every
//! pixel of the camera.
//!
//! A camera pixel sees some pixels of the projector, which fine stripes tell; its light is compared
//! with what was wanted there: all light, or the projector's alone where the table leaves ambient
//! light as it is. The camera's noise is known and taken out of the error, but not of PSNR, SSIM
//! and Delta E.

use super::fixed_pattern::FixedPattern;
use super::judge::MARGIN;
use super::readings::FineShown;
use super::{Bound, Readings};
use iltm_capture::{NoiseModel, PixelReadings};
use iltm_compile::Provenance;
use iltm_picture::{LightPicture, PictureError};
use iltm_report::tier_costs;
use iltm_runtime::{FrameSize, image::Table};

/// What a viewer sees, pixel by pixel.
#[derive(Clone, PartialEq, Debug)]
pub struct PixelVerdict {
    /// Figures of each image, as it is and compensated, noise included.
    pub images: Vec<[PictureError; 2]>,
    /// Relative error without noise, as the images are and compensated: root mean square over
    /// them.
    pub error: [f64; 2],
    /// Relative error that noise makes in one photograph.
    pub noise: f64,
    /// Error of each pixel that is judged, compensated, noise included, relative to reference
    /// white: root mean square over images and channels.
    pub errors: Vec<f32>,
    /// Camera units of reference white, by image.
    pub white: Vec<f64>,
    /// The part of the error that all images share; `None` with a single image.
    pub fixed: Option<FixedPattern>,
    /// What that part is held against; `None` if the table predicts no error at pixels.
    pub bound: Option<PixelBound>,
}

/// What the error at pixels that all images share is held against.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PixelBound {
    /// Error at pixels that the table predicts of itself at its top tier, or that its refinement
    /// confirmed.
    pub promise: f64,
    /// The largest that passes.
    pub limit: f64,
    /// The largest that the table's prediction and another place of the camera explain: what is
    /// beyond it is a change of the wall.
    pub doubt: f64,
}

/// How many times the promise the error of a good table is at most: in the scenes that come with the
/// tools it is up to 1.4 times what tables predict at pixels.
const DOUBT: f64 = 2.0;

impl PixelBound {
    /// That of a table whose cells are held against `cells`.
    fn new(table: &Table<'_>, cells: &Bound) -> Option<Self> {
        let provenance = Provenance::read(table.provenance());
        let predicted = provenance.predicted_error?;
        // Without figures at pixels it is one of cells.
        predicted.figures?;
        let refined = provenance.refined.last().map(|round| round.after);
        let own = refined.map_or(predicted.compensated, |r| r.min(predicted.compensated));
        let promise = tier_costs(table).last()?.left_out.hypot(own);
        let limit = if cells.given {
            cells.limit
        } else {
            MARGIN * promise
        };
        Some(Self {
            promise,
            limit,
            doubt: limit.max(DOUBT * promise.hypot(cells.viewpoint)),
        })
    }
}

impl PixelVerdict {
    /// Judges the photographs; `None` without fine images, or if no pixel can be judged.
    pub(super) fn new(table: &Table<'_>, readings: &Readings, cells: &Bound) -> Option<Self> {
        let pixels = readings.revisited.pixels.as_ref()?.as_ref().ok()?;
        let mut images = Vec::new();
        let mut squares = [0.0_f64; 2];
        let mut noises = 0.0;
        let mut errors = vec![0.0; pixels.views.pixels().len()];
        let mut white = Vec::new();
        for (at, shown) in readings.fine.iter().enumerate() {
            let wanted = wanted(pixels, shown);
            let mut of_image = [None; 2];
            for half in 0..2 {
                let seen = seen(table, pixels, 2 * at + half);
                let error = PictureError::new(
                    &on_camera(pixels, &seen)?,
                    &on_camera(pixels, &wanted)?,
                    &compared(pixels),
                )?;
                let noise = noise(&readings.revisited.noise, &seen, &wanted);
                squares[half] += (error.relative.powi(2) - noise).max(0.0);
                if half == 1 {
                    noises += noise;
                    let scale = scale(&seen, &wanted);
                    add_errors(&mut errors, &seen, &wanted, scale);
                    white.push(scale);
                }
                of_image[half] = Some(error);
            }
            let [own, compensated] = of_image;
            images.push([own?, compensated?]);
        }
        let count = images.len() as f64;
        (!images.is_empty()).then(|| Self {
            fixed: FixedPattern::new(table, pixels, (&readings.fine, &white)),
            bound: PixelBound::new(table, cells),
            error: squares.map(|square| (square / count).sqrt()),
            noise: (noises / count).sqrt(),
            errors: errors
                .into_iter()
                .map(|square| (square / count as f32).sqrt())
                .collect(),
            white,
            images,
        })
    }
}

/// Light of wanted white that suits a photograph best, camera units.
fn scale(seen: &[Vec<f32>], wanted: &[Vec<f32>]) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for (seen, wanted) in seen.iter().flatten().zip(wanted.iter().flatten()) {
        product += f64::from(*seen) * f64::from(*wanted);
        square += f64::from(*wanted).powi(2);
    }
    (product / square).max(f64::MIN_POSITIVE)
}

/// Adds the squares of an image's errors, mean over its channels.
fn add_errors(errors: &mut [f32], seen: &[Vec<f32>], wanted: &[Vec<f32>], scale: f64) {
    let share = 1.0 / seen.len().max(1) as f32;
    for (seen, wanted) in seen.iter().zip(wanted) {
        for (error, (seen, wanted)) in errors.iter_mut().zip(seen.iter().zip(wanted)) {
            let off = seen / scale as f32 - wanted;
            *error += share * off * off;
        }
    }
}

/// Light of a photograph that counts, by channel and pixel, camera units.
pub(super) fn seen(table: &Table<'_>, pixels: &PixelReadings, picture: usize) -> Vec<Vec<f32>> {
    let channels = 0..pixels.pictures[picture].len();
    channels
        .map(|channel| counted_light(table, pixels, (picture, channel)))
        .collect()
}

/// The same of one channel.
pub(super) fn counted_light(
    table: &Table<'_>,
    pixels: &PixelReadings,
    (picture, channel): (usize, usize),
) -> Vec<f32> {
    let light = &pixels.pictures[picture][channel];
    if !Provenance::read(table.provenance()).ambient_kept {
        return light.clone();
    }
    let pairs = light.iter().zip(&pixels.black[channel]);
    pairs.map(|(light, black)| light - black).collect()
}

/// Wanted light at each pixel, by channel.
pub(super) fn wanted(pixels: &PixelReadings, shown: &FineShown) -> Vec<Vec<f32>> {
    let channels = 0..shown.wanted.planes().len();
    channels
        .map(|channel| wanted_light(pixels, shown, channel))
        .collect()
}

/// The same of one channel.
pub(super) fn wanted_light(pixels: &PixelReadings, shown: &FineShown, channel: usize) -> Vec<f32> {
    at_pixels(pixels, &shown.wanted.planes()[channel])
}

/// Whether a pixel sees a sample that the projector's range cut.
pub(super) fn cut_at_pixels(
    pixels: &PixelReadings,
    shown: &FineShown,
    channel: usize,
) -> Vec<bool> {
    let cut = shown.cut(channel).into_iter();
    let cut: Vec<f32> = cut.map(|cut| f32::from(u8::from(cut))).collect();
    let seen = at_pixels(pixels, &cut).into_iter();
    seen.map(|cut| cut > 0.0).collect()
}

/// Means over the pixels that each cell is measured by and that see a known place, length `N`; 0 of a cell
/// without any.
pub(super) fn means_of_cells(
    pixels: &PixelReadings,
    pixels_of_cells: &[Vec<u32>],
    values: &[f32],
) -> Vec<f64> {
    let mut on_camera = vec![None; pixels.camera.0 * pixels.camera.1];
    for (view, value) in pixels.views.pixels().iter().zip(values) {
        on_camera[view.pixel as usize] = Some(f64::from(*value));
    }
    let mean = |own: &Vec<u32>| {
        let known = own.iter().filter_map(|pixel| on_camera[*pixel as usize]);
        let (sum, count) = known.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    };
    pixels_of_cells.iter().map(mean).collect()
}

/// Mean of what each pixel sees of a plane of the projector's pixels.
pub(super) fn at_pixels(pixels: &PixelReadings, plane: &[f32]) -> Vec<f32> {
    let views = &pixels.views;
    let seen = |view| {
        let seen = views.seen(view);
        let (sum, whole) = seen.fold((0.0, 0.0), |(sum, whole), (at, share)| {
            (sum + share * plane[at], whole + share)
        });
        if whole > 0.0 { sum / whole } else { 0.0 }
    };
    views.pixels().iter().map(seen).collect()
}

/// Values of the pixels in a picture of the camera's size.
pub(super) fn on_camera(pixels: &PixelReadings, planes: &[Vec<f32>]) -> Option<LightPicture> {
    let (width, height) = pixels.camera;
    let size = FrameSize::new(u16::try_from(width).ok()?, u16::try_from(height).ok()?)?;
    let plane = |values: &Vec<f32>| {
        let mut plane = vec![0.0; size.pixels()];
        for (view, value) in pixels.views.pixels().iter().zip(values) {
            plane[view.pixel as usize] = *value;
        }
        plane
    };
    LightPicture::new(size, planes.iter().map(plane).collect())
}

/// Which of the camera's pixels are compared, by row.
pub(super) fn compared(pixels: &PixelReadings) -> Vec<bool> {
    let (width, height) = pixels.camera;
    let mut compared = vec![false; width * height];
    for view in pixels.views.pixels() {
        compared[view.pixel as usize] = true;
    }
    compared
}

/// Square of the relative error that noise makes in a photograph, at the brightness of what was
/// wanted that suits it best.
fn noise(models: &[NoiseModel], seen: &[Vec<f32>], wanted: &[Vec<f32>]) -> f64 {
    let white = scale(seen, wanted);
    let (mut variance, mut square) = (0.0, 0.0);
    for ((seen, wanted), model) in seen.iter().zip(wanted).zip(models) {
        for (seen, wanted) in seen.iter().zip(wanted) {
            variance += model.variance(f64::from(*seen));
            square += f64::from(*wanted).powi(2);
        }
    }
    variance / (square * white * white).max(f64::MIN_POSITIVE)
}
