//! The Neumann series of the inverse.

use super::live::{LiveTransport, convergence, finite, spectral_radius};
use super::{Inversion, Inverted, Known};
use crate::{Answer, Source, Unfit};
use iltm_picture::progress::Progress;
use nalgebra::{DMatrix, DVector};

/// `T^-1 = F1^-1 sum_k (I - T F1^-1)^k` up to `k = order`, around the direct light
/// `F1 = diag(T)` (the paper's Eq. 12).
#[derive(Clone, Copy, Debug)]
pub struct Neumann {
    /// Terms beyond the first.
    pub order: usize,
}

impl Inversion for Neumann {
    fn name(&self) -> String {
        format!("Neumann series, order {}", self.order)
    }

    fn source(&self) -> Source {
        Source::THE_PAPER
    }

    fn how(&self) -> &'static str {
        "Starts from each cell's own light and, term by term, takes away, adds back, takes \
         away what cells throw at each other. Converges only while less than half of the \
         light comes from other cells."
    }

    fn invert(&self, known: Known<'_>, _progress: &dyn Progress) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let own = live.own_light()?;
        let n = live.len() as f64;
        let order = self.order as f64;
        let matrix = finite(series(&live.transport, &own, self.order))?;
        let radius = radius(&live.transport, &own);
        Ok(Inverted {
            answer: Answer::Inverse(live.whole(&matrix)),
            multiplications: Some(order * n * (n - 1.0) + (order + 1.0) * n),
            photographs: 0,
            remark: convergence(radius),
        })
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
pub(super) fn radius(transport: &DMatrix<f64>, own: &DVector<f64>) -> f64 {
    spectral_radius(own.len(), |x| x - transport * x.component_div(own))
}

#[cfg(test)]
mod tests {
    use super::super::test_scene::Before;
    use super::*;
    use iltm_picture::progress::Silent;

    /// Cells of a sphere get `r / (1 - r)` times their own light from all others.
    #[test]
    fn the_radius_is_that_of_a_spheres_closed_form_and_half_of_the_light_is_its_limit() {
        for (albedo, word) in [(0.4, "converges"), (0.6, "diverges")] {
            let before = Before::sphere(4, 5, albedo);
            let bounced = albedo / (1.0 - albedo) / 20.0;
            let wanted = 19.0 * bounced / (1.0 + bounced);
            let own = before.transport.diagonal();
            assert!((radius(&before.transport, &own) - wanted).abs() < 1e-9);
            let said = Neumann { order: 3 }
                .invert(before.known(), &Silent)
                .unwrap();
            assert!(said.remark.starts_with(word), "{}", said.remark);
        }
    }

    /// The error of a series is its radius to the power of the terms: on a sphere the
    /// constant image is the slowest.
    #[test]
    fn each_term_brings_a_convergent_series_nearer_by_its_radius() {
        let before = Before::sphere(4, 5, 0.4);
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
}
