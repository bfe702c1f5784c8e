//! Exact inverse, and interreflection cancellation operators, which are as good.

use super::live::LiveTransport;
use super::{Inversion, Inverted, KnownTransport};
use crate::rig::live_cells;
use crate::{Citation, Description, Unfit};
use iltm_solve::inverted;
use nalgebra::DMatrix;

/// `T^-1` by LU factorisation.
#[derive(Clone, Copy, Debug)]
pub struct Exact;

impl Inversion for Exact {
    fn description(&self) -> Description {
        Description {
            name: "exact inverse".to_owned(),
            source: Citation {
                authors: "Golub, Van Loan",
                title: "Matrix Computations, section 3.2",
                venue: "Johns Hopkins University Press",
                year: 2013,
            },
            how: "LU factorisation of the transport between live cells: O(N^3) once, O(N^2) a \
                frame.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let inverse = inverted(known.transport, known.live).ok_or(Unfit::Singular)?;
        let live = live_cells(known.live).len() as f64;
        Ok(Inverted::matrix(inverse, live * live, String::new()))
    }
}

/// `C1 = F1 T^-1` with `F1 = diag(T^-1)^-1` takes a wanted picture to its direct light;
/// a gain for each cell, `F1^-1`, takes that to the projector's input.
#[derive(Clone, Copy, Debug)]
pub struct Cancellation;

impl Inversion for Cancellation {
    fn description(&self) -> Description {
        Description {
            name: "interreflection cancellation".to_owned(),
            source: Citation::INVERSE_LIGHT_TRANSPORT,
            how: "C1 = F1 T^-1 takes every bounce but the first out of a picture, with F1 the \
                inverse of the diagonal of T^-1 (Lambertian surfaces); then a gain for each cell. \
                As good as the inverse, and it gives the bounces one by one.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let inverse = inverted(known.transport, known.live).ok_or(Unfit::Singular)?;
        let gains = inverse.diagonal();
        let operator = operator(&inverse, known.live)?;
        let flood = known.transport.column_sum();
        let direct = &operator * &flood;
        let mut matrix = operator;
        for mut column in matrix.column_iter_mut() {
            column.component_mul_assign(&gains);
        }
        let n = live.len() as f64;
        // The diagonal of C1 is 1.
        Ok(Inverted::matrix(
            matrix,
            n * n,
            format!(
                "cancels {:.1} % of white's light",
                100.0 * (1.0 - direct.sum() / flood.sum())
            ),
        ))
    }
}

/// `C1`, `N x N`, zero rows of cells that are not live.
fn operator(inverse: &DMatrix<f64>, live: &[bool]) -> Result<DMatrix<f64>, Unfit> {
    let mut operator = inverse.clone();
    for (cell, mut row) in operator
        .row_iter_mut()
        .enumerate()
        .filter(|(i, _)| live[*i])
    {
        let gain = row[cell];
        if gain == 0.0 {
            return Err(Unfit::Condition(format!(
                "cell {cell} has no gain in the inverse, so no first bounce"
            )));
        }
        row /= gain;
    }
    Ok(operator)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;
    use iltm_runtime::Grid;
    use iltm_scene::coaxial::{CoaxialScene, Panels};
    use nalgebra::DVector;

    /// `T = (I - R F)^-1 R E`: the first bounce under a pattern is `R E p`.
    #[test]
    fn the_operator_leaves_the_first_bounce() {
        let grid = Grid::new(5, 8).unwrap();
        let scene =
            CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.3, 0.9, 2);
        let before = KnownScene::scene(&scene);
        let inverse = inverted(&before.transport, &before.live).unwrap();
        let cancel = operator(&inverse, &before.live).unwrap();
        let pattern = DVector::from_fn(40, |cell, _| (cell % 3) as f64 / 2.0);
        let first = cancel * (&before.transport * &pattern);
        let wanted = scene.albedo.component_mul(&pattern);
        assert!((first - &wanted).norm() < 1e-12 * wanted.norm());
    }

    #[test]
    fn cancellation_and_gains_are_the_inverse() {
        assert!(KnownScene::textured(5, 8).error(&Cancellation) < 1e-12);
    }

    /// Of a sphere's light under white, the part `r` is not direct.
    #[test]
    fn the_share_of_a_spheres_light_that_is_cancelled_is_its_albedo() {
        let before = KnownScene::sphere(3, 4, 0.7);
        // The diagonal form factor stays with the first bounce: 1/g = r / (1 - r/12).
        let wanted = 1.0 - 0.3 / (1.0 - 0.7 / 12.0);
        let said = Cancellation.invert(before.known()).unwrap().remark;
        assert_eq!(
            said,
            format!("cancels {:.1} % of white's light", 100.0 * wanted)
        );
    }
}
