//! Fig. 2: where Theorem 3.1 promises exact recovery, and where the scene lies.
//!
//! `kappa_2k(T)^2 gamma_2k < sqrt 2 + 1`. The exact constants are NP-hard; a scene's
//! place is drawn at bounds from below ([`iltm_solve::restricted_isometry`]), so that it can
//! only be further from the region, not nearer.

use super::scenes::{Condition, surface};
use iltm_capture::{Role, columns, pattern_set};
use iltm_picture::chart::curves;
use iltm_solve::{
    Haar,
    restricted_isometry::{LIMIT, Sampling, Sensing, signed},
};
use nalgebra::DVector;

/// Coefficients a row that bounds are found for.
const SPARSITIES: [usize; 5] = [1, 2, 4, 8, 16];
/// Photographs, the last more than anybody takes.
const PHOTOGRAPHS: [usize; 3] = [120, 270, 1_500];

/// A scene's place at one sparsity and number of photographs.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct TheoremBounds {
    /// Whether cells differ in albedo.
    pub(super) textured: bool,
    /// Photographs.
    pub(super) photographs: usize,
    /// Coefficients a row.
    pub(super) k: usize,
    /// `kappa_2k` is at least this.
    pub(super) kappa: f64,
    /// `gamma_2k` is at least this.
    pub(super) gamma: f64,
    /// `kappa_2k^2 gamma_2k` is at least and at most this.
    pub(super) product: (f64, f64),
}

/// Bounds for the uniform and the textured scene.
pub(super) fn places() -> Vec<TheoremBounds> {
    let mut places = Vec::new();
    for condition in [Condition::ALL[0], Condition::ALL[2]] {
        let Some((truth, _)) = condition.world(1) else {
            continue;
        };
        let haar = Haar::new(truth.grid);
        let flood = DVector::from_element(truth.grid.cells(), 1.0);
        for photographs in PHOTOGRAPHS {
            let taken: Vec<_> = pattern_set(truth.grid, photographs, 1)
                .into_iter()
                .filter(|(role, _)| *role == Role::Bernoulli)
                .collect();
            let patterns = signed(&columns(&taken), &flood);
            let sensing = Sensing::new(&truth.transport, &haar, &patterns);
            for k in SPARSITIES {
                let bounds = sensing.bounds(k, Sampling::default());
                places.push(TheoremBounds {
                    textured: condition.textured,
                    photographs,
                    k,
                    kappa: bounds.kappa.lower,
                    gamma: bounds.gamma.lower,
                    product: (bounds.product.lower, bounds.product.upper),
                });
            }
        }
    }
    places
}

/// The region with the scene's places in it.
pub(super) fn chart(places: &[TheoremBounds]) -> String {
    let finite = |place: &&TheoremBounds| place.gamma.is_finite();
    let most =
        |of: fn(&TheoremBounds) -> f64| places.iter().filter(finite).map(of).fold(2.0, f64::max);
    let border: Vec<(f64, f64)> = (0..=60)
        .map(|step| 1.0 + f64::from(step) / 60.0 * (LIMIT.sqrt() - 1.0))
        .map(|kappa| (kappa, LIMIT / (kappa * kappa)))
        .collect();
    let mut series = Vec::new();
    for textured in [false, true] {
        for photographs in PHOTOGRAPHS {
            let own = places.iter().filter(|place| {
                (place.textured, place.photographs) == (textured, photographs)
                    && place.gamma.is_finite()
            });
            let scene = surface(textured);
            series.push((
                format!("{scene}, {photographs} photographs"),
                own.map(|place| (place.kappa, place.gamma)).collect(),
            ));
        }
    }
    let mut chart = curves(
        "Where Theorem 3.1 promises recovery (shaded), and where the scene is",
        (
            "kappa of T for 2k coefficients, at least",
            "gamma of the patterns for 2k coefficients, at least",
        ),
        series,
    );
    chart.x.range = Some((1.0, 1.3 * most(|p| p.kappa)));
    chart.y.range = Some((1.0, 1.6 * most(|p| p.gamma)));
    chart.notes = vec!["Points of a line: k = 1, 2, 4, 8, 16 coefficients a row".to_owned()];
    chart.shaded = border;
    chart.file()
}
