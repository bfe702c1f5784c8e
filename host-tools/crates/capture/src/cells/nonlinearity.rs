//! Nonlinearity: why light does not add up, a curve that nobody declared, or brightness that
//! follows the picture.
//!
//! A curved response is one number for all photographs. A camera that exposes for
//! the picture, or a projector that dims its lamp for it, is one factor for each
//! photograph and the same in all cells. Whichever leaves less of the misfit over
//! is the cause. Camera and projector are told apart by ambient light, which only
//! the camera's factor changes.

use crate::devices::CameraFit;
use crate::format::sequence::Sequence;
use crate::photographs::sampled::{SIDE, Sampled};
use iltm_picture::DeviceResponse;
use iltm_picture::statistics::median;
use nalgebra::{DMatrix, Matrix2, Vector2};

/// What must be left of a misfit at most for its cause to be found.
const EXPLAINED: f64 = 0.5;

/// Ambient light, of white's, from which it tells camera and projector apart.
const LEAST_AMBIENT: f64 = 0.005;

/// What one cause may leave of what another one leaves to be preferred.
const CLEARLY: f64 = 0.5;

/// What brightness that follows the picture may leave of what a curve leaves to be believed though
/// its factors scatter: in a deep scene wide stripes light far more of it than narrow ones.
const FAR_BETTER: f64 = 0.25;

/// Misfit of the declared response, of the best one's, from which the best one is it whatever
/// else may explain a part.
const PLAINLY: f64 = 5.0;

/// How many times its scatter the brightness of pairs must be off white's.
const STEADY: f64 = 3.0;

/// Light of lit cells, in that under white, that white itself cannot have.
const OUTSHINE: f64 = 1.03;

/// Why light does not add up.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Nonlinearity {
    /// The light that was read follows this power of the true light's inverse.
    Curve {
        /// Light would add up if it were raised to this power.
        gamma: f64,
    },
    /// The camera's exposure follows the picture.
    Exposure,
    /// The projector's brightness follows the picture.
    Projector,
    /// One of the last two.
    Either,
    /// A curve of this power, or brightness that follows the picture: both explain it.
    CurveOrExposure {
        /// Light would add up if it were raised to this power.
        gamma: f64,
    },
    /// None of these.
    Unknown,
}

impl Nonlinearity {
    /// The cause once it is known whether single pixels add up better with another curve than
    /// the declared one, whatever the exposure.
    pub(crate) const fn given(self, curve: CurveOfPixels) -> Self {
        match (self, curve) {
            (Self::CurveOrExposure { gamma }, CurveOfPixels::Other | CurveOfPixels::Plain(_)) => {
                Self::Curve { gamma }
            }
            (Self::Curve { gamma }, CurveOfPixels::Declared)
            | (Self::Exposure, CurveOfPixels::Plain(gamma)) => Self::CurveOrExposure { gamma },
            (cause, _) => cause,
        }
    }

    /// Whether it says why brightness differs from photograph to photograph.
    pub(crate) const fn is_known(self) -> bool {
        !matches!(self, Self::Unknown)
    }
}

/// What single pixels say of the camera's curve.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum CurveOfPixels {
    /// Too little to tell one from another.
    Unsaid,
    /// Nothing against the declared one.
    Declared,
    /// Another one adds up better.
    Other,
    /// Another one adds up, the light that was read raised to this power, and the declared one
    /// does not.
    Plain(f64),
}

impl CurveOfPixels {
    /// By what was recovered from pixels.
    pub(crate) fn of(fit: Option<&CameraFit>) -> Self {
        let Some(fit) = fit.filter(|fit| fit.tells()) else {
            return Self::Unsaid;
        };
        if !fit.contradicts() {
            return Self::Declared;
        }
        let plain = matches!(fit.best, DeviceResponse::Known(_));
        if plain && fit.declared_misfit > PLAINLY * fit.best_misfit {
            Self::Plain(fit.power())
        } else {
            Self::Other
        }
    }
}

