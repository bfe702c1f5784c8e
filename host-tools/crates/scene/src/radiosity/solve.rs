//! Radiosity equation: the light that leaves all patches after all bounces.
//!
//! `B = R (E0 + F B)`: albedo `R`, light `E0` that arrives from outside, form factors
//! `F`. One by one, `B = sum (R F)^k R E0`, as long as the light left is worth it; or at
//! once, with the symmetric positive definite `I - M`,
//! `M = R^1/2 A^1/2 F A^-1/2 R^1/2` (`A F` is symmetric), by conjugate gradients or, where
//! the matrix is stored whole, by Cholesky's factors. Which is cheapest follows from
//! the spectral radius of `R F`, estimated first (`krylov.rs`).

use super::FormFactorMatrix;
use super::krylov::{self, Symmetrised, spectral_radius};
use nalgebra::DMatrix;
use thiserror::Error;

/// When there is light enough.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum StopRule {
    /// When at most this share of all light is left out.
    Share(f64),
    /// After this many bounces between patches: 0 is the light reflected once.
    Bounces(usize),
}

/// How the light was found.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RadiosityMethod {
    /// Bounce by bounce.
    Bounces,
    /// Conjugate gradients.
    ConjugateGradients,
    /// Cholesky's factors of the whole matrix.
    Cholesky,
}

/// What each way was expected to take, from the spectral radius of `R F`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CostEstimate {
    /// Spectral radius: the share of light that a bounce leaves, in the end.
    pub radius: f64,
    /// Bounces until the light left is small enough.
    pub bounces: f64,
    /// Products with the exchange that conjugate gradients take.
    pub conjugate_gradients: f64,
    /// Cholesky's factors in units of one product; `None` if the matrix is not
    /// stored whole.
    pub cholesky: Option<f64>,
}

/// The light that leaves all patches.
#[derive(Clone, PartialEq, Debug)]
pub struct Radiosity {
    /// Radiosity, patches x columns, in the unit of the incident light.
    pub light: DMatrix<f64>,
    /// Products with the exchange: bounces, where they were added one by one.
    pub bounces: usize,
    /// Upper bound of the share of light that is left out, of the worst column;
    /// with conjugate gradients in the norm of `M`.
    pub share_left: f64,
    /// How it was found.
    pub how: RadiosityMethod,
    /// Why so.
    pub plan: CostEstimate,
}

/// Why there is no [`Radiosity`].
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum RadiosityError {
    /// One of the arguments has another number of patches.
    #[error("{what} has {found} rows, but there are {patches} patches")]
    Shape {
        /// Which.
        what: &'static str,
        /// Its rows.
        found: usize,
        /// Patches of the exchange.
        patches: usize,
    },
    /// An albedo is no share.
    #[error("the albedo of patch {patch} is {albedo}; a surface reflects between 0 and 1")]
    Albedo {
        /// The patch.
        patch: usize,
        /// Its albedo.
        albedo: f64,
    },
    /// No light is ever lost, so there is no end to the bounces.
    #[error(
        "a bounce leaves {radius} of the light: the scene is closed and reflects everything; \
         lower an albedo, or open the scene"
    )]
    NoLoss {
        /// Spectral radius.
        radius: f64,
    },
    /// The factors or the iterations break down.
    #[error(
        "no accurate light after {products} products; {left:.1e} of it is left; lower an albedo"
    )]
    NoConvergence {
        /// Products made.
        products: usize,
        /// Share left.
        left: f64,
    },
}

/// Loss below which there is no end to the bounces.
const LEAST_LOSS: f64 = 1e-9;
/// A multiply-add of Cholesky's factors costs as much as this many of a product.
/// Measured by `cargo bench -p iltm --bench radiosity -- cholesky`.
const CHOLESKY_COST: f64 = 4.0;
/// A step of conjugate gradients costs as much as this many bounces: its sums over all
/// columns come on top of the product.
const STEP_COST: f64 = 1.5;

/// The light that leaves patches of this `albedo` when `incident` light (patches x
/// columns) arrives from outside.
///
/// # Errors
/// [`RadiosityError`] if shapes differ, an albedo is not in 0..1, or light is never
/// lost.
pub fn radiosity(
    exchange: &FormFactorMatrix,
    albedo: &[f64],
    incident: &DMatrix<f64>,
    stop: StopRule,
) -> Result<Radiosity, RadiosityError> {
    check(exchange, albedo, incident)?;
    let symmetrised = Symmetrised::new(exchange, albedo);
    let radius = spectral_radius(&symmetrised);
    let level = match stop {
        StopRule::Share(level) => level.clamp(1e-12, 1.0),
        StopRule::Bounces(_) => 1.0,
    };
    let plan = plan(exchange, incident.ncols(), radius, level);
    if let StopRule::Bounces(bounces) = stop {
        return Ok(by_bounces(exchange, albedo, incident, plan, 0.0, bounces));
    }
    if radius > 1.0 - LEAST_LOSS {
        return Err(RadiosityError::NoLoss { radius });
    }
    let cholesky = plan.cholesky.unwrap_or(f64::INFINITY);
    let gradients = STEP_COST * plan.conjugate_gradients;
    if plan.bounces <= gradients.min(cholesky) {
        // Twice the plan, should the estimate have been low: then it is no more
        // than a hint, and the light left decides.
        let most = 2 * plan.bounces.ceil() as usize + 20;
        return Ok(by_bounces(exchange, albedo, incident, plan, level, most));
    }
    let (light, bounces, share_left, how) = if cholesky <= gradients {
        let light = krylov::cholesky(&symmetrised, incident);
        let light = light.ok_or(RadiosityError::NoLoss { radius })?;
        (light, 0, 0.0, RadiosityMethod::Cholesky)
    } else {
        let most = 10 * plan.conjugate_gradients.ceil() as usize + 50;
        let solved = krylov::conjugate_gradients(&symmetrised, incident, radius, level, most);
        if solved.left > level {
            let (products, left) = (solved.products, solved.left);
            return Err(RadiosityError::NoConvergence { products, left });
        }
        (
            solved.light,
            solved.products,
            solved.left,
            RadiosityMethod::ConjugateGradients,
        )
    };
    Ok(Radiosity {
        light,
        bounces,
        share_left,
        how,
        plan,
    })
}

