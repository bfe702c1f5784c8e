//! The patterns that were shown, checked against each other before any
//! photograph is decoded.

use super::find;
use super::manifest::MANIFEST_FILE;
use super::picture::Source;
use super::{CaptureError, CaptureOptions, Pattern, Role, Shot};
use iltm_runtime::Grid;
use rayon::prelude::*;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Bernoulli photographs that a capture needs at least.
///
/// Gray code stripes light whole columns and rows, so that only Bernoulli
/// patterns tell a cell's light from that of the others in its column or row;
/// and a solve keeps some of them back to choose its sparsity with.
pub const MIN_BERNOULLI: usize = 10;

/// One axis of the grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Axis {
    /// Columns, counted from the left.
    Column,
    /// Rows, counted from the top.
    Row,
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Column => "column",
            Self::Row => "row",
        })
    }
}

/// One pattern and the photographs of it.
#[derive(Clone, Debug)]
pub(super) struct View {
    /// What it was shown for; never black.
    pub(super) role: Role,
    /// Photographs of it, as indices into the used shots. More than one only
    /// where a role other than Bernoulli was photographed again.
    pub(super) shots: Vec<usize>,
    /// Whether each cell is lit, length `N`.
    pub(super) lit: Vec<bool>,
}

/// All used patterns of a capture.
#[derive(Clone, Debug)]
pub(super) struct Sequence {
    pub(super) grid: Grid,
    /// Used shots, in the order they were taken.
    pub(super) shots: Vec<Shot>,
    /// Photographs of black, as indices into `shots`, at least one.
    pub(super) black: Vec<usize>,
    /// The white view, then the Gray code, then the Bernoulli patterns.
    pub(super) views: Vec<View>,
    /// Bits of the column code and of the row code.
    pub(super) bits: [u8; 2],
    /// Where the Gray code ends and the Bernoulli patterns begin in `views`.
    bernoulli_from: usize,
}

impl Sequence {
    /// Chooses the shots that `options` ask for, reads their patterns and checks
    /// them. `shots` are ordered by index.
    ///
    /// # Errors
    /// What [`CaptureError`] says about roles, patterns and missing files.
    pub(super) fn read(
        folder: &Path,
        shots: &[Shot],
        options: &CaptureOptions,
    ) -> Result<Self, CaptureError> {
        let manifest = folder.join(MANIFEST_FILE);
        let mut shots = chosen(shots, options, &manifest)?;
        find::resolve(folder, &mut shots)?;
        let patterns = shots
            .par_iter()
            .map(|shot| {
                Pattern::read(Source {
                    path: &folder.join(&shot.pattern),
                    what: "pattern",
                    line: shot.line,
                })
            })
            .collect::<Vec<_>>();
        let patterns = patterns.into_iter().collect::<Result<Vec<_>, _>>()?;
        let grid = common_grid(folder, &shots, &patterns)?;
        let bits = [
            code_bits(Axis::Column, grid.cols(), &shots, &manifest)?,
            code_bits(Axis::Row, grid.rows(), &shots, &manifest)?,
        ];
        for (shot, pattern) in shots.iter().zip(&patterns) {
            check_role(folder, shot, pattern, grid, bits)?;
        }
        Ok(Self::grouped(grid, bits, shots, patterns))
    }

    /// Puts photographs of one pattern together.
    fn grouped(grid: Grid, bits: [u8; 2], shots: Vec<Shot>, patterns: Vec<Pattern>) -> Self {
        let mut black = Vec::new();
        let mut coded: Vec<View> = Vec::new();
        let mut bernoulli = Vec::new();
        for (at, (shot, pattern)) in shots.iter().zip(patterns).enumerate() {
            let role = shot.role;
            let view = View {
                role,
                shots: vec![at],
                lit: pattern.lit,
            };
            match role {
                Role::Black => black.push(at),
                Role::Bernoulli => bernoulli.push(view),
                _ => match coded.iter_mut().find(|view| view.role == role) {
                    Some(view) => view.shots.push(at),
                    None => coded.push(view),
                },
            }
        }
        // Stable: the Gray code stays in the order it was taken.
        coded.sort_by_key(|view| view.role != Role::White);
        let bernoulli_from = coded.len();
        coded.append(&mut bernoulli);
        Self {
            grid,
            shots,
            black,
            views: coded,
            bits,
            bernoulli_from,
        }
    }

    /// The white view.
    pub(super) fn white(&self) -> &View {
        // `chosen` refuses a capture without white and `grouped` puts it first.
        &self.views[0]
    }

    /// The view of a role, if it was photographed.
    pub(super) fn view(&self, role: Role) -> Option<&View> {
        self.views.iter().find(|view| view.role == role)
    }

    /// Places of the Gray code in `views`.
    pub(super) fn coded(&self) -> Range<usize> {
        1..self.bernoulli_from
    }

