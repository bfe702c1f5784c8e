//! From `T0^-1 = diag(g) - K` to `T^-1 = B^-1 T0^-1` for a projector out of focus.
//!
//! A blur takes fine detail away, and nothing brings back what is not there:
//! singular values of `B` near zero must be given up (Tikhonov). How far to go is
//! tried out: natural images are compensated, clipped to what a projector can
//! show and sent through `T0 B`, and what errs least is taken. If even that errs
//! more than gain alone, the report says so.

use super::forward::product;
use super::gain_only::gains;
use super::prepare::Prepared;
use super::report::Prediction;
use super::solution::{Candidate, Channel, drop_dead};
use crate::content::natural_images;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};

/// Singular values of the blur that are halved; infinite sharpens nothing.
const SOFTNESS: [f64; 6] = [0.01, 0.03, 0.1, 0.3, 1.0, f64::INFINITY];

/// The operator all channels share and the channels, sharpened.
pub(super) struct Sharpened {
    pub(super) parts: (DMatrix<f64>, Vec<Channel>),
    /// Whether it beats gain alone on natural images.
    pub(super) helps: bool,
}

/// `None` for a projector in focus.
pub(super) fn sharpen(
    grid: Grid,
    prepared: &Prepared,
    candidates: &[Candidate],
    prediction: &Prediction,
) -> Option<Sharpened> {
    let mut blur = prepared.blur.clone()?;
    drop_dead(&mut blur, &prepared.live);
    let mut images = natural_images(grid);
    for (cell, _) in prepared.live.iter().enumerate().filter(|(_, live)| !**live) {
        images.row_mut(cell).fill(0.0);
    }
    let wholes: Vec<DMatrix<f64>> = candidates
        .iter()
        .map(|c| DMatrix::from_diagonal(&c.inverse.gain) - &c.inverse.operator)
        .collect();
    let error = |drives: &dyn Fn(usize) -> DMatrix<f64>| {
        let of_channel = |(channel, candidate): (usize, &Candidate)| {
            let drive = drives(channel).map(|value| value.clamp(0.0, 1.0));
            let light = candidate.inverse.light(&product(&blur, &drive));
            light.map_or(f64::INFINITY, |light| mean_error(&light, &images))
        };
        candidates.iter().enumerate().map(of_channel).sum::<f64>()
    };
    let all: Vec<usize> = (0..prepared.roles.len()).collect();
    let gain_only = error(&|channel| {
        let gain = gains(prepared, channel, &all, prediction.gain_only_kind);
        DMatrix::from_diagonal(&(&gain / gain.max())) * &images
    });
    let mut best: Option<(f64, Vec<DMatrix<f64>>)> = None;
    for softness in SOFTNESS {
        let sharper = sharpener(&blur, softness);
        let sharp: Vec<_> = wholes.iter().map(|whole| product(&sharper, whole)).collect();
        let tried = error(&|channel| {
            let drive = &sharp[channel] * &images;
            // Reference white: the brightest even grey.
            let grey = sharp[channel].column_sum().max();
            drive / grey.max(f64::MIN_POSITIVE)
        });
        if best.as_ref().is_none_or(|(least, _)| tried < *least) {
            best = Some((tried, sharp));
        }
    }
    let (least, sharp) = best?;
    let operators = sharp.iter().zip(candidates).map(|(sharp, candidate)| {
        let mut operator = DMatrix::from_diagonal(&candidate.inverse.gain) - sharp;
        drop_dead(&mut operator, &prepared.live);
        (candidate.inverse.gain.clone(), operator)
    });
    Some(Sharpened {
        parts: parts(operators.collect()),
        helps: least < gain_only,
    })
}

/// The mean operator, and each channel's own deviation from it.
fn parts(operators: Vec<(DVector<f64>, DMatrix<f64>)>) -> (DMatrix<f64>, Vec<Channel>) {
    let count = operators.len() as f64;
    let cells = operators.first().map_or(0, |(gain, _)| gain.len());
    let mut shared = DMatrix::zeros(cells, cells);
    for (_, operator) in &operators {
        shared += operator / count;
    }
    let alone = operators.len() == 1;
    let channels = operators.into_iter().map(|(gain, operator)| Channel {
        gain,
        scale: 1.0,
        deviation: (!alone).then(|| operator - &shared),
    });
    let channels = channels.collect();
    (shared, channels)
}

/// `(B^T B + s^2)^-1 (B^T + s^2)`: undoes the blur where its singular values are
/// above `softness`, leaves alone what is far below.
fn sharpener(blur: &DMatrix<f64>, softness: f64) -> DMatrix<f64> {
    let cells = blur.nrows();
    let one = DMatrix::identity(cells, cells);
    if softness.is_infinite() {
        return one;
    }
    let soft = &one * (softness * softness);
    let normal = blur.tr_mul(blur) + &soft;
    match normal.cholesky() {
        Some(factor) => factor.solve(&(blur.transpose() + soft)),
        None => one,
    }
}

/// Mean over images of `min_s ||s light - wanted|| / ||wanted||`.
fn mean_error(light: &DMatrix<f64>, wanted: &DMatrix<f64>) -> f64 {
    let of_image = |k: usize| {
        let (light, wanted) = (light.column(k), wanted.column(k));
        let (seen, asked) = (light.norm_squared(), wanted.norm_squared());
        if seen == 0.0 || asked == 0.0 {
            return 1.0;
        }
        (1.0 - light.dot(&wanted).powi(2) / (seen * asked)).max(0.0).sqrt()
    };
    (0..wanted.ncols()).map(of_image).sum::<f64>() / wanted.ncols().max(1) as f64
}
