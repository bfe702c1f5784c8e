//! Light multiplexing: one light at a time, and half of the lights at a time by the rows of an
//! S-matrix (Hadamard).

use super::Acquisition;
use crate::{Acquired, Citation, Description, Rig, Unfit};
use nalgebra::DMatrix;

/// Lights one cell after the other: each photograph is a column of `T`.
#[derive(Clone, Copy, Debug)]
pub struct BruteForce;

impl Acquisition for BruteForce {
    fn description(&self) -> Description {
        Description {
            name: "one light at a time".to_owned(),
            source: Citation::INVERSE_LIGHT_TRANSPORT,
            how: "A photograph for each cell, lit alone: nothing is assumed, and every photograph \
                is dark, so that the camera's reading noise counts most.",
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let lit = rig.live_cells();
        let cells = rig.grid().cells();
        let mut patterns = DMatrix::zeros(cells, lit.len());
        for (photograph, cell) in lit.iter().enumerate() {
            patterns[(*cell, photograph)] = 1.0;
        }
        let light = rig.photograph(&patterns);
        let mut transport = DMatrix::zeros(cells, cells);
        for (column, cell) in light.column_iter().zip(&lit) {
            transport.set_column(*cell, &column);
        }
        Ok(Acquired::Forward(transport))
    }
}

/// Multiplexing by the S-matrix of quadratic residues.
///
/// For a prime `p = 3 mod 4` the circulant `S` of the quadratic residues and zero,
/// `p x p`, has `(p + 1) / 2` ones in each row, and `S^-1 = 2 / (p + 1) (2 S^T - J)`,
/// `J` all ones. Every photograph `C = T S` shows about half of the lights, and
/// `T = C S^-1` has the camera's noise `2 sqrt(p) / (p + 1)` times. `p` is the smallest
/// that is no smaller than the number of live cells; lights beyond them stay dark.
#[derive(Clone, Copy, Debug)]
pub struct Hadamard;

impl Acquisition for Hadamard {
    fn description(&self) -> Description {
        Description {
            name: "Hadamard multiplexing".to_owned(),
            source: Citation {
                authors: "Schechner, Nayar, Belhumeur",
                title: "Multiplexing for Optimal Lighting",
                venue: "IEEE Transactions on Pattern Analysis and Machine Intelligence",
                year: 2007,
            },
            how: "As many photographs as cells and a few more, each with half of the cells lit, \
                told apart by arithmetic: nothing is assumed, and reading noise shrinks by about \
                half the square root of the number of cells; noise of the light itself grows.",
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let lit = rig.live_cells();
        let cells = rig.grid().cells();
        let code = code(order(lit.len()));
        let size = code.len();
        let patterns = spread(&lit, cells, size, |light, photograph| {
            f64::from(u8::from(code[(light + photograph) % size]))
        });
        // 2 S^T - J: light j's sign in photograph k.
        let signs = spread(&lit, cells, size, |light, photograph| {
            if code[(light + photograph) % size] {
                1.0
            } else {
                -1.0
            }
        });
        let scale = 2.0 / (size + 1) as f64;
        let light = rig.photograph(&patterns);
        Ok(Acquired::Forward(light * signs.transpose() * scale))
    }
}

/// Entries by light and photograph, brought to `N x p`; zero for cells not `lit`.
fn spread(
    lit: &[usize],
    cells: usize,
    photographs: usize,
    entry: impl Fn(usize, usize) -> f64,
) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(cells, photographs);
    for (light, cell) in lit.iter().enumerate() {
        for photograph in 0..photographs {
            matrix[(*cell, photograph)] = entry(light, photograph);
        }
    }
    matrix
}

/// The smallest prime of the form `4 k + 3` that is no smaller than `lights`.
fn order(lights: usize) -> usize {
    let prime = |number: usize| {
        (2..number)
            .take_while(|divisor| divisor * divisor <= number)
            .all(|divisor| !number.is_multiple_of(divisor))
    };
    (3..)
        .step_by(4)
        .find(|number| *number >= lights && prime(*number))
        .unwrap_or(3)
}

/// First row of the S-matrix: zero and the quadratic residues modulo a prime.
fn code(prime: usize) -> Vec<bool> {
    let mut code = vec![false; prime];
    for root in 0..prime {
        code[root * root % prime] = true;
    }
    code
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::{forward, m_scene, rig};
    use iltm_capture::NoiseModel;
    use iltm_runtime::Grid;

    /// `S S^T = (p + 1) / 4 (I + J)`, the definition of an S-matrix.
    #[test]
    fn quadratic_residues_give_an_s_matrix() {
        for (lights, prime) in [(1, 3), (4, 7), (8, 11), (48, 59), (273, 283)] {
            assert_eq!(order(lights), prime);
            let code = code(prime);
            let s = DMatrix::from_fn(prime, prime, |i, j| {
                f64::from(u8::from(code[(i + j) % prime]))
            });
            let quarter = (prime + 1) as f64 / 4.0;
            let mut wanted = DMatrix::from_element(prime, prime, quarter);
            wanted.fill_diagonal(2.0 * quarter);
            assert!((&s * s.transpose() - wanted).amax() < 1e-9);
        }
    }

    #[test]
    fn without_noise_it_is_exact_and_takes_a_prime_number_of_photographs() {
        for (rows, cols, photographs) in [(1, 1, 3), (3, 5, 19), (6, 8, 59)] {
            let grid = Grid::new(rows, cols).unwrap();
            let (transport, live) = m_scene(grid);
            let mut rig = rig(grid, &transport, &live, NoiseModel::default());
            let found = forward(&Hadamard, &mut rig);
            assert!((found - &transport).amax() < 1e-13);
            assert_eq!(rig.photographs(), photographs);
        }
    }

    /// Mean square error of a method's transport, over many noises.
    fn variance(method: &dyn Acquisition, noise: NoiseModel) -> (f64, f64) {
        let grid = Grid::new(6, 8).unwrap();
        let (transport, live) = m_scene(grid);
        let mut rig = rig(grid, &transport, &live, noise);
        let mut sum = 0.0;
        for _ in 0..10 {
            sum += (forward(method, &mut rig) - &transport).norm_squared();
        }
        (sum, live.iter().filter(|live| **live).count() as f64)
    }

    /// The gain in signal to noise is `(p + 1) / (2 sqrt(p))` (Harwit, Sloane, *Hadamard
    /// Transform Optics*, 1979).
    #[test]
    fn against_reading_noise_it_gains_what_the_theory_says() {
        let noise = NoiseModel {
            shot: 0.0,
            floor: 1e-6,
        };
        let (one_by_one, _) = variance(&BruteForce, noise);
        let (multiplexed, _) = variance(&Hadamard, noise);
        let gain = (one_by_one / multiplexed).sqrt();
        // p = 59; 23,040 samples.
        assert!((gain / (60.0 / (2.0 * 59_f64.sqrt())) - 1.0).abs() < 0.03);
    }

    /// The variance of a photograph is `shot` times its light; over all lights that sums
    /// to the flood's one by one, and to `2 n / (p + 1)` times that multiplexed.
    #[test]
    fn against_the_noise_of_light_itself_it_loses() {
        let noise = NoiseModel {
            shot: 1e-6,
            floor: 0.0,
        };
        let (one_by_one, _) = variance(&BruteForce, noise);
        let (multiplexed, live) = variance(&Hadamard, noise);
        let loss = multiplexed / one_by_one;
        assert!(loss > 1.0);
        assert!((loss / (2.0 * live / 60.0) - 1.0).abs() < 0.1, "{loss}");
    }

    #[test]
    fn without_noise_every_column_is_the_transports() {
        let grid = Grid::new(2, 2).unwrap();
        let transport = DMatrix::from_fn(4, 4, |i, j| 1.0 / (1 + i + 2 * j) as f64);
        let mut rig = rig(grid, &transport, &[true; 4], NoiseModel::default());
        let found = BruteForce.acquire(&mut rig).unwrap();
        assert!(matches!(found, Acquired::Forward(found) if found == transport));
        assert_eq!(rig.photographs(), 4);
    }
}
