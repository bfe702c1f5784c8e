//! Drift: how much brighter or darker each photograph is than the session's mean. Lamps
//! warm up, lenses and filters too, daylight changes.
//!
//! What changes slowly over the session is drift and is divided out; what is left
//! over is flicker. How bright a photograph is comes from
//! [`leave_one_out`](super::leave_one_out), or from repeated photographs of white where
//! there are too few others.

use super::cell_pixels::black;
use super::leave_one_out::LeaveOneOut;
use crate::format::sequence::Sequence;
use iltm_picture::statistics::median;
use nalgebra::DMatrix;

/// Part of the session that one place of the slow curve is fitted to, to each side.
const REACH: f64 = 0.2;

/// Photographs that one place of the curve needs.
const LEAST_SHOTS: usize = 10;

/// Rounds of giving less weight to what lies off the curve.
const ROUNDS: usize = 3;

/// Change over the session, in standard errors of the curve and as a share of the
/// light, below which a session is steady.
const CERTAIN: f64 = 4.0;
const STEADY: f64 = 0.004;

/// Misfit of a photograph from which something else than its pattern lit it or stood in its light, beside
/// so many times the session's usual misfit: good sessions' coarse stripes have up to .053, or 5.3 times.
const DISTURBED: f64 = 0.04;
const USUALLY: f64 = 4.0;

/// Change of the ambient light, of itself, below which it is steady.
const STEADY_DARK: f64 = 0.02;

/// Gains of all photographs of a capture.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Drift {
    /// Projector light by channel and shot, relative to the mean of white; empty
    /// where it is steady.
    gains: Vec<Vec<f64>>,
    /// Ambient light by channel and shot, relative to its mean; empty where it is
    /// steady.
    darks: Vec<Vec<f64>>,
}

impl Drift {
    /// What the projector light in a photograph is to be divided by.
    pub(crate) fn gain(&self, channel: usize, shot: usize) -> f64 {
        self.gains.get(channel).map_or(1.0, |gains| gains[shot])
    }

    /// Both of a photograph that was taken between the shots, by its index.
    pub(crate) fn between(&self, sequence: &Sequence, channel: usize, index: u32) -> (f64, f64) {
        let at = |of: &[Vec<f64>]| {
            of.get(channel).map_or(1.0, |values| {
                let times = sequence.shots.iter().map(|shot| f64::from(shot.index));
                let points: Vec<(f64, f64)> = times.zip(values.iter().copied()).collect();
                between(&points, f64::from(index))
            })
        };
        (at(&self.gains), at(&self.darks))
    }

    /// What the mean of black is to be multiplied by before it is subtracted.
    pub(crate) fn dark(&self, channel: usize, shot: usize) -> f64 {
        self.darks.get(channel).map_or(1.0, |darks| darks[shot])
    }
}

/// How steady a session was.
pub(crate) struct Steadiness {
    /// What is to be divided out.
    pub(crate) drift: Drift,
    /// One model a channel, if there were enough photographs.
    pub(crate) models: Vec<LeaveOneOut>,
    /// Shots whose brightness is known.
    pub(crate) shots: Vec<usize>,
    /// How much brighter than the session's mean each of them is, mean of channels.
    pub(crate) gains: Vec<f64>,
    /// The slow part of `gains`.
    pub(crate) slow: Vec<f64>,
    /// Standard error of each of `gains`.
    pub(crate) errors: Vec<f64>,
    /// Largest change of the slow part over the session, of the light.
    pub(crate) size: f64,
    /// Change of the ambient light over the session, of itself.
    pub(crate) dark: f64,
    /// How much brighter other photographs are than white lets expect, of the light.
    pub(crate) excess: Option<f64>,
}

