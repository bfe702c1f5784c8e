//! What the bounds say of one capture.

use super::super::forward::Inverse;
use super::super::haar::Haar;
use super::sensing::Transported;
use super::{LIMIT, RecoveryBounds, Sampling, Sensing, signed};
use iltm_picture::numbers::number;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Part of a row's energy that its effective coefficients hold.
const ENERGY: f64 = 0.99;

/// Sparsities that are tried at most to find the largest for which the condition may
/// hold.
const MOST_TRIED: usize = 64;

/// Bounds of the paper's Theorem 3.1 for a capture, worst channel.
///
/// They are about the paper's direct method on this capture's flood and Bernoulli
/// photographs, whichever method the inverse was found with.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Recovery {
    /// Coefficients that hold 99 % of the energy of a row of the Haar-coded inverse,
    /// median of the rows.
    pub k: usize,
    /// Photographs, flood included.
    pub photographs: usize,
    /// `kappa_2k` is at least this.
    pub kappa_at_least: f64,
    /// `kappa_2k` is at most this; infinite if no bound is known.
    pub kappa_at_most: f64,
    /// `gamma_2k` is at least this, patterns combined to +1 and -1.
    pub gamma_at_least: f64,
    /// `gamma_2k` is at most this; infinite if no bound is known.
    pub gamma_at_most: f64,
    /// `gamma_2k` of the patterns as they are shown, 0 and 1, is at least this.
    pub gamma_as_shown_at_least: f64,
    /// `kappa_2k^2 gamma_2k` is at least this.
    pub product_at_least: f64,
    /// `kappa_2k^2 gamma_2k` is at most this; infinite if no bound is known.
    pub product_at_most: f64,
    /// What the product bounds, the largest over the smallest `||C^T W h||^2 / ||h||^2`
    /// of 2k-sparse `h`, is at least this.
    pub ratio_at_least: f64,
    /// Largest cosine between columns of the sensing matrix; on grids of more cells
    /// than are looked at, of those that are.
    pub coherence: f64,
    /// The largest number of coefficients a row for which the condition may hold: for
    /// more it is known to fail.
    pub k_may_hold: usize,
    /// The largest for which it is known to hold.
    pub k_holds: usize,
    /// Supports that the lower bounds are from.
    pub supports: usize,
}

/// What the bounds decide.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Isometry {
    /// The theorem's condition holds.
    Holds,
    /// Neither bound decides.
    Open,
    /// The theorem's condition fails.
    Fails,
}

impl Recovery {
    /// What the bounds decide.
    #[must_use]
    pub fn verdict(&self) -> Isometry {
        if self.product_at_most < LIMIT {
            Isometry::Holds
        } else if self.product_at_least >= LIMIT {
            Isometry::Fails
        } else {
            Isometry::Open
        }
    }

    /// The same for people, lines of a report.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let (k, m) = (self.k, self.photographs);
        let rows = match k {
            1 => "1 coefficient holds 99 % of a row's energy".to_owned(),
            k => format!("k = {k} coefficients hold 99 % of a row's energy"),
        };
        let asks = format!("the theorem asks for less than {LIMIT:.2}");
        let verdict = self.verdict();
        let why = match verdict {
            Isometry::Holds => {
                let most = number(self.product_at_most);
                format!("kappa^2 gamma is at most {most} (Gershgorin), {asks}:")
            }
            _ if 2 * k > m => format!("the theorem needs 2 k photographs, and there are {m}:"),
            _ if self.product_at_least.is_infinite() => {
                format!("kappa^2 gamma is infinite (some are not told apart), {asks}:")
            }
            _ => {
                let least = number(self.product_at_least);
                let most = if self.product_at_most.is_finite() {
                    format!("at most {} (Gershgorin)", number(self.product_at_most))
                } else {
                    "no bound from above is known".to_owned()
                };
                format!("kappa^2 gamma is at least {least} (sampled), {most};\n{asks}:")
            }
        };
        let so = match (verdict, self.k_may_hold) {
            (Isometry::Holds, _) => "without noise, plain l1 finds such rows exactly".to_owned(),
            (Isometry::Open, _) => "not decided; held-out photographs judge instead".to_owned(),
            (Isometry::Fails, 0) => {
                "it promises nothing here, for no k; held-out photographs judge instead".to_owned()
            }
            (Isometry::Fails, most) => format!(
                "it promises nothing here beyond k = {most}; held-out photographs judge instead"
            ),
        };
        let mut lines = vec![format!("{rows};")];
        lines.extend(why.lines().map(str::to_owned));
        lines.push(so);
        lines
    }
}

