//! Bounce separation: the light of one photograph that came straight from the projector,
//! that came by way of one other surface, of two, and so on.
//!
//! With the light straight from the projector's `F1 = diag(1/g)`, the first bounce
//! off the wall is `l1 = F1 T^-1 l` (Seitz, Matsushita, Kutulakos, *A Theory of
//! Inverse Light Transport*, ICCV 2005; Chu, Ng, Pahwa, Quek, Huang, *Compressive
//! Inverse Light Transport*, BMVC 2011, equation 17), and what is left of the light
//! is peeled the same way, again and again.
//!
//! ```text
//! iltm_capture::LinearPhotograph -> the photograph
//! capture, solve     -> bounce_operator   which cells light a camera pixel by way of others
//!                       noise             what a bounce has to exceed to be seen
//!                       separate          one bounce after the other, until the noise
//!                       folder            pictures, numbers, and
//!                       page              the one that people look at; sheet: a picture of it
//! ```

mod bounce_operator;
mod folder;
mod noise;
mod page;
mod separate;
mod sheet;
#[cfg(test)]
mod tests;

pub use bounce_operator::BounceOperator;
pub use folder::{FileOf, PAGE, WrittenBounces, is_own, write};
pub use noise::PhotographNoise;
pub use page::{PROOF, page};
pub use separate::{Layer, LayerKind, MOST_BOUNCES, Separated};
pub use sheet::sheet;

use iltm_capture::{CaptureError, CaptureOptions, LinearPhotograph, Measurements, Shot};
use iltm_picture::{FolderError, progress::Progress};
use iltm_solve::{InverseTransport, Observed, SolveError, SolveOptions, SolveReport};
use nalgebra::DMatrix;
use std::path::Path;
use thiserror::Error;

/// Why a photograph could not be separated.
#[derive(Debug, Error)]
pub enum BouncesError {
    /// The photographs cannot be used.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// No inverse was found.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The photograph and the registered ones differ in size or colour.
    #[error(
        "the photograph has {} x {} pixels in {channels} channels, those before it had another \
         size: the capture was changed while it was read", size.0, size.1
    )]
    Changed {
        /// Width and height of the photograph.
        size: (usize, usize),
        /// Its channels.
        channels: usize,
    },
    /// There is no end to the bounces.
    #[error(
        "after {bounces} bounces {percent:.1} % of the light is left: by the inverse that was \
         found, light hardly fades"
    )]
    DoesNotFade {
        /// Bounces that were peeled.
        bounces: usize,
        /// Root mean square of what is left, in percent of the photograph's.
        percent: f64,
    },
    /// The pictures could not be written.
    #[error(transparent)]
    Folder(#[from] FolderError),
}

/// What to separate and how.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct BouncesOptions {
    /// `index` of the photograph in `capture.csv`; `None` for the mean of all
    /// photographs of white.
    pub photograph: Option<u32>,
    /// How to read the capture that the inverse is learned from.
    pub capture: CaptureOptions,
    /// How to solve it.
    pub solve: SolveOptions,
}

/// A photograph by bounces.
#[derive(Clone, Debug)]
pub struct Bounces {
    /// The photograph.
    pub shot: Shot,
    /// Photographs averaged for it.
    pub averaged: usize,
    /// The light of each bounce.
    pub separated: Separated,
    /// The camera's noise in the photograph.
    pub noise: PhotographNoise,
    /// Part of what the camera saw, anywhere in the picture, that was there under
    /// black too and is subtracted.
    pub ambient_share: f64,
    /// Camera pixels on the wall that are saturated in this photograph: their light
    /// is more than what the pictures add up to.
    pub saturated: usize,
    /// The inverse, found without undoing the projector's blur: what is peeled is
    /// light on the wall, however it came to be there.
    pub inverse: InverseTransport,
    /// How the inverse came about.
    pub report: SolveReport,
}

/// Reads and solves a capture, and separates one of its photographs.
///
/// # Errors
/// [`BouncesError`] by the step that failed.
pub fn bounces(
    folder: &Path,
    options: &BouncesOptions,
    progress: &dyn Progress,
) -> Result<Bounces, BouncesError> {
    // An index that is not there is known before the work, not after it.
    let mut photograph = LinearPhotograph::read(folder, options.photograph, progress)?;
    let measurements = iltm_capture::read(folder, &options.capture, progress)?;
    let devices = &measurements.devices;
    if devices.change_light(&measurements.settings) {
        photograph = LinearPhotograph::read_as(folder, options.photograph, devices, progress)?;
    }
    let (inverse, report) = solved(&measurements, &options.solve, progress)?;
    let channels = photograph.planes.len();
    let size = photograph.size;
    if size != measurements.registration.camera || channels != inverse.channels.len() {
        return Err(BouncesError::Changed { size, channels });
    }
    progress.begin("separating the bounces", 0);
    let wall = BounceOperator::new(&measurements.registration, &measurements.flood, &inverse);
    let noise = noise::noise(&wall, &measurements, &photograph);
    let separated = Separated::new(&wall, &photograph.planes, noise.cell)?;
    progress.end();
    let on_wall = |pixel: usize| wall.holds(pixel);
    let saturated = photograph.saturated.iter().enumerate();
    Ok(Bounces {
        saturated: saturated
            .filter(|(pixel, s)| **s && on_wall(*pixel))
            .count(),
        ambient_share: ambient_share(&photograph),
        shot: photograph.shot,
        averaged: photograph.averaged,
        noise,
        separated,
        inverse,
        report,
    })
}

/// The inverse between light that landed and light that is seen: a projector's blur
/// is applied to the patterns, and not undone.
fn solved(
    measurements: &Measurements,
    options: &SolveOptions,
    progress: &dyn Progress,
) -> Result<(InverseTransport, SolveReport), SolveError> {
    let mut observed = Observed::from(measurements);
    let landed: Vec<DMatrix<f64>>;
    if observed.blur > 0.0 {
        let blur = iltm_solve::blur(observed.grid, observed.blur);
        let channels = observed.channels.iter();
        landed = channels.map(|channel| &blur * channel.patterns).collect();
        for (channel, landed) in observed.channels.iter_mut().zip(&landed) {
            channel.patterns = landed;
        }
        observed.blur = 0.0;
    }
    iltm_solve::solve_observed(&observed, options, progress)
}

fn ambient_share(photograph: &LinearPhotograph) -> f64 {
    let sum =
        |planes: &[Vec<f32>]| -> f64 { planes.iter().flatten().copied().map(f64::from).sum() };
    let black = sum(&photograph.black);
    let all = black + sum(&photograph.planes);
    if all > 0.0 { black / all } else { 0.0 }
}
