//! The patterns that were shown, checked against each other before any
//! photograph is decoded.

use super::frame::{self, Frame};
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

/// Cells from which on two equal Bernoulli patterns are the same one shown again:
/// by chance, one in 16 million pairs is. On fewer cells chance draws patterns
/// twice, and each draw counts.
const FEWEST_FOR_REPEATS: usize = 24;

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
    /// Frames of it, as indices into the used ones. More than one where it was
    /// photographed again.
    pub(super) shots: Vec<usize>,
    /// Whether each cell is lit, length `N`.
    pub(super) lit: Vec<bool>,
}

/// All used patterns of a capture.
#[derive(Clone, Debug)]
pub(super) struct Sequence {
    pub(super) grid: Grid,
    /// Used frames, in the order they were taken.
    pub(super) frames: Vec<Frame>,
    /// The longest exposure, if exposures are given.
    pub(super) longest: Option<f64>,
    /// The first photograph of each frame.
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
    /// Reads the patterns of `shots`, which are ordered by index, and checks them.
    ///
    /// # Errors
    /// What [`CaptureError`] says about roles and patterns.
    pub(super) fn read(folder: &Path, shots: Vec<Shot>) -> Result<Self, CaptureError> {
        let manifest = folder.join(MANIFEST_FILE);
        check_roles(&shots, &manifest)?;
        let longest = frame::longest(&shots, &manifest)?;
        let frames = match longest {
            Some(longest) => frame::bracketed(&shots, &read_patterns(folder, &shots)?, longest),
            None => Frame::of_each(&shots, None),
        };
        let shots: Vec<Shot> = frames.iter().map(|frame| frame.shots[0].clone()).collect();
        let patterns = read_patterns(folder, &shots)?;
        let grid = common_grid(folder, &shots, &patterns)?;
        let bits = [
            code_bits(Axis::Column, grid.cols(), &shots, &manifest)?,
            code_bits(Axis::Row, grid.rows(), &shots, &manifest)?,
        ];
        for (shot, pattern) in shots.iter().zip(&patterns) {
            check_role(folder, shot, pattern, grid, bits)?;
        }
        let mut sequence = Self::grouped(grid, bits, frames, shots, patterns);
        sequence.longest = longest;
        Ok(sequence)
    }

    /// Puts photographs of one pattern together.
    fn grouped(
        grid: Grid,
        bits: [u8; 2],
        frames: Vec<Frame>,
        shots: Vec<Shot>,
        patterns: Vec<Pattern>,
    ) -> Self {
        let mut black = Vec::new();
        let mut coded: Vec<View> = Vec::new();
        let mut bernoulli: Vec<View> = Vec::new();
        let again =
            |known: &View, view: &View| grid.cells() >= FEWEST_FOR_REPEATS && known.lit == view.lit;
        for (at, (shot, pattern)) in shots.iter().zip(patterns).enumerate() {
            let role = shot.role;
            let view = View {
                role,
                shots: vec![at],
                lit: pattern.lit,
            };
            match role {
                Role::Black => black.push(at),
                Role::Bernoulli => match bernoulli.iter_mut().find(|known| again(known, &view)) {
                    Some(known) => known.shots.push(at),
                    None => bernoulli.push(view),
                },
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
            frames,
            longest: None,
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

fn read_patterns(folder: &Path, shots: &[Shot]) -> Result<Vec<Pattern>, CaptureError> {
    let read = |shot: &Shot| {
        Pattern::read(Source {
            path: &folder.join(&shot.pattern),
            what: "pattern",
            line: shot.line,
        })
    };
    let patterns: Vec<_> = shots.par_iter().map(read).collect();
    patterns.into_iter().collect()
}

/// The shots that `options` ask for: all but the Bernoulli ones beyond their number,
/// the photographs of a bracket counting as one.
///
/// # Errors
/// [`CaptureError::NoBlack`], [`CaptureError::NoWhite`],
/// [`CaptureError::MorePhotographsThanTaken`] or [`CaptureError::TooFewPhotographs`];
/// of a capture with exposures also what is wrong with them or with a pattern.
pub(super) fn chosen(
    folder: &Path,
    shots: &[Shot],
    options: &CaptureOptions,
) -> Result<Vec<Shot>, CaptureError> {
    let manifest = folder.join(MANIFEST_FILE);
    check_roles(shots, &manifest)?;
    let frames = match frame::longest(shots, &manifest)? {
        Some(longest) => frame::bracketed(shots, &read_patterns(folder, shots)?, longest),
        None => Frame::of_each(shots, None),
    };
    let is_bernoulli = |frame: &&Frame| frame.shots[0].role == Role::Bernoulli;
    let found = frames.iter().filter(is_bernoulli).count();
    let used = options.bernoulli.unwrap_or(found);
    if used > found {
        return Err(CaptureError::MorePhotographsThanTaken {
            path: manifest,
            asked: used,
            found,
        });
    }
    if used < options.min_bernoulli {
        return Err(CaptureError::TooFewPhotographs {
            path: manifest,
            used,
            needed: options.min_bernoulli,
        });
    }
    let mut left = used;
    let mut wanted = |frame: &Frame| {
        if !is_bernoulli(&frame) {
            return true;
        }
        let wanted = left > 0;
        left = left.saturating_sub(1);
        wanted
    };
    let frames = frames.into_iter().filter(|frame| wanted(frame));
    let mut chosen: Vec<Shot> = frames.flat_map(|frame| frame.shots).collect();
    chosen.sort_by_key(|shot| shot.index);
    Ok(chosen)
}

/// Refuses shots without white or black.
fn check_roles(shots: &[Shot], manifest: &Path) -> Result<(), CaptureError> {
    let path = || manifest.to_owned();
    let has = |role| shots.iter().any(|shot| shot.role == role);
    if !has(Role::Black) {
        return Err(CaptureError::NoBlack { path: path() });
    }
    if !has(Role::White) {
        return Err(CaptureError::NoWhite { path: path() });
    }
    Ok(())
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
