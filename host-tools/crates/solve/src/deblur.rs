//! Deblurring: from `T0^-1 = diag(g) - K` to `T^-1 = B^-1 T0^-1` for a projector out of
//! focus.
//!
//! A blur takes fine detail away, and nothing brings back what is not there. So
//! its inverse is approached in a few rounds (Landweber's, with a Tikhonov step:
//! Engl, Hanke, Neubauer, *Regularization of Inverse Problems*, 1996, section 5.1):
//! nearly exact where singular values of `B` are above some softness, nothing
//! where they are far below. The softness is tried out on natural images and on
//! those that the blurred projector can show.

use super::clipped_projection::ClippedProjection;
use super::forward::{Inverse, product};
use super::interreflection::Interreflection;
use super::solution::{Candidate, Channel, drop_dead};
use nalgebra::{DMatrix, DVector};

/// Softnesses that are tried; infinite undoes nothing.
const SOFTNESS: [f64; 7] = [0.02, 0.05, 0.1, 0.2, 0.4, 1.0, f64::INFINITY];
/// Rounds of the approach.
const ROUNDS: usize = 6;

/// What an inverse that undoes the blur as well consists of.
pub(super) struct Deblurred {
    /// Error on natural images.
    pub(super) error: f64,
    /// The operator all channels share, and the channels.
    pub(super) parts: (Interreflection, Vec<Channel>),
}

/// `blur` is that of live cells only; `None` if there is no channel.
pub(super) fn deblur(
    blur: &DMatrix<f64>,
    live: &[bool],
    candidates: &[Candidate],
    content: &ClippedProjection<'_>,
) -> Option<Deblurred> {
    let wholes: Vec<DMatrix<f64>> = candidates.iter().map(|c| c.inverse.dense()).collect();
    let mut best: Option<(f64, f64, Vec<Inverse>)> = None;
    for softness in SOFTNESS {
        let sharper = regularised_inverse(blur, softness);
        let sharp = wholes.iter().zip(candidates).map(|(whole, candidate)| {
            let gain = candidate.inverse.gain.clone();
            let operator = DMatrix::from_diagonal(&gain) - product(&sharper, whole);
            Inverse::new(gain, operator)
        });
        let sharp: Vec<Inverse> = sharp.collect();
        let (natural, both) = content.operator(&sharp.iter().collect::<Vec<_>>());
        if best.as_ref().is_none_or(|(_, least, _)| both < *least) {
            best = Some((natural, both, sharp));
        }
    }
    let (error, _, sharp) = best?;
    let operators = sharp.into_iter().map(|sharp| {
        let mut operator = sharp.operator.dense();
        drop_dead(&mut operator, live);
        (sharp.gain, operator)
    });
    Some(Deblurred {
        error,
        parts: parts(operators.collect()),
    })
}

/// The mean operator, and each channel's own deviation from it.
fn parts(operators: Vec<(DVector<f64>, DMatrix<f64>)>) -> (Interreflection, Vec<Channel>) {
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
        deviation: (!alone).then(|| Interreflection::Dense(operator - &shared)),
    });
    let channels = channels.collect();
    (Interreflection::Dense(shared), channels)
}

fn regularised_inverse(blur: &DMatrix<f64>, softness: f64) -> DMatrix<f64> {
    let cells = blur.nrows();
    let one = DMatrix::identity(cells, cells);
    let normal = blur.tr_mul(blur) + &one * (softness * softness);
    let Some(factor) = normal.cholesky().filter(|_| softness.is_finite()) else {
        return one;
    };
    let step = factor.solve(&blur.transpose());
    let mut sharper = one.clone();
    for _ in 0..ROUNDS {
        sharper += product(&step, &(&one - product(blur, &sharper)));
    }
    sharper
}
