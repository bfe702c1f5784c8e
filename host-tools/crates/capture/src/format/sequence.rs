//! Pattern sequence: the patterns that were shown, checked against each other before any
//! photograph is decoded.

use super::bracket::{self, Bracket};
use super::code::{Code, Stripes, lit_by_role};
use super::error::CaptureError;
use super::manifest::{MANIFEST_FILE, Shot};
use super::pattern::Pattern;
use super::photo_files::{PhotoFiles, find_all};
use super::picture_file::Source;
use super::role::{CodeAxis, Role};
use crate::gate::{Gate, GateName};
use iltm_picture::FramePart;
use iltm_runtime::{FrameSize, Grid};
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Bernoulli photographs that a capture needs at least.
///
/// Gray code stripes light whole columns and rows, so that only Bernoulli
/// patterns tell a cell's light from that of the others in its column or row;
/// and a solve keeps some of them back to choose its sparsity with.
pub const MIN_BERNOULLI: usize = 10;

/// Images from which on a capture needs no Gray code: a camera pixel's light in them tells its cell
/// from all others.
pub(crate) const MIN_MATCHED: usize = 20;

/// Cells from which on two equal Bernoulli patterns are the same one shown again:
/// by chance, one in 16 million pairs is. On fewer cells chance draws patterns
/// twice, and each draw counts.
const FEWEST_FOR_REPEATS: usize = 24;

/// Pixels of the largest projector whose patterns are looked at more coarsely.
const MOST_PROJECTOR_PIXELS: usize = 4096 * 2160;

/// Memory that patterns may take while they are looked at more coarsely.
const MOST_BYTES: usize = 1 << 30;

/// How to read a capture.
#[derive(Clone, PartialEq, Debug)]
pub struct CaptureOptions {
    /// Use only this many Bernoulli photographs, the first ones, beside all
    /// others; `None` for all.
    pub bernoulli: Option<usize>,
    /// Fewer Bernoulli photographs and images together than this are refused.
    pub min_bernoulli: usize,
    /// Of stripes finer than a table or the camera can have, without Bernoulli
    /// patterns, the finest are left out, so that a cell is a block of the patterns'.
    pub coarsen: bool,
    /// Gates that may fail: [`read`](crate::read) goes on despite them, as far as it can.
    pub ignore: Vec<GateName>,
}

impl Default for CaptureOptions {
    fn default() -> Self {
        Self {
            bernoulli: None,
            min_bernoulli: MIN_BERNOULLI,
            coarsen: false,
            ignore: Vec::new(),
        }
    }
}

impl CaptureOptions {
    /// Whether a capture is refused for a gate.
    pub(crate) fn refuses(&self, gate: &Gate) -> bool {
        gate.fails() && !self.ignore.contains(&gate.name)
    }
}

/// One pattern and the photographs of it.
#[derive(Clone, Debug)]
pub(crate) struct View {
    /// What it was shown for; never black.
    pub(crate) role: Role,
    /// Frames of it, as indices into the used ones. More than one where it was
    /// photographed again.
    pub(crate) shots: Vec<usize>,
    /// Whether each cell is lit, length `N`.
    pub(crate) lit: Vec<bool>,
}

/// All used patterns of a capture.
#[derive(Clone, Debug)]
pub(crate) struct Sequence {
    pub(crate) grid: Grid,
    /// Used brackets, in the order they were taken.
    pub(crate) brackets: Vec<Bracket>,
    /// The longest exposure, if exposures are given.
    pub(crate) longest: Option<f64>,
    /// The first photograph of each bracket.
    pub(crate) shots: Vec<Shot>,
    /// Photographs of images, in the order they were taken. Gates look at patterns, which are in
    /// `brackets`.
    pub(crate) images: Vec<Bracket>,
    /// Photographs of black, as indices into `shots`, at least one.
    pub(crate) black: Vec<usize>,
    /// The white view, then the Gray code, then the Bernoulli patterns.
    pub(crate) views: Vec<View>,
    /// The column code and the row code.
    pub(crate) codes: [Code; 2],
    /// Columns and rows of the patterns that each cell stands for, as a power of 2.
    pub(crate) coarser: u8,
    /// Photographs of the stripes that are finer than the cells for that reason.
    pub(crate) finer: Vec<Bracket>,
    /// Columns and rows of the patterns, and their codes.
    pub(crate) shown: [(usize, Code); 2],
    /// The projector's part of the frame, if the patterns are of a wide frame.
    pub(crate) part: Option<PatternPart>,
    /// Where the Gray code ends and the Bernoulli patterns begin in `views`.
    bernoulli_from: usize,
}

