//! The regularised inverse of a transport that is hard to invert.

use super::live::{LiveTransport, finite};
use super::pseudo_inverse::{noise_weight, regularised};
use super::{Inversion, Inverted, Known};
use crate::compare::{Answer, Source, Unfit};
use crate::content::natural_images;
use crate::progress::Progress;
use nalgebra::DMatrix;

/// Weights that are tried: the least by noise, each of the others twice the one before.
const TRIALS: usize = 12;
/// The least weight that is tried, of the root mean square singular value.
const LEAST: f64 = 1e-4;

/// `(T^T T + mu^2 I)^-1 T^T`, with `mu` at least what the noise asks for and such that
/// natural images come out best once inputs are clipped.
#[derive(Clone, Copy, Debug)]
pub struct Tikhonov;

impl Inversion for Tikhonov {
    fn name(&self) -> String {
        "Tikhonov inverse".to_owned()
    }

    fn source(&self) -> Source {
        Source {
            authors: "Tikhonov",
            title: "Solution of Incorrectly Formulated Problems and the Regularization Method",
            venue: "Soviet Mathematics Doklady",
            year: 1963,
        }
    }

    fn how(&self) -> &'static str {
        "Least squares with a price on large inputs, (T^T T + mu^2 I)^-1 T^T: detail that the \
         projector can hardly show is given up instead of driving inputs out of range. mu \
         comes from the noise and from what clipping does to natural images."
    }

    fn invert(&self, known: Known<'_>, _progress: &dyn Progress) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let images = wanted(&known, &live)?;
        let gram = live.transport.tr_mul(&live.transport);
        let scale = (gram.trace() / live.len() as f64).sqrt();
        let least = noise_weight(&live, live.len()).max(LEAST * scale);
        let mut best: Option<(f64, f64, DMatrix<f64>)> = None;
        for trial in 0..TRIALS {
            let mu = least * 2_f64.powi(trial as i32);
            let factor = regularised(&gram, mu).cholesky().ok_or(Unfit::Singular)?;
            let inverse = factor.solve(&live.transport.transpose());
            let clipped = (&inverse * &images).map(|p| p.clamp(0.0, 1.0));
            let error = (&live.transport * clipped - &images).norm() / images.norm();
            if best.as_ref().is_none_or(|(least, ..)| error < *least) {
                best = Some((error, mu, inverse));
            }
        }
        let (error, mu, inverse) = best.ok_or(Unfit::Singular)?;
        let n = live.len() as f64;
        Ok(Inverted {
            answer: Answer::Inverse(live.whole(&finite(inverse)?)),
            multiplications: Some(n * n),
            photographs: 0,
            remark: format!("mu {mu:.4}, which promises an error of {error:.4}"),
        })
    }
}

/// Natural images in camera units between live cells, as bright as flood light allows in
/// its darkest tenth of the cells.
fn wanted(known: &Known<'_>, live: &LiveTransport) -> Result<DMatrix<f64>, Unfit> {
    let flood = live.flood()?;
    let mut sorted: Vec<f64> = flood.iter().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let white = sorted[sorted.len() / 10];
    let images = natural_images(known.grid).select_rows(&live.chosen);
    // Walls that light each other cannot be black beside white.
    Ok(images.map(|light| white * (0.2 + 0.8 * light)))
}

#[cfg(test)]
mod tests {
    use super::super::test_scene::Before;
    use super::*;
    use crate::compare::Truth;
    use crate::progress::Silent;
    use crate::scene::coaxial::{Panels, Scene};
    use iltm_runtime::Grid;

    #[test]
    fn where_nothing_is_hard_next_to_nothing_is_given_up() {
        let before = Before::panels(5, 8);
        assert!(
            before.error(&Tikhonov) < 1e-3,
            "{}",
            before.error(&Tikhonov)
        );
    }

    #[test]
    fn behind_a_blur_it_shows_images_better_than_the_inverse() {
        let grid = Grid::new(9, 12).unwrap();
        let panels = Panels::m_shape(grid, 75.0);
        let sharp = Before::scene(&Scene::new(grid, &panels, 0.7));
        let blurred = Before::scene(&Scene::new(grid, &panels, 0.7).blurred(0.7));
        let images = sharp.truth().images;
        let truth = Truth {
            images,
            ..blurred.truth()
        };
        let found = Tikhonov.invert(blurred.known(), &Silent).unwrap();
        let exact = Answer::Inverse(truth.inverse.clone());
        let (ours, theirs) = (truth.judge(&found.answer), truth.judge(&exact));
        assert!(
            ours.compensation < theirs.compensation,
            "{ours:?} {theirs:?}"
        );
    }
}
