//! Probing: the diagonal of the inverse from a few solves.

use super::gain_only::diagonal;
use super::live::LiveTransport;
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Unfit};
use nalgebra::{DMatrix, DVector};

/// Gains `g = diag(T^-1)` by probing: cells that light each other get different colours,
/// one solve is made for each colour, and each cell reads its own element.
#[derive(Clone, Copy, Debug)]
pub struct Probing {
    /// Most colours, at least 1.
    pub colours: usize,
}

impl Inversion for Probing {
    fn description(&self) -> Description {
        Description {
            name: format!("gains by probing, colours {}", self.colours),
            source: Citation {
                authors: "Tang, Saad",
                title: "A Probing Method for Computing the Diagonal of a Matrix Inverse",
                venue: "Numerical Linear Algebra with Applications",
                year: 2012,
            },
            how: "Cells that light each other most get different colours; one solve for each \
                colour gives the gains g of all its cells, less what cells of one colour throw at \
                each other. Shown with the gains alone, p = g d, which takes no interreflection \
                away.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let colours = colouring(&live.transport, self.colours);
        let used = colours.iter().max().map_or(0, |last| last + 1);
        let gains = probed(&live.transport, &colours, used)?;
        let exact = live
            .transport
            .clone()
            .try_inverse()
            .ok_or(Unfit::Singular)?;
        let error = (&gains - exact.diagonal()).norm() / exact.diagonal().norm();
        let remark = format!("{used} solves; g off by {error:.4} from that of the exact inverse");
        Ok(diagonal(&live, &gains, remark))
    }
}

/// `x_c = T^-1 v_c` with `v_c` the sum of colour `c`'s unit vectors; `g_i` is read from
/// the solve of the cell's own colour.
fn probed(transport: &DMatrix<f64>, colours: &[usize], used: usize) -> Result<DVector<f64>, Unfit> {
    let mut probes = DMatrix::zeros(transport.nrows(), used);
    for (cell, colour) in colours.iter().enumerate() {
        probes[(cell, *colour)] = 1.0;
    }
    let solved = transport
        .clone()
        .lu()
        .solve(&probes)
        .ok_or(Unfit::Singular)?;
    let gain = |cell: usize| solved[(cell, colours[cell])];
    let gains = DVector::from_fn(transport.nrows(), |cell, _| gain(cell));
    if gains.iter().all(|gain| gain.is_finite()) {
        Ok(gains)
    } else {
        Err(Unfit::Singular)
    }
}

/// A colour for each cell, at most `limit` of them: greedy colouring of the graph of the
/// strongest exchanges of light, as many as so many colours can keep apart.
fn colouring(transport: &DMatrix<f64>, limit: usize) -> Vec<usize> {
    let n = transport.nrows();
    let exchange = transport.map(f64::abs) + transport.transpose().map(f64::abs);
    let mut levels: Vec<f64> = (0..n)
        .flat_map(|col| (0..col).map(move |row| (row, col)))
        .map(|place| exchange[place])
        .filter(|light| *light > 0.0)
        .collect();
    levels.sort_by(f64::total_cmp);
    // With no edge one colour is enough; the weakest level that still fits is wanted.
    let (mut fits, mut too_many) = (levels.len(), None);
    let mut best = vec![0; n];
    let mut middle = 0;
    while middle < fits {
        let colours = greedy(&exchange, levels[middle]);
        if colours.iter().all(|colour| *colour < limit) {
            best = colours;
            fits = middle;
        } else {
            too_many = Some(middle);
        }
        middle = match too_many {
            Some(bad) if fits - bad <= 1 => break,
            Some(bad) => usize::midpoint(bad, fits),
            None => break,
        };
    }
    best
}

/// The first colour that no neighbour has, cell by cell; neighbours exchange at least
/// `least` light.
fn greedy(exchange: &DMatrix<f64>, least: f64) -> Vec<usize> {
    let n = exchange.nrows();
    let mut colours = vec![0; n];
    for cell in 0..n {
        let mut taken = vec![false; cell + 1];
        for other in (0..cell).filter(|other| exchange[(*other, cell)] >= least) {
            taken[colours[other]] = true;
        }
        colours[cell] = taken.iter().position(|taken| !taken).unwrap_or(cell);
    }
    colours
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;
    use iltm_solve::inverted;

    fn error(before: &KnownScene, colours: usize) -> f64 {
        let gains = before.matrix(&Probing { colours }).diagonal();
        let exact = inverted(&before.transport, &before.live)
            .unwrap()
            .diagonal();
        (gains - &exact).norm() / exact.norm()
    }

    #[test]
    fn a_colour_for_each_cell_is_exact_and_more_colours_are_nearer() {
        let before = KnownScene::panels(6, 8);
        assert!(error(&before, 48) < 1e-12);
        assert!(error(&before, 24) < error(&before, 8));
        assert!(error(&before, 8) < error(&before, 1));
    }

    /// `T^-1 = (I - r 11^T / N) / r`: with one colour each cell loses what all throw.
    #[test]
    fn with_one_colour_a_spheres_gains_are_those_of_even_light() {
        let before = KnownScene::sphere(3, 4, 0.6);
        let gains = before.matrix(&Probing { colours: 1 }).diagonal();
        assert!(gains.iter().all(|gain| (gain - 0.4 / 0.6).abs() < 1e-12));
    }

    #[test]
    fn colours_keep_the_strongest_exchanges_apart_and_are_not_more_than_allowed() {
        let before = KnownScene::textured(6, 8);
        for limit in [1, 3, 10, 48] {
            let colours = colouring(&before.transport, limit);
            assert!(colours.iter().all(|colour| *colour < limit));
        }
        let colours = colouring(&before.transport, 10);
        let exchange = &before.transport + before.transport.transpose();
        let mut pairs: Vec<(usize, usize)> =
            (0..48).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
        pairs.sort_by(|x, y| exchange[*y].total_cmp(&exchange[*x]));
        assert!(pairs[..20].iter().all(|(a, b)| colours[*a] != colours[*b]));
    }
}
