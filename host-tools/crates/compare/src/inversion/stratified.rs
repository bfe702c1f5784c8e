//! Stratified inverses: the series as a sparse matrix that is made once.

use super::live::{LiveTransport, convergence, finite};
use super::{Inversion, Inverted, Known, series};
use crate::{Answer, Source, Unfit};
use iltm_picture::progress::Progress;
use nalgebra::DMatrix;

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
    fn name(&self) -> String {
        let Self { strata, threshold } = self;
        format!("stratified inverse, strata {strata}, threshold {threshold}")
    }

    fn source(&self) -> Source {
        Source {
            authors: "Ng, Pahwa, Bai, Quek, Tan",
            title: "Radiometric Compensation Using Stratified Inverses",
            venue: "ICCV",
            year: 2009,
        }
    }

    fn how(&self) -> &'static str {
        "The Neumann series multiplied out before the show: each stratum cancels one more \
         bounce, and small elements are dropped, so that sparse matrices are multiplied and \
         one sparse matrix is left for a frame."
    }

    fn invert(&self, known: Known<'_>, _progress: &dyn Progress) -> Result<Inverted, Unfit> {
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
        let radius = series::radius(&live.transport, &own);
        Ok(Inverted {
            answer: Answer::Inverse(live.whole(&sum)),
            multiplications: Some(stored as f64),
            photographs: 0,
            remark: format!(
                "{:.1} elements a cell; {}",
                stored as f64 / n as f64,
                convergence(radius)
            ),
        })
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
    use super::super::Neumann;
    use super::super::test_scene::Before;
    use super::*;

    #[test]
    fn with_nothing_dropped_strata_are_the_terms_of_the_series() {
        let before = Before::textured(5, 8);
        let strata = before.matrix(&Stratified {
            strata: 3,
            threshold: 0.0,
        });
        let terms = before.matrix(&Neumann { order: 3 });
        assert!((strata - &terms).norm() < 1e-12 * terms.norm());
    }

    #[test]
    fn a_threshold_buys_sparsity_with_accuracy() {
        let before = Before::panels(6, 8);
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
