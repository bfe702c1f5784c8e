//! How far the picture on the wall is from the wanted one.

use super::scene::Scene;
use iltm::compile::content::natural_images;
use iltm::compile::white::reference_white;
use iltm::solve::InverseTransport;
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

/// Wanted images: natural ones whose darkest parts still are a fifth of white, as
/// bounced light keeps walls from being darker; then few inputs clip.
#[must_use]
pub fn wanted(scene: &Scene) -> DMatrix<f64> {
    natural_images(scene.grid).map(|light| 0.2 + 0.8 * light)
}

/// Closed-loop errors of an inverse in a scene.
#[must_use]
pub fn errors(scene: &Scene, found: &InverseTransport) -> LoopErrors {
    let transport = scene.transport();
    let judged: Vec<bool> = (0..scene.grid.cells())
        .map(|cell| found.live[cell] && scene.coverage[cell] > 1e-9)
        .collect();
    let images = keep(&wanted(scene), &judged);
    let white = reference_white(found).map_or(0.0, |white| white.light);
    let matrix = dense(found);
    let compensated = error(&transport, &images, &judged, |d| &matrix * d * white);
    let flood = &transport * DVector::from_element(scene.grid.cells(), 1.0);
    let mut gain = flood.map(|light| if light > 1e-12 { light.recip() } else { 0.0 });
    mask(&mut gain, &judged);
    gain /= gain.max().max(f64::MIN_POSITIVE);
    let gain_only = error(&transport, &images, &judged, |d| gain.component_mul(d));
    let nothing = error(&transport, &images, &judged, Clone::clone);
    let chosen: Vec<usize> = (0..judged.len()).filter(|cell| judged[*cell]).collect();
    let part = transport.select_rows(&chosen).select_columns(&chosen);
    let perfect = part.try_inverse().map_or(f64::INFINITY, |inverse| {
        let ones = DVector::from_element(chosen.len(), 1.0);
        let white = (&inverse * ones).max().recip();
        error(&transport, &images, &judged, |d| {
            let drive = &inverse * d.select_rows(&chosen) * white;
            let mut all = DVector::zeros(judged.len());
            for (cell, value) in chosen.iter().zip(drive.iter()) {
                all[*cell] = *value;
            }
            all
        })
    });
    LoopErrors { nothing, gain_only, compensated, perfect }
}

/// `diag(g) - K` of the first channel.
#[must_use]
pub fn dense(found: &InverseTransport) -> DMatrix<f64> {
    let channel = found.channel(0);
    DMatrix::from_diagonal(&channel.gain) - channel.operator
}

fn error(
    transport: &DMatrix<f64>,
    images: &DMatrix<f64>,
    judged: &[bool],
    drive: impl Fn(&DVector<f64>) -> DVector<f64>,
) -> f64 {
    let of_image = |wanted: DVector<f64>| {
        let projected = drive(&wanted).map(|value| value.clamp(0.0, 1.0));
        let mut light = transport * projected;
        mask(&mut light, judged);
        let both = light.dot(&wanted);
        let scale = if both > 0.0 { both / light.norm_squared() } else { 0.0 };
        (light * scale - &wanted).norm() / wanted.norm()
    };
    let images: Vec<f64> = images.column_iter().map(|image| of_image(image.into_owned())).collect();
    images.iter().sum::<f64>() / images.len().max(1) as f64
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
