//! Closed loop: how far the picture on the wall is from the wanted one.

use iltm::compile::reference_white::uniform_white;
use iltm::scene::coaxial::CoaxialScene;
use iltm::solve::InverseTransport;
use iltm::solve::wanted_images;
use nalgebra::{DMatrix, DVector};

/// Errors of one scene, each the mean over images of
/// `min_s ||s T p - d|| / ||d||` over the cells that the surface covers.
///
/// The best brightness `s` is allowed because neither gain alone nor nothing can
/// know how bright the picture becomes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LoopErrors {
    /// `p = d`.
    pub nothing: f64,
    /// `p = d / flood`, with the true flood light.
    pub gain_only: f64,
    /// With the inverse that was found.
    pub compensated: f64,
    /// With the true inverse, where there is one: what clipping costs anyone.
    pub perfect: f64,
}

/// Closed-loop errors of an inverse in a scene.
///
/// Wanted are natural images whose darkest parts still are a fifth of reference
/// white: walls that light each other cannot be darker. A projector out of focus
/// cannot show their edges at all; there the wanted images are those that it
/// makes of natural ones.
pub fn errors(scene: &CoaxialScene, found: &InverseTransport) -> LoopErrors {
    let transport = scene.transport();
    let judged: Vec<bool> = (0..scene.grid.cells())
        .map(|cell| found.live[cell] && scene.coverage[cell] > 1e-9)
        .collect();
    let natural = wanted_images(scene.grid);
    let white = uniform_white(found).unwrap_or(0.0);
    let wanted = match scene.blur {
        Some(_) => &transport * &natural,
        None => natural * white,
    };
    let images = keep(&wanted, &judged);
    let judge = Judge {
        transport: &transport,
        images: &images,
        judged: &judged,
    };
    let matrix = dense(found);
    let flood = &transport * DVector::from_element(scene.grid.cells(), 1.0);
    let mut gain = flood.map(|light| if light > 1e-12 { light.recip() } else { 0.0 });
    mask(&mut gain, &judged);
    let chosen: Vec<usize> = (0..judged.len()).filter(|cell| judged[*cell]).collect();
    let part = transport.select_rows(&chosen).select_columns(&chosen);
    let perfect = part.try_inverse().map_or(f64::INFINITY, |inverse| {
        judge.error(|d| {
            let drive = &inverse * d.select_rows(&chosen);
            let mut all = DVector::zeros(judged.len());
            for (cell, value) in chosen.iter().zip(drive.iter()) {
                all[*cell] = *value;
            }
            all
        })
    });
    LoopErrors {
        nothing: judge.error(|d| d / d.max().max(f64::MIN_POSITIVE)),
        gain_only: judge.error(|d| {
            let drive = gain.component_mul(d);
            let most = drive.max().max(f64::MIN_POSITIVE);
            drive / most
        }),
        compensated: judge.error(|d| &matrix * d),
        perfect,
    }
}

/// `diag(g) - K` of the first channel.
pub fn dense(found: &InverseTransport) -> DMatrix<f64> {
    found.channel(0).dense()
}

/// What projected images are judged by.
struct Judge<'a> {
    transport: &'a DMatrix<f64>,
    images: &'a DMatrix<f64>,
    judged: &'a [bool],
}

impl Judge<'_> {
    fn error(&self, drive: impl Fn(&DVector<f64>) -> DVector<f64>) -> f64 {
        let of_image = |wanted: DVector<f64>| {
            let projected = drive(&wanted).map(|value| value.clamp(0.0, 1.0));
            let mut light = self.transport * projected;
            mask(&mut light, self.judged);
            let both = light.dot(&wanted);
            let scale = if both > 0.0 {
                both / light.norm_squared()
            } else {
                0.0
            };
            (light * scale - &wanted).norm() / wanted.norm()
        };
        let errors = self
            .images
            .column_iter()
            .map(|image| of_image(image.into_owned()));
        errors.sum::<f64>() / self.images.ncols().max(1) as f64
    }
}

fn mask(values: &mut DVector<f64>, judged: &[bool]) {
    for (value, judged) in values.iter_mut().zip(judged) {
        if !judged {
            *value = 0.0;
        }
    }
}

fn keep(images: &DMatrix<f64>, judged: &[bool]) -> DMatrix<f64> {
    let mut kept = images.clone();
    for (mut row, judged) in kept.row_iter_mut().zip(judged) {
        if !judged {
            row.fill(0.0);
        }
    }
    kept
}
