//! Fig. 1: how few coefficients hold the energy of `T` and of `T^-1`.

use super::scenes::Condition;
use iltm_picture::{ColourScale, ContactSheet, Palette, Picture, Tile};
use iltm_runtime::FrameSize;
use iltm_solve::Haar;
use nalgebra::DMatrix;

/// Parts of the energy that are counted for.
pub(super) const PARTS: [f64; 3] = [0.99, 0.999, 0.9999];

/// Name of the matrix whose rows the direct method looks for.
pub(super) const INVERSE_IN_HAAR: &str = "T^-1 in Haar";

/// Powers of ten below the largest coefficient that have colours of their own.
const DECADES: i32 = 4;

/// One matrix and the coefficients that hold its energy.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Counted {
    /// Whether cells differ in albedo.
    pub(super) textured: bool,
    /// The matrix, in words.
    pub(super) name: &'static str,
    /// Coefficients for each of [`PARTS`].
    pub(super) counts: [usize; 3],
    /// Coefficients in all.
    pub(super) all: usize,
}

/// The matrices of one scene, coarse coefficients first.
struct Matrices {
    cells: usize,
    named: Vec<(&'static str, DMatrix<f64>)>,
}

fn matrices(condition: Condition) -> Option<Matrices> {
    let (truth, _) = condition.world(1)?;
    let haar = Haar::new(truth.grid);
    let mut operator = truth.inverse.clone();
    operator.fill_diagonal(0.0);
    Some(Matrices {
        cells: truth.grid.cells(),
        named: vec![
            ("T", truth.transport.clone()),
            ("T^-1", truth.inverse.clone()),
            ("T in Haar", haar.analyse_operator(&truth.transport)),
            (INVERSE_IN_HAAR, haar.analyse_operator(&truth.inverse)),
            ("K in Haar", haar.analyse_operator(&operator)),
        ],
    })
}

/// Fewest coefficients that hold a part of a matrix's energy (sum of squares).
#[must_use]
pub(super) fn count(matrix: &DMatrix<f64>, part: f64) -> usize {
    let mut squares: Vec<f64> = matrix.iter().map(|value| value * value).collect();
    squares.sort_by(|a, b| b.total_cmp(a));
    let wanted = part * squares.iter().sum::<f64>();
    let mut held = 0.0;
    let needed = squares.iter().take_while(|square| {
        let go_on = held < wanted;
        held += **square;
        go_on
    });
    needed.count()
}

/// Counts for the uniform and the textured scene.
#[must_use]
pub(super) fn counts() -> Vec<Counted> {
    let of = |condition: Condition| {
        let matrices = matrices(condition);
        let named = matrices.map_or_else(Vec::new, |matrices| matrices.named);
        named.into_iter().map(move |(name, matrix)| Counted {
            textured: condition.textured,
            name,
            counts: PARTS.map(|part| count(&matrix, part)),
            all: matrix.len(),
        })
    };
    [Condition::ALL[0], Condition::ALL[2]]
        .into_iter()
        .flat_map(of)
        .collect()
}

/// All matrices as pictures, uniform above textured.
#[must_use]
pub(super) fn picture() -> Option<Picture> {
    let scale = ColourScale::logarithmic(Palette::Viridis, 1.0, DECADES);
    let row = |condition: Condition| -> Option<Vec<Tile>> {
        let Matrices { cells, named } = matrices(condition)?;
        let side = u16::try_from(cells).ok()?;
        let size = FrameSize::new(side, side)?;
        let tile = |(name, matrix): (&'static str, DMatrix<f64>)| {
            let largest = matrix.amax();
            let in_haar = name.ends_with("Haar");
            let values = (0..cells * cells).map(|at| {
                let (mut row, mut col) = (at / cells, at % cells);
                // Coefficients are numbered fine to coarse.
                if in_haar {
                    (row, col) = (cells - 1 - row, cells - 1 - col);
                }
                matrix[(row, col)].abs() / largest
            });
            let needed = count(&matrix, PARTS[1]);
            let caption = format!("{needed} hold 99.9 %");
            Tile::scaled((name, &caption), size, values, &scale)
        };
        Some(named.into_iter().map(tile).collect())
    };
    let sheet = ContactSheet {
        rows: vec![row(Condition::ALL[0])?, row(Condition::ALL[2])?],
        bar: Some((
            &scale,
            "magnitude, relative to the matrix's largest; uniform panels above, textured below",
        )),
        ..ContactSheet::default()
    };
    sheet.compose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_counted_from_the_largest_down() {
        let matrix = DMatrix::from_row_slice(2, 2, &[3.0, 0.0, 1.0, -4.0]);
        // Squares 16, 9, 1, 0 of 26.
        assert_eq!(count(&matrix, 0.6), 1);
        assert_eq!(count(&matrix, 0.62), 2);
        assert_eq!(count(&matrix, 0.97), 3);
        assert_eq!(count(&DMatrix::zeros(2, 2), 0.99), 0);
    }
}