impl Steadiness {
    /// How far each shot is from what the others let expect at its brightness, of the session's usual light,
    /// and from how much on something disturbed it.
    pub(crate) fn misfits(&self) -> (Vec<(usize, f64)>, f64) {
        let shots = self.models.first().map_or(&[][..], |model| &model.shots);
        let mut misfits = vec![0.0_f64; shots.len()];
        for model in &self.models {
            for (most, own) in misfits.iter_mut().zip(model.misfits()) {
                *most = most.max(own);
            }
        }
        let least = DISTURBED + USUALLY * median(misfits.clone()).unwrap_or(0.0);
        (shots.iter().copied().zip(misfits).collect(), least)
    }

    /// The same with the changes from photograph to photograph so many times as large.
    pub(crate) fn scaled(mut self, times: f64) -> Self {
        for gain in self.gains.iter_mut().chain(&mut self.slow) {
            *gain = 1.0 + times * (*gain - 1.0);
        }
        for error in &mut self.errors {
            *error *= times;
        }
        self
    }
}

/// Finds out how the light in all cells (`N x shots` a channel) changed.
pub(crate) fn assess(sequence: &Sequence, live: &[bool], channels: &[DMatrix<f64>]) -> Steadiness {
    let darks: Vec<Vec<f64>> = channels.iter().map(|l| dark_curve(sequence, l)).collect();
    let dark = (darks.iter().flatten()).fold(0.0, |most: f64, dark| most.max((dark - 1.0).abs()));
    let darks = if dark > STEADY_DARK {
        darks
    } else {
        Vec::new()
    };
    let mut drift = Drift {
        gains: Vec::new(),
        darks,
    };
    let models: Vec<LeaveOneOut> = (channels.iter().enumerate())
        .filter_map(|(channel, light)| {
            let ambient = black(sequence, light);
            let dark = |cell: usize, shot: usize| ambient[cell] * drift.dark(channel, shot);
            LeaveOneOut::fit(sequence, live, light, dark)
        })
        .collect();
    let curves: Vec<DriftCurve> = if models.len() == channels.len() {
        models
            .iter()
            .map(|model| DriftCurve::of_model(sequence, model))
            .collect()
    } else {
        (channels.iter().enumerate())
            .map(|(channel, light)| DriftCurve::of_white(sequence, light, channel, &drift))
            .collect()
    };
    let changes = curves.iter().any(|curve| curve.size > curve.least);
    if changes {
        drift.gains = curves.iter().map(|curve| curve.all.clone()).collect();
    }
    let mean = |of: fn(&DriftCurve) -> &Vec<f64>, at: usize| {
        curves.iter().map(|curve| of(curve)[at]).sum::<f64>() / curves.len() as f64
    };
    let shots = curves
        .first()
        .map_or_else(Vec::new, |curve| curve.shots.clone());
    let places = 0..shots.len();
    Steadiness {
        drift,
        gains: places.clone().map(|at| mean(|c| &c.gains, at)).collect(),
        slow: places.clone().map(|at| mean(|c| &c.slow, at)).collect(),
        errors: places.map(|at| mean(|c| &c.errors, at)).collect(),
        shots,
        size: curves.iter().map(|curve| curve.size).fold(0.0, f64::max),
        dark,
        excess: models.first().and_then(|_| {
            let all = curves.iter().map(|curve| curve.excess);
            all.max_by(|a, b| a.abs().total_cmp(&b.abs()))
        }),
        models,
    }
}

/// Gains of one channel over the session.
struct DriftCurve {
    shots: Vec<usize>,
    gains: Vec<f64>,
    errors: Vec<f64>,
    slow: Vec<f64>,
    /// The slow part at every shot of the capture.
    all: Vec<f64>,
    size: f64,
    /// Size that chance alone may have.
    least: f64,
    excess: f64,
}