/// The part of a wide frame that one of several projectors shows: the cells that its white lights.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct PatternPart {
    cells: FramePart,
    /// Cells of the wide frame.
    grid: Grid,
    /// Name of the list of its fine stripes.
    pub(crate) stripes: String,
}

impl PatternPart {
    /// The part that white lights; `None` if its cells are not those of a frame at the upper edge.
    fn lit_by(white: &Pattern, stripes: String) -> Option<Self> {
        let grid = Grid::new(white.rows.try_into().ok()?, white.cols.try_into().ok()?).ok()?;
        let lit = &white.lit[..white.cols];
        let start = lit.iter().position(|lit| *lit)?;
        let end = lit.iter().rposition(|lit| *lit)? + 1;
        let below = white.lit[start..].iter().step_by(white.cols);
        let cells = FramePart {
            columns: start..end,
            rows: below.take_while(|lit| **lit).count(),
        };
        let of_part = |cell| cells.own(white.cols, cell).is_some();
        let mut lit = white.lit.iter().enumerate();
        lit.all(|(cell, lit)| *lit == of_part(cell))
            .then_some(Self {
                cells,
                grid,
                stripes,
            })
    }

    /// The projector's pixels of a wide frame; `None` if it would have no whole number of them for each
    /// cell.
    pub(crate) fn pixels(&self, wide: FrameSize) -> Option<FrameSize> {
        self.cells.pixels(self.grid, wide)?.frame()
    }
}

/// The brackets that a capture is learned from.
#[derive(Clone, Debug)]
pub(crate) struct Selection {
    pub(crate) brackets: Vec<Bracket>,
    images: Vec<Bracket>,
    /// The longest exposure, if exposures are given.
    longest: Option<f64>,
    /// [`CaptureOptions::coarsen`], if there is nothing that forbids it.
    coarsen: bool,
    /// Of patterns of a wide frame, the list of the projector's fine stripes.
    part: Option<String>,
}

impl Selection {
    /// Chooses the brackets that `options` ask for. `shots` are ordered by index.
    ///
    /// # Errors
    /// What [`CaptureError`] says about roles and the number of photographs; a
    /// pattern's own error where brackets need it.
    pub(crate) fn new(
        folder: &Path,
        shots: &[Shot],
        options: &CaptureOptions,
    ) -> Result<Self, CaptureError> {
        let manifest = folder.join(MANIFEST_FILE);
        check_levels(shots, &manifest)?;
        let longest = bracket::longest(shots, &manifest)?;
        let (images, shots): (Vec<Shot>, Vec<Shot>) =
            (shots.iter().cloned()).partition(|shot| shot.role == Role::Image);
        let (images, shots) = (Bracket::of_each(&images, longest), &shots[..]);
        // Stripes may be looked at by fewer bits; a Bernoulli pattern is what it is.
        let coarsen = options.coarsen && shots.iter().all(|shot| shot.role != Role::Bernoulli);
        let brackets = match longest {
            Some(longest) => {
                bracket::bracketed(shots, &read_patterns(folder, shots, coarsen)?, longest)
            }
            None => Bracket::of_each(shots, None),
        };
        let brackets = chosen(brackets, images.len(), options, &manifest)?;
        Ok(Self {
            brackets,
            images,
            longest,
            coarsen,
            part: None,
        })
    }

    /// The same of patterns of a wide frame, of which those of one projector are read; `stripes` is the
    /// list of its fine stripes.
    pub(crate) fn of_part(self, stripes: String) -> Self {
        Self {
            coarsen: false,
            part: Some(stripes),
            ..self
        }
    }

    /// Names in each shot the file that stands for its photograph; shots without one are
    /// taken out.
    ///
    /// # Errors
    /// [`CaptureError::Ambiguous`] if several files could be meant.
    pub(crate) fn find_photographs(&mut self, folder: &Path) -> Result<PhotoFiles, CaptureError> {
        find_all(folder, [&mut self.brackets, &mut self.images])
    }
}

