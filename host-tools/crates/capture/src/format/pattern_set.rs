//! Pattern set: the patterns of a capture, in the order in which they are shown.

use super::pattern::Pattern;
use super::role::{CodeAxis, Role};
use iltm_runtime::Grid;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// White, black, the Gray code of both axes with its inverses, then `bernoulli`
/// patterns whose cells are lit or not by chance, half and half.
///
/// The same grid, number and seed give the same patterns; a larger number only adds
/// to them.
///
/// ```
/// use iltm_capture::{Role, pattern_set};
/// let grid = iltm_runtime::Grid::new(13, 21)?;
/// let patterns = pattern_set(grid, 150, 1);
/// // 4 bits of rows and 5 of columns, each twice.
/// assert_eq!(patterns.len(), 2 + 2 * (4 + 5) + 150);
/// assert_eq!(patterns[0].0, Role::White);
/// # Ok::<(), iltm_runtime::GridError>(())
/// ```
#[must_use]
pub fn pattern_set(grid: Grid, bernoulli: usize, seed: u64) -> Vec<(Role, Pattern)> {
    let bits = |cells: usize| cells.next_power_of_two().trailing_zeros() as u8;
    let (column_bits, row_bits) = (bits(grid.cols()), bits(grid.rows()));
    let mut roles = vec![Role::White, Role::Black];
    for (axis, bits) in [(CodeAxis::Column, column_bits), (CodeAxis::Row, row_bits)] {
        roles.extend((0..bits).flat_map(|bit| [false, true].map(|i| axis.stripe(bit, i))));
    }
    let coded = roles.into_iter().filter_map(|role| {
        let pattern = Pattern::of_role(grid, role, column_bits, row_bits)?;
        Some((role, pattern))
    });
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let chance = (0..bernoulli).map(|_| {
        let lit = (0..grid.cells()).map(|_| random.random_bool(0.5));
        let pattern = Pattern {
            rows: grid.rows(),
            cols: grid.cols(),
            lit: lit.collect(),
        };
        (Role::Bernoulli, pattern)
    });
    coded.chain(chance).collect()
}

/// Projected light of each pattern as a column of 0 and 1, `N x m`.
#[must_use]
pub fn columns(patterns: &[(Role, Pattern)]) -> DMatrix<f64> {
    let cells = patterns.first().map_or(0, |(_, pattern)| pattern.lit.len());
    DMatrix::from_fn(cells, patterns.len(), |cell, k| {
        f64::from(u8::from(patterns[k].1.lit[cell]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_patterns_only_add_to_fewer_and_a_seed_repeats_them() {
        let grid = Grid::new(3, 5).unwrap();
        let (few, many) = (pattern_set(grid, 4, 7), pattern_set(grid, 9, 7));
        assert_eq!(few[..], many[..few.len()]);
        assert_ne!(pattern_set(grid, 4, 8).last(), few.last());
    }

    #[test]
    fn a_grid_of_one_cell_needs_no_gray_code() {
        let roles: Vec<_> = pattern_set(Grid::new(1, 1).unwrap(), 2, 0)
            .into_iter()
            .map(|(role, _)| role)
            .collect();
        assert_eq!(
            roles,
            [Role::White, Role::Black, Role::Bernoulli, Role::Bernoulli]
        );
    }
}