    /// Places in `views` of each Gray code pattern that has an inverse, and of
    /// that inverse.
    pub(super) fn code_pairs(&self) -> Vec<(usize, usize)> {
        let place = |role| self.coded().find(|&at| self.views[at].role == role);
        let pair = |at: usize| match self.views[at].role {
            role @ (Role::Column { inverse: false, .. } | Role::Row { inverse: false, .. }) => {
                Some((at, place(role.complement()?)?))
            }
            _ => None,
        };
        self.coded().filter_map(pair).collect()
    }

    /// Places of the Bernoulli patterns in `views`.
    pub(super) fn bernoulli(&self) -> Range<usize> {
        self.bernoulli_from..self.views.len()
    }
}

/// The shots to use: all but the Bernoulli ones beyond the number asked for.
fn chosen(
    shots: &[Shot],
    options: &CaptureOptions,
    manifest: &Path,
) -> Result<Vec<Shot>, CaptureError> {
    let path = || manifest.to_owned();
    let has = |role| shots.iter().any(|shot| shot.role == role);
    if !has(Role::Black) {
        return Err(CaptureError::NoBlack { path: path() });
    }
    if !has(Role::White) {
        return Err(CaptureError::NoWhite { path: path() });
    }
    let is_bernoulli = |shot: &&Shot| shot.role == Role::Bernoulli;
    let found = shots.iter().filter(is_bernoulli).count();
    let used = options.bernoulli.unwrap_or(found);
    if used > found {
        return Err(CaptureError::MorePhotographsThanTaken {
            path: path(),
            asked: used,
            found,
        });
    }
    if used < options.min_bernoulli {
        return Err(CaptureError::TooFewPhotographs {
            path: path(),
            used,
            needed: options.min_bernoulli,
        });
    }
    let mut left = used;
    let mut wanted = |shot: &&Shot| {
        if shot.role != Role::Bernoulli {
            return true;
        }
        let wanted = left > 0;
        left = left.saturating_sub(1);
        wanted
    };
    Ok(shots.iter().filter(|shot| wanted(shot)).cloned().collect())
}

/// The grid that all patterns share.
fn common_grid(folder: &Path, shots: &[Shot], patterns: &[Pattern]) -> Result<Grid, CaptureError> {
    let path = |at: usize| -> PathBuf { folder.join(&shots[at].pattern) };
    let size = |pattern: &Pattern| (pattern.rows as u32, pattern.cols as u32);
    let expected = size(&patterns[0]);
    if let Some(at) = patterns.iter().position(|p| size(p) != expected) {
        return Err(CaptureError::PatternSize {
            path: path(at),
            found: size(&patterns[at]),
            first: path(0),
            expected,
        });
    }
    // A pattern of at most `Grid::MAX_CELLS` cells has sides that fit 16 bits.
    let side = |cells: u32| u16::try_from(cells).unwrap_or(u16::MAX);
    Grid::new(side(expected.0), side(expected.1)).map_err(|source| CaptureError::Grid {
        path: path(0),
        source,
    })
}

/// Bits of the Gray code of one axis, all of which were photographed, as a
/// pattern or as its inverse.
fn code_bits(
    axis: Axis,
    cells: usize,
    shots: &[Shot],
    manifest: &Path,
) -> Result<u8, CaptureError> {
    let mut seen = [false; Role::MAX_BITS as usize];
    for shot in shots {
        match (axis, shot.role) {
            (Axis::Column, Role::Column { bit, .. }) | (Axis::Row, Role::Row { bit, .. }) => {
                seen[usize::from(bit)] = true;
            }
            _ => {}
        }
    }
    let given = seen.iter().rposition(|&seen| seen).map_or(0, |bit| bit + 1);
    if let Some(bit) = seen[..given].iter().position(|&seen| !seen) {
        return Err(CaptureError::MissingBit {
            path: manifest.to_owned(),
            axis,
            bit: bit as u8,
            last: given as u8 - 1,
        });
    }
    let needed = cells.next_power_of_two().trailing_zeros() as u8;
    if (given as u8) < needed {
        return Err(CaptureError::GridNotCovered {
            path: manifest.to_owned(),
            axis,
            cells,
            needed,
            given: given as u8,
        });
    }
    Ok(given as u8)
}

/// Refuses a pattern that lights other cells than its role says.
fn check_role(
    folder: &Path,
    shot: &Shot,
    pattern: &Pattern,
    grid: Grid,
    bits: [u8; 2],
) -> Result<(), CaptureError> {
    let Some(expected) = Pattern::of_role(grid, shot.role, bits[0], bits[1]) else {
        return Ok(());
    };
    let wrong = expected
        .lit
        .iter()
        .zip(&pattern.lit)
        .position(|(a, b)| a != b);
    wrong.map_or(Ok(()), |cell| {
        Err(CaptureError::PatternRole {
            path: folder.join(&shot.pattern),
            role: shot.role,
            row: (cell / grid.cols()) as u32,
            col: (cell % grid.cols()) as u32,
        })
    })
}