fn check(
    exchange: &FormFactorMatrix,
    albedo: &[f64],
    incident: &DMatrix<f64>,
) -> Result<(), RadiosityError> {
    let patches = exchange.patches();
    for (what, found) in [
        ("albedo", albedo.len()),
        ("incident light", incident.nrows()),
    ] {
        if found != patches {
            return Err(RadiosityError::Shape {
                what,
                found,
                patches,
            });
        }
    }
    match albedo.iter().position(|a| !(0.0..=1.0).contains(a)) {
        Some(patch) => Err(RadiosityError::Albedo {
            patch,
            albedo: albedo[patch],
        }),
        None => Ok(()),
    }
}

/// What each way takes, in products with the exchange.
fn plan(exchange: &FormFactorMatrix, columns: usize, radius: f64, level: f64) -> CostEstimate {
    let loss = (1.0 - radius).max(LEAST_LOSS);
    // radius^k / loss is the sum of all bounces after k.
    let bounces = ((level * loss).ln() / (1.0 - loss).max(1e-300).ln()).max(0.0);
    let condition = ((1.0 + radius) / loss).sqrt();
    let convergence = ((condition + 1.0) / (condition - 1.0).max(1e-6)).ln();
    let cholesky = exchange.whole().map(|matrix| {
        let (patches, columns) = (matrix.nrows() as f64, columns.max(1) as f64);
        let factors = patches.powi(3) / 6.0 + patches * patches * columns;
        CHOLESKY_COST * factors / (patches * patches * columns).max(1.0)
    });
    CostEstimate {
        radius,
        bounces,
        conjugate_gradients: (2.0 * condition / level).ln() / convergence,
        cholesky,
    }
}

/// Adds bounces until what is left is below `level`, at most `most`.
fn by_bounces(
    exchange: &FormFactorMatrix,
    albedo: &[f64],
    incident: &DMatrix<f64>,
    plan: CostEstimate,
    level: f64,
    most: usize,
) -> Radiosity {
    let reflect = |mut light: DMatrix<f64>| {
        for mut column in light.column_iter_mut() {
            column.iter_mut().zip(albedo).for_each(|(l, a)| *l *= a);
        }
        light
    };
    let mut last = reflect(incident.clone());
    let mut light = last.clone();
    // No bounce keeps more of the flux than this; where it keeps all, what it
    // keeps in the end is the better guide.
    let bound = most_kept(exchange, albedo);
    let kept = if bound < 1.0 { bound } else { plan.radius };
    let left = |last: &DMatrix<f64>, light: &DMatrix<f64>| {
        let tail = kept / (1.0 - kept).max(LEAST_LOSS);
        let share = |(b, sum): (f64, f64)| {
            if sum > 0.0 {
                b * tail / (sum + b * tail)
            } else {
                0.0
            }
        };
        let columns = flux(exchange, last).into_iter().zip(flux(exchange, light));
        columns.map(share).fold(0.0, f64::max)
    };
    let (mut bounces, mut share_left) = (0, left(&last, &light));
    while bounces < most && share_left > level {
        last = reflect(exchange.irradiance(&last));
        light += &last;
        bounces += 1;
        share_left = left(&last, &light);
    }
    Radiosity {
        light,
        bounces,
        share_left,
        how: RadiosityMethod::Bounces,
        plan,
    }
}

/// The largest share of a patch's flux that one bounce keeps:
/// `max_q sum_p R_p F_qp`.
fn most_kept(exchange: &FormFactorMatrix, albedo: &[f64]) -> f64 {
    let albedo = DMatrix::from_column_slice(albedo.len(), 1, albedo);
    exchange.irradiance(&albedo).max().max(0.0)
}

/// Absolute flux that leaves all patches, by column.
fn flux(exchange: &FormFactorMatrix, light: &DMatrix<f64>) -> Vec<f64> {
    let column = |c: usize| {
        let pairs = light.column(c);
        let pairs = pairs.iter().zip(exchange.areas());
        pairs.map(|(l, a)| l.abs() * a).sum()
    };
    (0..light.ncols()).map(column).collect()
}
