//! Clipped projection: natural images through a projector that can show no less than nothing and no
//! more than white.
//!
//! Held-out photographs judge the inverse, not what becomes of inputs that clip:
//! where walls light each other strongly, or the projector is out of focus, an
//! exact inverse asks for light below zero, and what is cut off can do more harm
//! than all interreflection. So natural images are sent through the transport
//! that was found, with the operator, with gains alone and as they are.

use super::forward::{Inverse, product};
use super::gain_only::gains;
use super::natural_images::wanted_images;
use super::prepare::Prepared;
use super::report::Prediction;
use super::solution::Candidate;
use iltm_runtime::Grid;
use nalgebra::DMatrix;

/// Images and the scene as it was found.
pub(super) struct ClippedProjection<'c> {
    prepared: &'c Prepared,
    candidates: &'c [Candidate],
    blur: Option<&'c DMatrix<f64>>,
    /// Wanted images, `N x n`, 0 to 1.
    images: DMatrix<f64>,
    /// The same as a blurred projector can show them; the same if it is in focus.
    pub(super) reachable: Option<DMatrix<f64>>,
}

impl<'c> ClippedProjection<'c> {
    /// `blur` is that of live cells only.
    pub(super) fn new(
        grid: Grid,
        prepared: &'c Prepared,
        candidates: &'c [Candidate],
        blur: Option<&'c DMatrix<f64>>,
    ) -> Self {
        let mut images = wanted_images(grid);
        for (cell, _) in prepared.live.iter().enumerate().filter(|(_, live)| !**live) {
            images.row_mut(cell).fill(0.0);
        }
        let reachable = blur.map(|blur| product(blur, &images));
        Self {
            prepared,
            candidates,
            blur,
            images,
            reachable,
        }
    }

    /// Error with inverses, one a channel: on the images, and as the
    /// geometric mean with that on those a blurred projector can show.
    pub(super) fn operator(&self, inverses: &[&Inverse]) -> (f64, f64) {
        let even = DMatrix::from_element(self.images.nrows(), 1, 1.0);
        let error = |images: &DMatrix<f64>| {
            self.error(images, |channel| {
                let inverse = &inverses[channel];
                // Reference white: the brightest even grey.
                let drive = inverse.apply(&even).max();
                inverse.apply(images) * drive.max(f64::MIN_POSITIVE).recip()
            })
        };
        let natural = error(&self.images);
        let both = self
            .reachable
            .as_ref()
            .map_or(natural, |images| (natural * error(images)).sqrt());
        (natural, both)
    }

    /// Error with the gains that `prediction` found best.
    pub(super) fn gain_only(&self, prediction: &Prediction) -> f64 {
        let all: Vec<usize> = (0..self.prepared.roles.len()).collect();
        self.error(&self.images, |channel| {
            let gain = gains(self.prepared, channel, &all, prediction.gain_only_kind);
            let most = gain.max().max(f64::MIN_POSITIVE);
            let mut drive = self.images.clone();
            for mut image in drive.column_iter_mut() {
                image.component_mul_assign(&(&gain / most));
            }
            drive
        })
    }

    /// Error of the images as they are.
    pub(super) fn nothing(&self) -> f64 {
        self.error(&self.images, |_| self.images.clone())
    }

    /// Mean over images and channels of `min_s ||s light - wanted|| / ||wanted||`.
    fn error(&self, wanted: &DMatrix<f64>, drive: impl Fn(usize) -> DMatrix<f64>) -> f64 {
        let of_channel = |(channel, candidate): (usize, &Candidate)| {
            let drive = drive(channel).map(|value| value.clamp(0.0, 1.0));
            let landed = match self.blur {
                Some(blur) => product(blur, &drive),
                None => drive,
            };
            let light = candidate.inverse.light(&landed);
            light.map_or(f64::INFINITY, |light| mean_error(&light, wanted))
        };
        let errors = self.candidates.iter().enumerate().map(of_channel);
        errors.sum::<f64>() / self.candidates.len() as f64
    }
}

fn mean_error(light: &DMatrix<f64>, wanted: &DMatrix<f64>) -> f64 {
    let of_image = |k: usize| {
        let (light, wanted) = (light.column(k), wanted.column(k));
        let (seen, asked) = (light.norm_squared(), wanted.norm_squared());
        if seen == 0.0 || asked == 0.0 {
            return 1.0;
        }
        (1.0 - light.dot(&wanted).powi(2) / (seen * asked))
            .max(0.0)
            .sqrt()
    };
    (0..wanted.ncols()).map(of_image).sum::<f64>() / wanted.ncols().max(1) as f64
}
