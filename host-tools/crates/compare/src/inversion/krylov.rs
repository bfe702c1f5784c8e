//! Krylov methods (optical GMRES) with photographs as the matrix.

use super::{Inversion, Inverted, KnownTransport};
use crate::{Answer, Citation, Description, Rig, Unfit};
use nalgebra::{DMatrix, DVector};
use std::cell::RefCell;

/// Iterations after which the singular values of a small matrix are given up.
const SVD_SWEEPS: usize = 10_000;

/// GMRES whose products `T x` are photographs of the rig: no transport is known, every
/// frame takes photographs of its own.
#[derive(Clone, Copy, Debug)]
pub struct Optical {
    /// Steps, at least 1: dimension of the Krylov space.
    pub steps: usize,
    /// Whether inputs are scaled by one photograph of white first (right
    /// preconditioning), which the original does not do.
    pub scaled: bool,
}

impl Inversion for Optical {
    fn description(&self) -> Description {
        let scaled = if self.scaled { ", scaled by flood" } else { "" };
        Description {
            name: format!("optical GMRES, steps {}{scaled}", self.steps),
            source: Citation {
                authors: "O'Toole, Kutulakos",
                title: "Optical Computing for Fast Light Transport Analysis",
                venue: "ACM Transactions on Graphics (SIGGRAPH Asia)",
                year: 2010,
            },
            how: "The scene itself multiplies: each step projects a pattern (its positive and its \
                negative part, scaled to the projector's range) and photographs it; the input is \
                the combination of patterns whose light comes nearest. Needs a still picture and \
                new photographs for each.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = super::live::LiveTransport::new(&known)?;
        let mut rig = known.rig.clone();
        let scale = if self.scaled {
            let white = rig.photograph(&DMatrix::from_element(known.live.len(), 1, 1.0));
            let gain = |light: f64| if light > 0.0 { light.recip() } else { 0.0 };
            white.column(0).map(gain)
        } else {
            DVector::from_element(known.live.len(), 1.0)
        };
        let lit = known.live.iter().map(|live| f64::from(u8::from(*live)));
        let lit = DVector::from_iterator(known.live.len(), lit);
        let scale = scale.component_mul(&lit);
        let steps = self.steps.min(live.len());
        let rig = RefCell::new(rig);
        Ok(Inverted {
            answer: Answer::Frames(Box::new(move |wanted| {
                let mut rig = rig.borrow_mut();
                let apply = |x: &DVector<f64>| {
                    product(&mut rig, &x.component_mul(&scale)).component_mul(&lit)
                };
                gmres(apply, &wanted.component_mul(&lit), steps).component_mul(&scale)
            })),
            multiplications: None,
            // The first pattern, wanted light, has no negative part.
            photographs: 2 * steps - 1,
            remark: String::new(),
        })
    }
}

/// `T x` by one photograph for each sign that occurs in `x`.
fn product(rig: &mut Rig, x: &DVector<f64>) -> DVector<f64> {
    let mut light = DVector::zeros(x.len());
    for sign in [1.0, -1.0] {
        let part = x.map(|value| (sign * value).max(0.0));
        let brightest = part.max();
        if brightest > 0.0 {
            let pattern = DMatrix::from_column_slice(x.len(), 1, (part / brightest).as_slice());
            light += rig.photograph(&pattern).column(0) * (sign * brightest);
        }
    }
    light
}

/// The `x` of the Krylov space of `steps` dimensions whose `A x` is nearest to `wanted`
/// (Saad, Schultz, *GMRES: A Generalized Minimal Residual Algorithm for Solving
/// Nonsymmetric Linear Systems*, SISSC 1986).
fn gmres(
    mut apply: impl FnMut(&DVector<f64>) -> DVector<f64>,
    wanted: &DVector<f64>,
    steps: usize,
) -> DVector<f64> {
    let norm = wanted.norm();
    let nothing = DVector::zeros(wanted.len());
    if norm == 0.0 {
        return nothing;
    }
    let mut basis = vec![wanted / norm];
    let mut hessenberg = DMatrix::zeros(steps + 1, steps);
    for step in 0..steps {
        let mut next = apply(&basis[step]);
        let before = next.norm();
        // Twice, so that rounding leaves no part of the others.
        for _ in 0..2 {
            for (row, vector) in basis.iter().enumerate() {
                let along = vector.dot(&next);
                next.axpy(-along, vector, 1.0);
                hessenberg[(row, step)] += along;
            }
        }
        let left = next.norm();
        if left <= 1e-12 * before || !left.is_normal() {
            // Nothing new to see: what is there is exact.
            break;
        }
        hessenberg[(step + 1, step)] = left;
        basis.push(next / left);
    }
    let used = basis.len().min(steps);
    let mut right = DVector::zeros(steps + 1);
    right[0] = norm;
    let square = hessenberg.columns(0, used).into_owned();
    if square.iter().any(|value| !value.is_finite()) {
        return nothing;
    }
    let largest = square.amax();
    let values = square.try_svd(true, true, f64::EPSILON, SVD_SWEEPS);
    // Directions in which all light is dark are left alone.
    match values.map(|svd| svd.solve(&right, 1e-12 * largest)) {
        Some(Ok(weights)) => basis
            .iter()
            .zip(weights.iter())
            .fold(nothing, |sum, (vector, weight)| sum + vector * *weight),
        _ => nothing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;
    use iltm_solve::inverted;

    fn wanted(cells: usize) -> DVector<f64> {
        DVector::from_fn(cells, |cell, _| 0.2 + 0.1 * ((cell * 7) % 5) as f64)
    }

    /// A Krylov space of `N` dimensions holds every answer.
    #[test]
    fn without_noise_as_many_steps_as_cells_are_exact() {
        let before = KnownScene::textured(4, 6);
        let wanted = wanted(24);
        let exact = inverted(&before.transport, &before.live).unwrap() * &wanted;
        for scaled in [false, true] {
            let found = before.drive(&Optical { steps: 24, scaled }, &wanted);
            assert!((found - &exact).norm() < 1e-9 * exact.norm());
        }
    }

    /// A sphere's transport has two eigenvalues: two steps are enough.
    #[test]
    fn two_steps_are_exact_on_a_sphere() {
        let before = KnownScene::sphere(3, 4, 0.8);
        let wanted = wanted(12);
        let (steps, scaled) = (2, false);
        let optical = Optical { steps, scaled };
        let drive = before.drive(&optical, &wanted);
        assert!((&before.transport * drive - &wanted).norm() < 1e-12);
    }

    #[test]
    fn photographs_of_a_frame_are_those_that_are_counted() {
        let before = KnownScene::textured(4, 6);
        let (steps, scaled) = (3, false);
        let optical = Optical { steps, scaled };
        let counted = optical.invert(before.known()).unwrap().photographs;
        let mut rig = before.rig.clone();
        gmres(|x| product(&mut rig, x), &wanted(24), 3);
        assert_eq!(rig.photographs(), counted);
    }

    #[test]
    fn noise_is_in_every_product() {
        let wanted = wanted(24);
        let (steps, scaled) = (8, true);
        let optical = Optical { steps, scaled };
        let quiet = KnownScene::panels(4, 6);
        let noisy = KnownScene::panels(4, 6).noisy(1e-4);
        let error = |before: &KnownScene| {
            let light = &before.transport * before.drive(&optical, &wanted);
            (light - &wanted).norm() / wanted.norm()
        };
        assert!(error(&quiet) < 1e-3);
        assert!(error(&noisy) > 10.0 * error(&quiet));
        assert!(error(&noisy) < 0.2);
    }
}