/// Light of all live cells in white, black and the photographs of each pair.
struct Pairs {
    white: Vec<f64>,
    black: Vec<f64>,
    both: Vec<(Vec<f64>, Vec<f64>)>,
}

/// Finds the cause; `channels` are the light of all cells in all photographs,
/// `N x shots` each, black included.
pub(crate) fn find(
    sequence: &Sequence,
    live: &[bool],
    channels: &[DMatrix<f64>],
    sampled: &Sampled,
) -> Nonlinearity {
    let brightest = channels.iter().max_by(|a, b| a.sum().total_cmp(&b.sum()));
    let Some(light) = brightest else {
        return Nonlinearity::Unknown;
    };
    let mean = |shots: &[usize]| -> Vec<f64> {
        let share = 1.0 / shots.len().max(1) as f64;
        (0..live.len())
            .filter(|&cell| live[cell])
            .map(|cell| share * shots.iter().map(|&shot| light[(cell, shot)]).sum::<f64>())
            .collect()
    };
    let views = &sequence.views;
    let pairs = Pairs {
        white: mean(&sequence.white().shots),
        black: mean(&sequence.black),
        both: (sequence.code_pairs().into_iter())
            .map(|(a, b)| (mean(&views[a].shots), mean(&views[b].shots)))
            .collect(),
    };
    if pairs.both.is_empty() {
        return Nonlinearity::Unknown;
    }
    let before = pairs.misfit(1.0);
    let (gamma, curved) = pairs.best_gamma();
    let (factors, followed) = pairs.best_factors();
    let middle = median(factors.clone()).unwrap_or(1.0);
    let off = median(factors.iter().map(|f| (f - middle).abs()).collect()).unwrap_or(0.0);
    let steady = (middle - 1.0).abs() > STEADY * off;
    let follows = followed < EXPLAINED * before && (steady || followed < FAR_BETTER * curved);
    let bent = curved < EXPLAINED * before;
    // Where the scene is even a curve that brightens explains as much as a factor does; but it
    // leaves nothing brighter than white.
    let alike = middle > 1.0 && bent && follows;
    if pairs.outshine() || follows && !alike && followed < 1.2 * curved {
        ambient(sequence, sampled)
    } else if alike && curved > CLEARLY * followed {
        Nonlinearity::CurveOrExposure { gamma }
    } else if bent {
        Nonlinearity::Curve { gamma }
    } else {
        Nonlinearity::Unknown
    }
}

impl Pairs {
    /// Whether most photographs are brighter than white where they are lit: no curve
    /// makes less light look like more.
    fn outshine(&self) -> bool {
        let ratio = |light: &[f64]| {
            let lit = light
                .iter()
                .zip(&self.white)
                .filter(|(l, w)| *l > &(0.5 * *w));
            median(lit.map(|(light, white)| light / white).collect())
        };
        let each = self.both.iter().flat_map(|(a, b)| [ratio(a), ratio(b)]);
        let ratios: Vec<f64> = each.flatten().collect();
        let brighter = ratios.iter().filter(|ratio| **ratio > OUTSHINE).count();
        2 * brighter > ratios.len()
    }

    /// How far sums are off if all light is raised to a power, relative to white.
    fn misfit(&self, power: f64) -> f64 {
        let raise = |light: &f64| light.max(0.0).powf(power);
        let (mut off, mut all) = (0.0, 0.0);
        for (a, b) in &self.both {
            for (cell, (a, b)) in a.iter().zip(b).enumerate() {
                let (white, black) = (raise(&self.white[cell]), raise(&self.black[cell]));
                off += (raise(a) + raise(b) - white - black).powi(2);
                all += (white - black).powi(2);
            }
        }
        (off / all.max(f64::MIN_POSITIVE)).sqrt()
    }

