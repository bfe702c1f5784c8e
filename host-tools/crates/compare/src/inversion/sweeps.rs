//! Jacobi and Gauss-Seidel sweeps, the inverse counterparts of gathering radiosity.

use super::live::{LiveTransport, convergence, finite, spectral_radius};
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Unfit};
use nalgebra::{DMatrix, DVector};

/// Which values of the other cells a sweep uses.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SweepOrder {
    /// Those of the sweep before.
    Jacobi,
    /// The newest.
    GaussSeidel,
}

/// So many sweeps over all cells, from what light compensation without interreflection
/// would show.
#[derive(Clone, Copy, Debug)]
pub struct Sweeps {
    /// Which values a sweep uses.
    pub order: SweepOrder,
    /// How many there are.
    pub count: usize,
}

impl Inversion for Sweeps {
    fn description(&self) -> Description {
        let name = match self.order {
            SweepOrder::Jacobi => "Jacobi",
            SweepOrder::GaussSeidel => "Gauss-Seidel",
        };
        Description {
            name: format!("{name}, sweeps {}", self.count),
            source: Citation {
                authors: "Bai, Chandraker, Ng, Ramamoorthi",
                title: "A Dual Theory of Inverse and Forward Light Transport",
                venue: "ECCV",
                year: 2010,
            },
            how: match self.order {
                SweepOrder::Jacobi => {
                    "Every cell corrects its input for the light that all others threw at it in \
                     the sweep before; starts from d / flood. From nothing it would be the Neumann \
                     series."
                }
                SweepOrder::GaussSeidel => {
                    "The same cell after cell, each with the newest inputs of the others; starts \
                     from d / flood."
                }
            },
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        live.own_light()?;
        let start = DMatrix::from_diagonal(&live.flood()?.map(f64::recip));
        let sweep = SweepSplit::new(&live.transport, self.order);
        let mut matrix = start;
        for _ in 0..self.count {
            matrix = sweep.next(&matrix)?;
        }
        let n = live.len() as f64;
        // With the reciprocals of the diagonal at hand.
        Ok(Inverted::matrix(
            live.whole(&finite(matrix)?),
            n + self.count as f64 * n * n,
            convergence(sweep.radius()),
        ))
    }
}

/// `T` split into what is solved for and what is moved to the other side.
struct SweepSplit {
    /// `D` or `D + L`.
    solved: DMatrix<f64>,
    /// `L + U` or `U`.
    moved: DMatrix<f64>,
}

impl SweepSplit {
    fn new(transport: &DMatrix<f64>, order: SweepOrder) -> Self {
        let solved = match order {
            SweepOrder::Jacobi => DMatrix::from_diagonal(&transport.diagonal()),
            SweepOrder::GaussSeidel => transport.lower_triangle(),
        };
        Self {
            moved: transport - &solved,
            solved,
        }
    }

    /// `M <- solved^-1 (I - moved M)`.
    fn next(&self, matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, Unfit> {
        let mut right = -(&self.moved * matrix);
        for cell in 0..right.nrows() {
            right[(cell, cell)] += 1.0;
        }
        self.solved
            .solve_lower_triangular(&right)
            .ok_or(Unfit::Singular)
    }

    fn radius(&self) -> f64 {
        let nothing = || DVector::zeros(self.solved.nrows());
        spectral_radius(self.solved.nrows(), |x| {
            let solved = self.solved.solve_lower_triangular(&(&self.moved * x));
            solved.unwrap_or_else(nothing)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    #[test]
    fn sweeps_converge_to_the_inverse_and_gauss_seidel_does_sooner() {
        let before = KnownScene::textured(6, 8);
        let error = |order, count| before.error(&Sweeps { order, count });
        for count in [1, 3, 8] {
            let (jacobi, newest) = (
                error(SweepOrder::Jacobi, count),
                error(SweepOrder::GaussSeidel, count),
            );
            assert!(newest < jacobi, "{count} sweeps: {newest} against {jacobi}");
        }
        assert!(error(SweepOrder::GaussSeidel, 60) < 1e-9);
        assert!(error(SweepOrder::Jacobi, 200) < 1e-6);
    }

    /// A symmetric positive definite system: Gauss-Seidel always converges (Golub, Van
    /// Loan, *Matrix Computations*, theorem 11.2.3), Jacobi only up to an albedo of 1/2.
    #[test]
    fn gauss_seidel_converges_on_a_sphere_where_jacobi_does_not() {
        let before = KnownScene::sphere(4, 5, 0.7);
        let radius = |order| SweepSplit::new(&before.transport, order).radius();
        assert!(radius(SweepOrder::Jacobi) > 1.0);
        assert!(radius(SweepOrder::GaussSeidel) < 1.0);
    }
}
