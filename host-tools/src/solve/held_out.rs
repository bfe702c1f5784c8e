//! Photographs that a solve does not see, to judge it by.
//!
//! The misfit is in observed light: how far the photograph that an inverse
//! predicts, `T p`, is from the one taken. Misfit in projected light would weigh
//! the noise by the inverse's own gains.

use super::forward::Inverse;
use super::prepare::Prepared;
use super::report::Prediction;
use crate::capture::Role;
use nalgebra::DMatrix;

/// One Bernoulli photograph in so many is held out.
const EVERY: usize = 5;
/// With fewer held-out photographs than this the choice would be chance.
const LEAST: usize = 4;

/// Which photographs to hold out and which to solve from, by index.
#[derive(Clone, Debug)]
pub(super) struct Split {
    pub(super) held_out: Vec<usize>,
    pub(super) solved: Vec<usize>,
}

impl Split {
    /// `None` if there are too few Bernoulli photographs to spare any.
    pub(super) fn new(prepared: &Prepared) -> Option<Self> {
        let bernoulli = prepared.with_role(|role| role == Role::Bernoulli);
        let held_out: Vec<usize> = bernoulli
            .into_iter()
            .skip(EVERY / 2)
            .step_by(EVERY)
            .collect();
        if held_out.len() < LEAST {
            return None;
        }
        let solved = (0..prepared.roles.len())
            .filter(|k| !held_out.contains(k))
            .collect();
        Some(Self { held_out, solved })
    }
}

/// Relative misfit `||T p - c|| / ||c||` over all channels of the photographs
/// `chosen`; infinite if an inverse has no forward transport.
pub(super) fn misfit(prepared: &Prepared, inverses: &[Inverse], chosen: &[usize]) -> f64 {
    let patterns = prepared.patterns.select_columns(chosen);
    let (mut difference, mut total) = (0.0, 0.0);
    for (light, inverse) in prepared.light.iter().zip(inverses) {
        let observed = light.select_columns(chosen);
        let Some(predicted) = inverse.light(&patterns) else {
            return f64::INFINITY;
        };
        difference += (predicted - &observed).norm_squared();
        total += observed.norm_squared();
    }
    (difference / total).sqrt()
}

/// What the photographs `chosen` say of projecting with `inverses`, with the
/// flood photograph alone, and with nothing.
pub(super) fn predict(prepared: &Prepared, inverses: &[Inverse], chosen: &[usize]) -> Prediction {
    let patterns = prepared.patterns.select_columns(chosen);
    let observed: Vec<_> = prepared
        .light
        .iter()
        .map(|c| c.select_columns(chosen))
        .collect();
    Prediction {
        uncompensated: wanted_error(&observed, |_| Some(patterns.clone())),
        gain_only: wanted_error(&observed, |channel| {
            Some(flood_lit(prepared, channel, &patterns))
        }),
        compensated: wanted_error(&observed, |channel| inverses[channel].light(&patterns)),
    }
}

/// `||s c - d|| / ||d||` with the best scale `s`, one for all channels: a
/// projector too dim or too bright overall is not an error of compensation.
fn wanted_error(observed: &[DMatrix<f64>], wanted: impl Fn(usize) -> Option<DMatrix<f64>>) -> f64 {
    let (mut both, mut seen, mut asked) = (0.0, 0.0, 0.0);
    for (channel, observed) in observed.iter().enumerate() {
        let Some(wanted) = wanted(channel) else {
            return f64::INFINITY;
        };
        both += observed.dot(&wanted);
        seen += observed.norm_squared();
        asked += wanted.norm_squared();
    }
    (1.0 - both * both / (seen * asked)).max(0.0).sqrt()
}

/// What a pattern would show if every cell only dimmed its own light as it does
/// in the flood photograph.
fn flood_lit(prepared: &Prepared, channel: usize, patterns: &DMatrix<f64>) -> DMatrix<f64> {
    let white = prepared.with_role(|role| role == Role::White);
    let light = &prepared.light[channel];
    let flood = if white.is_empty() {
        // As much light as all photographs together imply.
        light.column_sum() / prepared.patterns.column_sum().max().max(1.0)
    } else {
        light.select_columns(&white).column_mean()
    };
    let mut lit = patterns.clone();
    for mut column in lit.column_iter_mut() {
        column.component_mul_assign(&flood);
    }
    lit
}