    /// The power with the least misfit.
    fn best_gamma(&self) -> (f64, f64) {
        let powers = (-40..=40).map(|k| (f64::from(k) * 0.04).exp());
        let tried = powers.map(|power| (power, self.misfit(power)));
        tried
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((1.0, f64::INFINITY))
    }

    /// A factor for each photograph, and the misfit that they leave.
    fn best_factors(&self) -> (Vec<f64>, f64) {
        let (mut factors, mut off, mut all) = (Vec::new(), 0.0, 0.0);
        for (a, b) in &self.both {
            let row = |cell: usize| {
                let black = self.black[cell];
                let known = Vector2::new(a[cell] - black, b[cell] - black);
                (known, self.white[cell] - black)
            };
            let rows = (0..self.white.len()).map(row);
            let Some((solved, _)) = least_squares(rows.clone()) else {
                continue;
            };
            for (known, white) in rows {
                off += (known.dot(&solved) - white).powi(2);
                all += white * white;
            }
            factors.extend(solved.iter().map(|share| 1.0 / share.max(1e-3)));
        }
        (factors, (off / all.max(f64::MIN_POSITIVE)).sqrt())
    }
}

/// The factors of two known numbers that give the sums best, and the inverse of the normal
/// equations; `None` if these are singular.
fn least_squares(
    rows: impl Iterator<Item = (Vector2<f64>, f64)>,
) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (known, sum) in rows {
        normal += known * known.transpose();
        right += known * sum;
    }
    let inverse = normal.try_inverse()?;
    Some((inverse * right, inverse))
}

/// Whether ambient light follows the picture too. Sums of pairs are compared with
/// white's light and with black's over squares of the whole photograph: one factor
/// for each.
fn ambient(sequence: &Sequence, sampled: &Sampled) -> Nonlinearity {
    let white = by_square(&sampled.mean(&sequence.white().shots));
    let black = by_square(&sampled.mean(&sequence.black));
    let mut rows = Vec::new();
    for (a, b) in sequence.code_pairs() {
        let one = by_square(&sampled.mean(&sequence.views[a].shots));
        let other = by_square(&sampled.mean(&sequence.views[b].shots));
        rows.extend((0..white.len()).map(|square| {
            let known = Vector2::new(white[square] - black[square], 2.0 * black[square]);
            (known, one[square] + other[square])
        }));
    }
    let Some((factors, inverse)) = least_squares(rows.iter().copied()) else {
        return Nonlinearity::Either;
    };
    let left: f64 = rows
        .iter()
        .map(|(k, sum)| (k.dot(&factors) - sum).powi(2))
        .sum();
    let error = (left / rows.len().max(1) as f64 * inverse[(1, 1)]).sqrt();
    let followed = (factors[1] - 1.0) / (factors[0] - 1.0);
    // A camera that exposes for the picture exposes black longest of all: then black has
    // more ambient light than the pairs, or looks like white.
    let total = |squares: &[f64]| squares.iter().sum::<f64>();
    let share = total(&black) / total(&white);
    // And it makes no picture darker that is darker than white.
    let longest_for_black = followed < -0.2 && share > LEAST_AMBIENT;
    if factors[0] > 1.0 && (share > 0.5 || longest_for_black) {
        Nonlinearity::Exposure
    } else if share < LEAST_AMBIENT {
        // Too little ambient light to see what it follows.
        Nonlinearity::Either
    } else if !followed.is_finite() || error > 0.1 * (factors[0] - 1.0).abs() {
        Nonlinearity::Either
    } else if followed > 0.6 && factors[0] > 1.0 {
        Nonlinearity::Exposure
    } else if followed < 0.4 {
        Nonlinearity::Projector
    } else {
        Nonlinearity::Either
    }
}

/// Sum of each square of sampled pixels.
fn by_square(values: &[f32]) -> Vec<f64> {
    let sum = |square: &[f32]| square.iter().map(|v| f64::from(*v)).sum();
    values.chunks(SIDE * SIDE).map(sum).collect()
}
