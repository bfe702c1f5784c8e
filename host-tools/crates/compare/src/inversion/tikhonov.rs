//! Tikhonov regularisation: the inverse of a transport that is noisy or hard to invert.

use super::gain_only::flood;
use super::live::{LiveTransport, finite};
use super::pseudo_inverse::regularised;
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Rig, Unfit};
use iltm_capture::NoiseModel;
use iltm_solve::wanted_images;
use nalgebra::{DMatrix, DVector};

/// Weights that are tried, each twice the one before.
const TRIALS: i32 = 17;
/// The least of them, of the root mean square singular value.
const LEAST: f64 = 1e-4;

/// Of all inputs the one with the least `||T p - d||^2 + mu^2 ||p - d / flood||^2`.
///
/// `mu` is chosen as if the transport at hand were the true one and had been
/// photographed again with as much noise: the weight with which natural images then come
/// out best, inputs clipped.
#[derive(Clone, Copy, Debug)]
pub struct Tikhonov;

impl Inversion for Tikhonov {
    fn description(&self) -> Description {
        Description {
            name: "Tikhonov inverse".to_owned(),
            source: Citation {
                authors: "Tikhonov",
                title: "Solution of Incorrectly Formulated Problems and the Regularization Method",
                venue: "Soviet Mathematics Doklady",
                year: 1963,
            },
            how: "Least squares with a price on leaving d / flood: what noise hides, or the lens \
                does not let through, is given up instead of driving inputs out of range. The \
                price is the one that serves natural images best.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let seen = NoisyTransport::new(&live.transport, flood(&known, &live)?);
        let again = again(&known, &live, &seen);
        let images = wanted(&known, &live, &seen);
        let mean = (seen.transport.norm_squared() / live.len() as f64).sqrt();
        let mut best: Option<(f64, f64)> = None;
        for trial in 0..TRIALS {
            let mu = LEAST * mean * 2_f64.powi(trial);
            let inverse = again.inverse(mu)?;
            let clipped = (inverse * &images).map(|p| p.clamp(0.0, 1.0));
            let error = (&seen.transport * clipped - &images).norm() / images.norm();
            if best.is_none_or(|(least, _)| error < least) {
                best = Some((error, mu));
            }
        }
        let (error, mu) = best.ok_or(Unfit::Singular)?;
        let n = live.len() as f64;
        Ok(Inverted::matrix(
            live.whole(&finite(seen.inverse(mu)?)?),
            n * n,
            format!("mu {mu:.4}, which promises an error of {error:.4}"),
        ))
    }
}

/// What is known of the light between live cells.
struct NoisyTransport {
    transport: DMatrix<f64>,
    flood: DVector<f64>,
}

impl NoisyTransport {
    /// Shares out what a photograph of white corrects in the sum of all columns: the
    /// least change of the transport that agrees with it.
    fn new(transport: &DMatrix<f64>, flood: DVector<f64>) -> Self {
        let missing = (&flood - transport.column_sum()) / transport.ncols() as f64;
        let mut transport = transport.clone();
        for mut column in transport.column_iter_mut() {
            column += &missing;
        }
        Self { transport, flood }
    }

    /// With `M0 = diag(1 / flood)`: `M0 + (T^T T + mu^2 I)^-1 T^T (I - T M0)`.
    fn inverse(&self, mu: f64) -> Result<DMatrix<f64>, Unfit> {
        let transport = &self.transport;
        let mut missing = -transport;
        for (mut column, flood) in missing.column_iter_mut().zip(self.flood.iter()) {
            column /= *flood;
        }
        for cell in 0..missing.nrows() {
            missing[(cell, cell)] += 1.0;
        }
        let gram = regularised(&transport.tr_mul(transport), mu);
        let factor = gram.cholesky().ok_or(Unfit::Singular)?;
        let mut inverse = factor.solve(&transport.tr_mul(&missing));
        for (cell, flood) in self.flood.iter().enumerate() {
            inverse[(cell, cell)] += flood.recip();
        }
        Ok(inverse)
    }
}

/// What would be seen if the transport were as it was `seen`.
fn again(
    known: &KnownTransport<'_>,
    live: &LiveTransport,
    seen: &NoisyTransport,
) -> NoisyTransport {
    let noise = NoiseModel {
        shot: 0.0,
        floor: live.noise().powi(2),
    };
    let cells = known.live.len();
    let transport = live.whole(&seen.transport);
    let mut rig = Rig::new(known.grid, transport, known.live.to_vec(), noise, 1);
    let columns = rig.photograph(&DMatrix::identity(cells, cells));
    let columns = columns
        .select_rows(&live.chosen)
        .select_columns(&live.chosen);
    // The photograph of white is as good as it was, so none is taken again.
    NoisyTransport::new(&columns, seen.flood.clone())
}

/// Natural images in camera units between live cells, white as bright as flood light in
/// the darkest tenth of the cells.
fn wanted(known: &KnownTransport<'_>, live: &LiveTransport, seen: &NoisyTransport) -> DMatrix<f64> {
    let mut flood: Vec<f64> = seen.flood.iter().copied().collect();
    flood.sort_by(f64::total_cmp);
    let white = flood[flood.len() / 10];
    wanted_images(known.grid).select_rows(&live.chosen) * white
}

#[cfg(test)]
mod tests {
    use super::super::{Exact, FloodGain};
    use super::*;
    use crate::known_scene::KnownScene;
    use crate::{Answer, GroundTruth};
    use iltm_runtime::Grid;
    use iltm_scene::coaxial::{CoaxialScene, Panels};

    #[test]
    fn where_nothing_is_hard_next_to_nothing_is_given_up() {
        let before = KnownScene::panels(5, 8);
        assert!(
            before.error(&Tikhonov) < 1e-3,
            "{}",
            before.error(&Tikhonov)
        );
    }

    /// With one photograph of white better than all columns together, a transport that
    /// is mostly noise is worth little, but never less than that photograph.
    #[test]
    fn with_noise_it_is_better_than_the_inverse_and_no_worse_than_gains() {
        let before = KnownScene::panels(8, 12);
        let truth = before.truth();
        let noisy = before.noisy(1e-4);
        let each = DMatrix::identity(96, 96);
        let transport = noisy.rig.clone().photograph(&each);
        let known = KnownTransport {
            transport: &transport,
            ..noisy.known()
        };
        let error = |method: &dyn Inversion| {
            let found = method.invert(known).unwrap();
            truth.judge(&found.answer).compensation
        };
        assert!(error(&Tikhonov) < 0.8 * error(&Exact));
        assert!(error(&Tikhonov) < 1.05 * error(&FloodGain));
    }

    #[test]
    fn behind_a_blur_it_shows_images_better_than_the_inverse() {
        let grid = Grid::new(9, 12).unwrap();
        let panels = Panels::m_shape(grid, 75.0);
        let sharp = KnownScene::scene(&CoaxialScene::new(grid, &panels, 0.7));
        let blurred = KnownScene::scene(
            &CoaxialScene::new(grid, &panels, 0.7).blurred(iltm_solve::blur(grid, 0.7)),
        );
        let images = sharp.truth().images;
        let truth = GroundTruth {
            images,
            ..blurred.truth()
        };
        let found = Tikhonov.invert(blurred.known()).unwrap();
        let exact = Answer::Inverse(truth.inverse.clone());
        let (ours, theirs) = (truth.judge(&found.answer), truth.judge(&exact));
        assert!(
            ours.compensation < theirs.compensation,
            "{ours:?} {theirs:?}"
        );
    }
}