impl Sequence {
    /// Reads the patterns of the brackets that were chosen and checks them.
    ///
    /// # Errors
    /// What [`CaptureError`] says about roles and patterns.
    pub(crate) fn read(folder: &Path, chosen: Selection) -> Result<Self, CaptureError> {
        let manifest = folder.join(MANIFEST_FILE);
        let Selection {
            mut brackets,
            images,
            longest,
            coarsen,
            part,
        } = chosen;
        let first = |bracket: &Bracket| bracket.shots[0].clone();
        let mut shots: Vec<Shot> = brackets.iter().map(first).collect();
        check_levels(&shots, &manifest)?;
        let mut patterns = read_patterns(folder, &shots, coarsen)?;
        let (mut rows, mut cols) = common_size(folder, &shots, &patterns)?;
        let part = part.map(|stripes| frame_part(folder, &shots, &patterns, stripes));
        let part = part.transpose()?;
        if let Some(part) = &part {
            let columns: Vec<usize> = part.cells.columns.clone().collect();
            let down: Vec<usize> = (0..part.cells.rows).collect();
            let of_part = |pattern: &Pattern| pattern.sampled(&down, &columns);
            patterns = patterns.iter().map(of_part).collect();
            (rows, cols) = (down.len(), columns.len());
        }
        let sides = [(CodeAxis::Column, cols), (CodeAxis::Row, rows)];
        let mut given = [0; 2];
        for (given, (axis, _)) in given.iter_mut().zip(sides) {
            *given = code_bits(axis, &shots, &manifest)?;
        }
        let mut codes: [Code; 2] = std::array::from_fn(|k| {
            let (axis, cells) = sides[k];
            Code::find(&stripes(axis, &shots, &patterns), given[k], cells)
        });
        // Images tell cells as well. Random patterns would, too, but without stripes they say little of
        // light over large distances, and the prediction does not notice.
        let matched = given == [0; 2] && images.len() >= MIN_MATCHED;
        let missing = |k: usize| if matched { 0 } else { codes[k].bits - given[k] };
        // Blocks stand for missing fine stripes, not for no stripes at all.
        let refused = |k: &usize| missing(*k) > 0 && (given[*k] == 0 || !coarsen);
        if let Some(k) = (0..2).find(refused) {
            let ((axis, cells), needed, given) = (sides[k], codes[k].bits, given[k]);
            return Err(CaptureError::GrayCode {
                path: manifest,
                reason: match given {
                    0 => format!(
                        "there is no Gray code of the {axis}s; without any, {MIN_MATCHED} images are \
                         needed"
                    ),
                    _ => format!(
                        "the Gray code has {given} {axis} bits, but {cells} {axis}s need {needed}"
                    ),
                },
            });
        }
        for (shot, pattern) in shots.iter().zip(&patterns) {
            check_role(folder, shot, pattern, codes)?;
        }
        let fewest = missing(0).max(missing(1));
        let blocks = |steps: u8| {
            let [cols, rows] = [0, 1].map(|k| codes[k].firsts(steps, sides[k].1).len());
            rows * cols
        };
        let fits = |steps: &u8| blocks(*steps) <= Grid::MAX_CELLS;
        let coarser = (fewest..Role::MAX_BITS).find(fits).unwrap_or(fewest);
        let shown = std::array::from_fn(|k| (sides[k].1, codes[k]));
        let mut finer = Vec::new();
        if coarser > 0 {
            let firsts = [0, 1].map(|k| codes[k].firsts(coarser, sides[k].1));
            codes = codes.map(|code| code.coarser(coarser));
            patterns = patterns
                .iter()
                .map(|pattern| pattern.sampled(&firsts[1], &firsts[0]))
                .collect();
            let encoded = |shot: &Shot| encoded_by(shot.role, codes);
            let kept: Vec<bool> = shots.iter().map(encoded).collect();
            let left = brackets.iter().zip(&kept).filter(|(_, kept)| !**kept);
            finer = left.map(|(bracket, _)| bracket.clone()).collect();
            keep(&mut brackets, &kept);
            keep(&mut shots, &kept);
            keep(&mut patterns, &kept);
        }
        let grid = grid_of(folder, &shots, &patterns)?;
        let (black, views, bernoulli_from) = grouped(grid, &shots, patterns);
        Ok(Self {
            grid,
            brackets,
            longest,
            shots,
            images,
            black,
            views,
            codes,
            coarser,
            finer,
            shown,
            part,
            bernoulli_from,
        })
    }

    /// The white view.
    pub(crate) fn white(&self) -> &View {
        // `chosen` refuses a capture without white and `grouped` puts it first.
        &self.views[0]
    }

    /// The view of a role, if it was photographed.
    pub(crate) fn view(&self, role: Role) -> Option<&View> {
        self.views.iter().find(|view| view.role == role)
    }

    /// Places of the Gray code in `views`.
    pub(crate) fn coded(&self) -> Range<usize> {
        1..self.bernoulli_from
    }