impl DriftCurve {
    /// From the gains of a model. How bright white is against the others says
    /// whether light adds up and not how the session went, so that it is taken out.
    fn of_model(sequence: &Sequence, model: &LeaveOneOut) -> Self {
        let white = |shot: usize| sequence.white().shots.contains(&shot);
        let time = |shot: usize| f64::from(sequence.shots[shot].index);
        let points = |take_white: bool| -> Vec<(f64, f64)> {
            (model.shots.iter().zip(&model.gains))
                .filter(|(shot, _)| take_white || !white(**shot))
                .map(|(&shot, &gain)| (time(shot), gain))
                .collect()
        };
        let others = Smooth::new(points(false));
        let offsets = (points(true).into_iter())
            .zip(&model.shots)
            .filter(|(_, shot)| white(**shot))
            .map(|((time, gain), _)| gain / others.at(time).0);
        let offset = median(offsets.collect()).unwrap_or(1.0);
        let raw: Vec<f64> = (model.shots.iter().zip(&model.gains))
            .map(|(&shot, &gain)| if white(shot) { gain / offset } else { gain })
            .collect();
        let all_points = model.shots.iter().zip(&raw).map(|(&s, &g)| (time(s), g));
        Self::new(
            sequence,
            model.shots.clone(),
            &raw,
            model.errors.clone(),
            &Smooth::new(all_points.collect()),
            1.0 / offset - 1.0,
        )
    }

    /// From repeated photographs of white: their light over all cells.
    fn of_white(sequence: &Sequence, light: &DMatrix<f64>, channel: usize, drift: &Drift) -> Self {
        let ambient: f64 = black(sequence, light).iter().sum();
        let shots = sequence.white().shots.clone();
        let total = |&shot: &usize| light.column(shot).sum() - ambient * drift.dark(channel, shot);
        let totals: Vec<f64> = shots.iter().map(total).collect();
        let mean = totals.iter().sum::<f64>() / totals.len() as f64;
        let gains: Vec<f64> = totals.iter().map(|total| total / mean).collect();
        let time = |shot: usize| f64::from(sequence.shots[shot].index);
        let points = shots.iter().zip(&gains).map(|(&s, &g)| (time(s), g));
        let errors = vec![0.0; shots.len()];
        let smooth = Smooth::new(points.collect());
        Self::new(sequence, shots, &gains, errors, &smooth, 0.0)
    }

    fn new(
        sequence: &Sequence,
        shots: Vec<usize>,
        gains: &[f64],
        errors: Vec<f64>,
        smooth: &Smooth,
        excess: f64,
    ) -> Self {
        let time = |shot: usize| f64::from(sequence.shots[shot].index);
        let (mut all, mut error) = (Vec::new(), 0.0_f64);
        for shot in 0..sequence.shots.len() {
            let (value, uncertain) = smooth.at(time(shot));
            all.push(value);
            error = error.max(uncertain);
        }
        // Relative to the mean of white, whose light the flood photograph is.
        let white = &sequence.white().shots;
        let level = white.iter().map(|&shot| all[shot]).sum::<f64>() / white.len() as f64;
        for value in &mut all {
            *value /= level;
        }
        let high = all.iter().copied().fold(f64::MIN, f64::max);
        let low = all.iter().copied().fold(f64::MAX, f64::min);
        Self {
            gains: gains.iter().map(|gain| gain / level).collect(),
            errors,
            slow: shots.iter().map(|&shot| all[shot]).collect(),
            shots,
            all,
            size: high - low,
            least: STEADY + CERTAIN * error,
            excess,
        }
    }
}

/// Ambient light over the session relative to its mean, at every shot: straight
/// between the photographs of black.
fn dark_curve(sequence: &Sequence, light: &DMatrix<f64>) -> Vec<f64> {
    let time = |shot: usize| f64::from(sequence.shots[shot].index);
    let total = |&shot: &usize| (time(shot), light.column(shot).sum());
    let points: Vec<(f64, f64)> = sequence.black.iter().map(total).collect();
    let mean = points.iter().map(|p| p.1).sum::<f64>() / points.len().max(1) as f64;
    let at = |shot: usize| {
        if mean > 0.0 {
            between(&points, time(shot)) / mean
        } else {
            1.0
        }
    };
    (0..sequence.shots.len()).map(at).collect()
}

