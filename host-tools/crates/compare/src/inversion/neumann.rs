//! Neumann series of the inverse, frame by frame or multiplied out into a sparse matrix
//! (stratified inverses).

use super::live::{LiveTransport, convergence, finite, spectral_radius};
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Unfit};
use nalgebra::{DMatrix, DVector};

/// `T^-1 = F1^-1 sum_k (I - T F1^-1)^k` up to `k = order`, around the direct light
/// `F1 = diag(T)` (the paper's Eq. 12).
#[derive(Clone, Copy, Debug)]
pub struct Neumann {
    /// Terms beyond the first.
    pub order: usize,
}

impl Inversion for Neumann {
    fn description(&self) -> Description {
        Description {
            name: format!("Neumann series, order {}", self.order),
            source: Citation::THE_PAPER,
            how: "Starts from each cell's own light and, term by term, takes away, adds back, \
                takes away what cells throw at each other. Converges only while less than half of \
                the light comes from other cells.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let own = live.own_light()?;
        let n = live.len() as f64;
        let order = self.order as f64;
        let matrix = finite(series(&live.transport, &own, self.order))?;
        let radius = radius(&live.transport, &own);
        Ok(Inverted::matrix(
            live.whole(&matrix),
            order * n * (n - 1.0) + (order + 1.0) * n,
            convergence(radius),
        ))
    }
}

/// By Horner's rule: `M <- D^-1 (I - (T - D) M)`.
fn series(transport: &DMatrix<f64>, own: &DVector<f64>, order: usize) -> DMatrix<f64> {
    let mut others = transport.clone();
    others.fill_diagonal(0.0);
    let mut scaled = others;
    for mut column in scaled.column_iter_mut() {
        column.component_div_assign(own);
    }
    let first = DMatrix::from_diagonal(&own.map(f64::recip));
    let mut sum = first.clone();
    for _ in 0..order {
        sum = &first - &scaled * sum;
    }
    sum
}

/// Spectral radius of `I - T D^-1`.
fn radius(transport: &DMatrix<f64>, own: &DVector<f64>) -> f64 {
    spectral_radius(own.len(), |x| x - transport * x.component_div(own))
}

/// `T = (I + S) F1`: strata `(-S)^k` are multiplied out and added up, elements below
/// `threshold` dropped on the way.
#[derive(Clone, Copy, Debug)]
pub struct Stratified {
    /// Strata beyond the first: bounces that are cancelled.
    pub strata: usize,
    /// Smallest element of a stratum that is kept, relative to each cell's own light.
    pub threshold: f64,
}

impl Inversion for Stratified {
    fn description(&self) -> Description {
        let Self { strata, threshold } = self;
        Description {
            name: format!("stratified inverse, strata {strata}, threshold {threshold}"),
            source: Citation {
                authors: "Ng, Pahwa, Bai, Quek, Tan",
                title: "Radiometric Compensation Using Stratified Inverses",
                venue: "ICCV",
                year: 2009,
            },
            how: "The Neumann series multiplied out before the show: each stratum cancels one more \
                bounce, and small elements are dropped, so that sparse matrices are multiplied and \
                one sparse matrix is left for a frame.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let own = live.own_light()?;
        let n = live.len();
        let mut between = live.transport.clone();
        for (mut column, own) in between.column_iter_mut().zip(own.iter()) {
            column /= -*own;
        }
        between.fill_diagonal(0.0);
        self.drop_small(&mut between);
        let mut stratum = DMatrix::identity(n, n);
        let mut sum = stratum.clone();
        for _ in 0..self.strata {
            stratum = &between * stratum;
            self.drop_small(&mut stratum);
            sum += &stratum;
        }
        for mut column in sum.column_iter_mut() {
            column.component_div_assign(&own);
        }
        let sum = finite(sum)?;
        let stored = sum.iter().filter(|value| **value != 0.0).count();
        let radius = radius(&live.transport, &own);
        Ok(Inverted::matrix(
            live.whole(&sum),
            stored as f64,
            format!(
                "{:.1} elements a cell; {}",
                stored as f64 / n as f64,
                convergence(radius)
            ),
        ))
    }
}

impl Stratified {
    fn drop_small(&self, stratum: &mut DMatrix<f64>) {
        for value in stratum.iter_mut() {
            if value.abs() < self.threshold {
                *value = 0.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    /// Cells of a sphere get `r / (1 - r)` times their own light from all others.
    #[test]
    fn the_radius_is_that_of_a_spheres_closed_form_and_half_of_the_light_is_its_limit() {
        for (albedo, word) in [(0.4, "converges"), (0.6, "diverges")] {
            let before = KnownScene::sphere(4, 5, albedo);
            let bounced = albedo / (1.0 - albedo) / 20.0;
            let wanted = 19.0 * bounced / (1.0 + bounced);
            let own = before.transport.diagonal();
            assert!((radius(&before.transport, &own) - wanted).abs() < 1e-9);
            let said = Neumann { order: 3 }.invert(before.known()).unwrap();
            assert!(said.remark.starts_with(word), "{}", said.remark);
        }
    }

    /// The error of a series is its radius to the power of the terms: on a sphere the
    /// constant image is the slowest.
    #[test]
    fn each_term_brings_a_convergent_series_nearer_by_its_radius() {
        let before = KnownScene::sphere(4, 5, 0.4);
        let radius = radius(&before.transport, &before.transport.diagonal());
        let errors: Vec<f64> = [1, 3, 8, 40]
            .map(|order| before.error(&Neumann { order }))
            .to_vec();
        assert!(
            (errors[2] / errors[1] / radius.powi(5) - 1.0).abs() < 0.05,
            "{errors:?}"
        );
        assert!(errors[3] < 1e-6, "{errors:?}");
    }

    #[test]
    fn with_nothing_dropped_strata_are_the_terms_of_the_series() {
        let before = KnownScene::textured(5, 8);
        let strata = before.matrix(&Stratified {
            strata: 3,
            threshold: 0.0,
        });
        let terms = before.matrix(&Neumann { order: 3 });
        assert!((strata - &terms).norm() < 1e-12 * terms.norm());
    }

    #[test]
    fn a_threshold_buys_sparsity_with_accuracy() {
        let before = KnownScene::panels(6, 8);
        let with = |threshold| Stratified {
            strata: 8,
            threshold,
        };
        let exact = before.matrix(&with(0.0));
        let sparse = before.matrix(&with(0.01));
        let count = |matrix: &DMatrix<f64>| matrix.iter().filter(|v| **v != 0.0).count();
        assert!(2 * count(&sparse) < count(&exact));
        assert!(before.error(&with(0.01)) > before.error(&with(0.0)));
    }
}