    /// Whether a Gray code tells the cells: none is needed of a single one.
    pub(crate) fn is_coded(&self) -> bool {
        !self.coded().is_empty() || self.codes.iter().all(|code| code.bits == 0)
    }

    /// Places in `views` of each Gray code pattern that has an inverse, and of
    /// that inverse.
    pub(crate) fn code_pairs(&self) -> Vec<(usize, usize)> {
        let place = |role| self.coded().find(|&at| self.views[at].role == role);
        let pair = |at: usize| match self.views[at].role.as_stripe()? {
            (axis, bit, false) => Some((at, place(axis.stripe(bit, true))?)),
            _ => None,
        };
        self.coded().filter_map(pair).collect()
    }

    /// Places of the Bernoulli patterns in `views`.
    pub(crate) fn bernoulli(&self) -> Range<usize> {
        self.bernoulli_from..self.views.len()
    }
}

/// Puts photographs of one pattern together: those of black, and the views, of which those
/// of Bernoulli patterns begin at the number that is returned.
fn grouped(grid: Grid, shots: &[Shot], patterns: Vec<Pattern>) -> (Vec<usize>, Vec<View>, usize) {
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
    (black, coded, bernoulli_from)
}

/// Reads patterns of as many cells as a table may have; of more where they may be
/// looked at more coarsely.
fn read_patterns(
    folder: &Path,
    shots: &[Shot],
    coarsen: bool,
) -> Result<Vec<Pattern>, CaptureError> {
    let most = if coarsen {
        (MOST_BYTES / shots.len().max(1)).clamp(Grid::MAX_CELLS, MOST_PROJECTOR_PIXELS)
    } else {
        Grid::MAX_CELLS
    };
    let read = |shot: &Shot| {
        let source = Source {
            path: &folder.join(&shot.pattern),
            what: "pattern",
            line: shot.line,
        };
        Pattern::read(source, most as u64)
    };
    let patterns: Vec<_> = shots.par_iter().map(read).collect();
    patterns.into_iter().collect()
}