/// Straight lines through points that are ordered by their first coordinate.
fn between(points: &[(f64, f64)], x: f64) -> f64 {
    let after = points.partition_point(|p| p.0 <= x);
    match (points.get(after.wrapping_sub(1)), points.get(after)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0),
        (Some(a), None) => a.1,
        (None, Some(b)) => b.1,
        (None, None) => 0.0,
    }
}

/// A slow curve through points: straight lines fitted around each place (Cleveland,
/// *Robust locally weighted regression*, J. American Statistical Association 1979).
struct Smooth {
    points: Vec<(f64, f64)>,
    robust: Vec<f64>,
    reach: f64,
    scatter: f64,
}

impl Smooth {
    fn new(points: Vec<(f64, f64)>) -> Self {
        let first = points.first().map_or(0.0, |p| p.0);
        let span = points.last().map_or(0.0, |p| p.0) - first;
        let each = span / points.len().max(1) as f64;
        let reach = (REACH * span).max(each * LEAST_SHOTS as f64);
        let mut smooth = Self {
            robust: vec![1.0; points.len()],
            points,
            reach,
            scatter: 0.0,
        };
        for _ in 0..ROUNDS {
            let off: Vec<f64> = (smooth.points.iter())
                .map(|&(x, y)| y - smooth.at(x).0)
                .collect();
            let sizes = off.iter().map(|off| off.abs()).collect();
            let scatter = 1.4826 * median(sizes).unwrap_or(0.0);
            smooth.scatter = scatter;
            let weight = |off: &f64| {
                let far = off / (4.0 * scatter).max(1e-9);
                if far.abs() < 1.0 {
                    (1.0 - far * far).powi(2)
                } else {
                    0.0
                }
            };
            smooth.robust = off.iter().map(weight).collect();
        }
        smooth
    }

    /// The curve at a place, and its standard error.
    fn at(&self, x: f64) -> (f64, f64) {
        let (mut s, mut sx, mut sxx, mut sy, mut sxy, mut ss) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (&(px, y), robust) in self.points.iter().zip(&self.robust) {
            let near = ((px - x) / self.reach.max(1e-9)).abs();
            if near >= 1.0 {
                continue;
            }
            let weight = robust * (1.0 - near.powi(3)).powi(3);
            let dx = px - x;
            s += weight;
            ss += weight * weight;
            sx += weight * dx;
            sxx += weight * dx * dx;
            sy += weight * y;
            sxy += weight * dx * y;
        }
        if s <= 0.0 {
            return (between(&self.points, x), self.scatter);
        }
        let determinant = s * sxx - sx * sx;
        let straight = determinant > 1e-6 * s * sxx && self.points.len() > 2;
        let value = if straight {
            (sxx * sy - sx * sxy) / determinant
        } else {
            sy / s
        };
        // A line's end is twice as uncertain as a mean.
        (value, 2.0 * self.scatter * ss.sqrt() / s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_curve_follows_a_bend_and_passes_by_outliers() {
        let truth = |x: f64| 1.0 + 0.05 * (x / 100.0).powi(2);
        let wrong = |x: usize| if x % 20 == 7 { 0.3 } else { 0.0 };
        let points = (0..100).map(|x| (x as f64, truth(x as f64) + wrong(x)));
        let smooth = Smooth::new(points.collect());
        for x in 0..100 {
            let x = f64::from(x);
            assert!((smooth.at(x).0 - truth(x)).abs() < 1.5e-3, "{x}");
        }
    }

    #[test]
    fn ambient_light_is_straight_between_photographs_of_black() {
        let points = [(1.0, 2.0), (5.0, 4.0)];
        assert!((between(&points, 0.0) - 2.0).abs() < 1e-12);
        assert!((between(&points, 2.0) - 2.5).abs() < 1e-12);
        assert!((between(&points, 9.0) - 4.0).abs() < 1e-12);
    }
}