/// Bounds for the direct method with these patterns, `N x m` as shown, of which column
/// `flood` is white; one inverse a channel. `None` if one is singular.
pub(in super::super) fn of_direct(
    inverses: &[&Inverse],
    haar: &Haar,
    patterns: &DMatrix<f64>,
    flood: &DVector<f64>,
) -> Option<Recovery> {
    let combined = signed(patterns, flood);
    let found = inverses.iter().map(|inverse| {
        let k = effective_coefficients(inverse, haar);
        let transported = Transported::new(inverse, haar)?;
        let sensing = transported.sensing(&combined);
        let bounds = sensing.bounds(k, Sampling::default());
        Some((transported, sensing, bounds))
    });
    let mut channels = found.collect::<Option<Vec<_>>>()?;
    channels.sort_by(|a, b| a.2.product.lower.total_cmp(&b.2.product.lower));
    let (transported, sensing, bounds) = channels.pop()?;
    // The mean of patterns that are 0 and 1 shows in any few supports.
    let few = Sampling {
        random: 0,
        starts: 2,
        ..Sampling::default()
    };
    let as_shown = transported.sensing(patterns).bounds(bounds.k, few);
    let RecoveryBounds {
        k,
        kappa,
        gamma,
        product,
        ratio,
        supports,
    } = bounds;
    let (k_may_hold, k_holds) = largest(&sensing);
    Some(Recovery {
        k,
        photographs: sensing.photographs,
        kappa_at_least: kappa.lower,
        kappa_at_most: kappa.upper,
        gamma_at_least: gamma.lower,
        gamma_at_most: gamma.upper,
        gamma_as_shown_at_least: as_shown.gamma.lower,
        product_at_least: product.lower,
        product_at_most: product.upper,
        ratio_at_least: ratio.lower,
        coherence: sensing.coherence(),
        k_may_hold,
        k_holds,
        supports,
    })
}

/// The largest sparsities for which the condition may hold, and does: the first by
/// few supports, since more would only make it smaller.
fn largest(sensing: &Sensing) -> (usize, usize) {
    let few = Sampling {
        random: 30,
        starts: 3,
        ..Sampling::default()
    };
    let tried = || 1..=MOST_TRIED.min(sensing.cells() / 2);
    let may_hold = |k: &usize| sensing.bounds(*k, few).product.lower < LIMIT;
    let holds = |k: &usize| sensing.product_at_most(*k) < LIMIT;
    (
        tried().take_while(may_hold).count(),
        tried().take_while(holds).count(),
    )
}

/// Coefficients that hold [`ENERGY`] of a row of `W^T T^-1 W`, median of the rows.
fn effective_coefficients(inverse: &Inverse, haar: &Haar) -> usize {
    let mut squares: Vec<Vec<f64>> = vec![Vec::new(); inverse.gain.len()];
    for coefficient in inverse.haar_coefficients(haar) {
        squares[coefficient.row as usize].push(coefficient.value.powi(2));
    }
    let count = |mut squares: Vec<f64>| {
        squares.sort_unstable_by(|a, b| b.total_cmp(a));
        let enough = ENERGY * squares.iter().sum::<f64>();
        let mut sum = 0.0;
        let last = squares.iter().position(|square| {
            sum += square;
            sum >= enough
        });
        last.map_or(squares.len(), |at| at + 1)
    };
    // The row of a function on cells that took no part has no energy.
    let live = squares
        .into_par_iter()
        .filter(|squares| !squares.is_empty());
    let mut counts: Vec<usize> = live.map(count).collect();
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or(1)
}