/// Refuses a capture without black or without white.
fn check_levels(shots: &[Shot], manifest: &Path) -> Result<(), CaptureError> {
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

/// The brackets to use: all but the Bernoulli ones beyond the number asked for.
fn chosen(
    brackets: Vec<Bracket>,
    images: usize,
    options: &CaptureOptions,
    manifest: &Path,
) -> Result<Vec<Bracket>, CaptureError> {
    let path = || manifest.to_owned();
    let is_bernoulli = |bracket: &Bracket| bracket.shots[0].role == Role::Bernoulli;
    let found = brackets
        .iter()
        .filter(|bracket| is_bernoulli(bracket))
        .count();
    let used = options.bernoulli.unwrap_or(found);
    if used > found {
        return Err(CaptureError::Asked {
            place: manifest.display().to_string(),
            reason: format!("{used} Bernoulli photographs asked for; the capture has {found}"),
            next_step: "Ask for fewer, or leave --photos away.",
        });
    }
    if used + images < options.min_bernoulli {
        return Err(CaptureError::TooFewPhotographs {
            path: path(),
            used: used + images,
            needed: options.min_bernoulli,
        });
    }
    let mut left = used;
    let mut wanted = |bracket: &Bracket| {
        if !is_bernoulli(bracket) {
            return true;
        }
        let wanted = left > 0;
        left = left.saturating_sub(1);
        wanted
    };
    Ok(brackets
        .into_iter()
        .filter(|bracket| wanted(bracket))
        .collect())
}

/// The part of the frame that the first pattern of white lights.
fn frame_part(
    folder: &Path,
    shots: &[Shot],
    patterns: &[Pattern],
    stripes: String,
) -> Result<PatternPart, CaptureError> {
    let white = shots.iter().zip(patterns);
    let mut white = white.filter(|(shot, _)| shot.role == Role::White);
    // `check_levels` refuses a capture without white.
    let (shot, white) = white.next().unwrap_or((&shots[0], &patterns[0]));
    PatternPart::lit_by(white, stripes).ok_or_else(|| CaptureError::Picture {
        path: folder.join(&shot.pattern),
        reason: "white lights no part of a wide frame".to_owned(),
        next_step: "Make the folder again with `iltm verify`.",
    })
}

/// Rows and columns that all patterns have.
fn common_size(
    folder: &Path,
    shots: &[Shot],
    patterns: &[Pattern],
) -> Result<(usize, usize), CaptureError> {
    let size = |pattern: &Pattern| (pattern.rows, pattern.cols);
    let expected = size(&patterns[0]);
    match patterns.iter().position(|p| size(p) != expected) {
        Some(at) => Err(another_grid(
            folder,
            &shots[at].pattern,
            size(&patterns[at]),
            (&shots[0].pattern, expected),
        )),
        None => Ok(expected),
    }
}

/// Refuses a pattern of other rows and columns than those of the first file.
pub(crate) fn another_grid(
    folder: &Path,
    pattern: &Path,
    (rows, cols): (usize, usize),
    (first, expected): (&Path, (usize, usize)),
) -> CaptureError {
    CaptureError::Picture {
        path: folder.join(pattern),
        reason: format!(
            "{rows} x {cols} cells (rows x columns), but {} has {} x {}",
            folder.join(first).display(),
            expected.0,
            expected.1
        ),
        next_step: "Use patterns of one grid only.",
    }
}

/// The grid of patterns that have one size.
fn grid_of(folder: &Path, shots: &[Shot], patterns: &[Pattern]) -> Result<Grid, CaptureError> {
    // A pattern of at most `Grid::MAX_CELLS` cells has sides that fit 16 bits.
    let side = |cells: usize| u16::try_from(cells).unwrap_or(u16::MAX);
    let (rows, cols) = (patterns[0].rows, patterns[0].cols);
    Grid::new(side(rows), side(cols)).map_err(|error| CaptureError::Picture {
        path: folder.join(&shots[0].pattern),
        reason: error.to_string(),
        next_step: "Use fewer cells: a pattern has one pixel a cell.",
    })
}

/// The Gray code patterns of one axis, along it.
fn stripes(axis: CodeAxis, shots: &[Shot], patterns: &[Pattern]) -> Vec<Stripes> {
    let of_shot = |(shot, pattern): (&Shot, &Pattern)| {
        let (along, bit, inverse) = shot.role.as_stripe()?;
        let step = match axis {
            CodeAxis::Column => 1,
            CodeAxis::Row => pattern.cols,
        };
        let cells = pattern.lit.iter().step_by(step);
        let count = [pattern.cols, pattern.rows][axis as usize];
        (along == axis).then(|| Stripes {
            bit,
            inverse,
            lit: cells.take(count).copied().collect(),
        })
    };
    shots.iter().zip(patterns).filter_map(of_shot).collect()
}

/// Whether the codes, perhaps coarser than the patterns', still have what a role shows.
fn encoded_by(role: Role, codes: [Code; 2]) -> bool {
    role.as_stripe()
        .is_none_or(|(axis, bit, _)| bit < codes[axis as usize].bits)
}

/// Keeps the items that have `true` at their place.
fn keep<T>(items: &mut Vec<T>, wanted: &[bool]) {
    let mut wanted = wanted.iter();
    items.retain(|_| wanted.next() == Some(&true));
}

/// Bits of the Gray code of one axis that were photographed, as a pattern or as its
/// inverse.
fn code_bits(axis: CodeAxis, shots: &[Shot], manifest: &Path) -> Result<u8, CaptureError> {
    let mut seen = [false; Role::MAX_BITS as usize];
    for (along, bit, _) in shots.iter().filter_map(|shot| shot.role.as_stripe()) {
        seen[usize::from(bit)] |= along == axis;
    }
    let given = seen.iter().rposition(|&seen| seen).map_or(0, |bit| bit + 1);
    match seen[..given].iter().position(|&seen| !seen) {
        Some(bit) => Err(CaptureError::GrayCode {
            path: manifest.to_owned(),
            reason: format!(
                "no photograph of {axis}-{bit}, though there is one of {axis}-{}",
                given - 1
            ),
        }),
        None => Ok(given as u8),
    }
}

/// Refuses a pattern that lights other cells than its role says.
fn check_role(
    folder: &Path,
    shot: &Shot,
    pattern: &Pattern,
    codes: [Code; 2],
) -> Result<(), CaptureError> {
    let expected =
        |cell: usize| lit_by_role(shot.role, codes, cell / pattern.cols, cell % pattern.cols);
    let wrong = |(cell, lit): (usize, &bool)| expected(cell).is_some_and(|e| e != *lit);
    let wrong = pattern.lit.iter().enumerate().position(wrong);
    wrong.map_or(Ok(()), |cell| {
        let (row, col) = (cell / pattern.cols, cell % pattern.cols);
        Err(CaptureError::Picture {
            path: folder.join(&shot.pattern),
            reason: format!(
                "row {row}, column {col} is not what \"{}\" lights there",
                shot.role
            ),
            next_step: "Correct the role in capture.csv, or name the pattern that was really shown.",
        })
    })
}
