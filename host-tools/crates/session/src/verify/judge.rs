//! Verdict: from photographs to errors before and after.
//!
//! The error is the one that a solve predicts and the documentation measures: a
//! photograph against the wanted light at the one scale, for all cells and colours, that
//! suits it best ([`Comparison`]). What may be expected of it is put together from what is
//! known: the table's own predicted error, what the projector's range and its 8-bit codes
//! leave (the table read backwards, [`Expected`]), and the noise of the photographs.

use super::noise::{self, PhotographNoise};
use super::outcome::{MOST_SHIFTED, decide, decide_by_pixels, decide_by_shifts};
use super::readings::Shown;
use super::{Cause, ChainFault, Expected, Outcome, PixelVerdict, Readings, VerifyError};
use iltm_capture::{CellPlanes, Gate, PictureShift};
use iltm_compile::Provenance;
use iltm_picture::LightPicture;
use iltm_report::{Comparison, tier_costs};
use iltm_runtime::{FrameSize, image::Table};
use std::borrow::Cow;
use std::path::Path;

/// How much larger than expected an error may be.
pub(super) const MARGIN: f64 = 1.5;

/// Most that the noise of the photographs may add to what the table promises, as a multiple of
/// it. Good sessions stay below, and the smallest bump of a tripod that spoils an error is above:
/// `docs/verify.md` has the study.
pub(super) const MOST_NOISE: f64 = 1.5;

/// Most that finding the cells again may add, as a multiple of what the table promises: white
/// differs by more than twice that where cells have few pixels.
pub(super) const MOST_VIEWPOINT: f64 = 2.5;

/// The most in any case: beyond, it is a change of the scene.
const MOST_VIEWPOINT_OF_ALL: f64 = 0.01;

/// Where the table predicts nothing: share of the error before that may remain.
const UNPREDICTED: f64 = 0.5;

/// Cells that are named as the worst.
const WORST: usize = 8;

/// A photograph that fits another picture this much better than its own shows that one.
const EXCHANGED: f64 = 0.4;

/// What the error is held against.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bound {
    /// The largest error that passes.
    pub limit: f64,
    /// Whether the user chose it.
    pub given: bool,
    /// Error that the table predicts of itself at its top tier; `None` if it predicts
    /// none.
    pub predicted: Option<f64>,
    /// Error that cut samples and the steps of 8-bit codes leave, mean over the images;
    /// `None` if the table does not tell what light comes of an input.
    pub range: Option<f64>,
    /// Error that the noise of these photographs makes, mean over the images; `None` with
    /// a single photograph of white. What counts and is added is the most that it can be.
    pub noise: Option<f64>,
    /// Error of finding the cells again: what white differs by from cell to cell and neighbours
    /// do not share, since a camera elsewhere sees other parts of them; at most 1 %, beyond
    /// which it is a change of the scene.
    pub viewpoint: f64,
    /// What counts of noise and of viewpoint in what is expected: no more than a part of the
    /// promise; means over the images.
    pub counted: [f64; 2],
    /// Error that the table promises on this projector: what it predicts and what range and
    /// codes leave. Where it predicts none, that of the limit without its margin.
    pub promise: f64,
    /// Error that the photographs themselves make: noise and viewpoint.
    pub added: f64,
    /// Promise and as much of the latter as may be added: root of the sum of squares; `None`
    /// if the table predicts none.
    pub expected: Option<f64>,
    /// The largest error that the promise and all faults of the photographs explain: what is
    /// beyond it is on the wall. At least the limit.
    pub doubt: f64,
}

impl Bound {
    /// What the photographs add too much of for a table to pass on them.
    pub(super) fn unsure(&self) -> Option<Cause> {
        if self.noise.unwrap_or(0.0) > MOST_NOISE * self.promise {
            Some(Cause::Noise)
        } else if self.viewpoint > MOST_VIEWPOINT * self.promise {
            Some(Cause::Viewpoint)
        } else {
            None
        }
    }

    /// The larger of what the photographs add.
    pub(super) fn worst(&self) -> Cause {
        if self.noise.unwrap_or(0.0) >= self.viewpoint {
            Cause::Noise
        } else {
            Cause::Viewpoint
        }
    }
}

/// A test image on the wall.
#[derive(Clone, PartialEq, Debug)]
pub struct ImageVerdict {
    /// Its number.
    pub image: u8,
    /// What it is, for people.
    pub title: String,
    /// Share of its samples that the table has to cut.
    pub clipped: f64,
    /// Error without and with compensation.
    pub error: [f64; 2],
    /// Both as the table read backwards would have them, without its own error; `None` if
    /// it cannot be.
    pub modelled: Option<[f64; 2]>,
    /// Error with compensation if the table's own reference white is the scale: right
    /// only where camera and exposure are the ones of the table's photographs.
    pub at_table_white: f64,
    /// Camera units of wanted white, by the scale that suits the compensated photograph
    /// best.
    pub white: f64,
    /// Error of each cell with and without compensation, relative to reference white, root
    /// mean square over the channels; `None` where it was not compared. Length `N`.
    pub cells: [Vec<Option<f64>>; 2],
}

/// What has changed.
#[derive(Clone, PartialEq, Debug)]
pub struct Drift {
    /// White since the table was made; `None` if the table does not tell what light comes
    /// of an input.
    pub white: Option<WhiteChange>,
    /// Largest change of white from its first photograph in this session to another.
    pub session: f64,
}

/// How white differs from what the table expects.
#[derive(Clone, PartialEq, Debug)]
pub struct WhiteChange {
    /// Light of white now, relative to what the table expects, each channel: the median
    /// over the cells. Other exposures and cameras change it too.
    pub level: Vec<f64>,
    /// The same from cell to cell once that is divided out: root mean square.
    pub shape: f64,
    /// The part of it that neighbouring cells do not share: what a camera elsewhere explains,
    /// which sees other parts of each cell. Paint changes neighbours alike.
    pub alone: f64,
    /// Of each cell, mean over the channels; `None` where it was not compared.
    pub cells: Vec<Option<f64>>,
}

impl WhiteChange {
    /// The part of [`shape`](Self::shape) that neighbouring cells share: paint, lamps, things
    /// that were moved.
    #[must_use]
    pub fn shared(&self) -> f64 {
        (self.shape.powi(2) - self.alone.powi(2)).max(0.0).sqrt()
    }
}

/// A cell with a large error.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct WorstCell {
    /// Its row, from 0 at the top.
    pub row: usize,
    /// Its column, from 0 at the left.
    pub col: usize,
    /// Error with compensation, relative to reference white: root mean square over images
    /// and channels.
    pub error: f64,
}

/// A curve of camera or projector that nobody declared.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Curve {
    /// The power that the light of the photographs is best raised to; 1 for none.
    pub power: f64,
    /// Mean error of the compensated images that it leaves.
    pub left: f64,
}

/// The answer.
#[derive(Clone, PartialEq, Debug)]
pub struct TableVerdict {
    /// Whether the table keeps its promise.
    pub outcome: Outcome,
    /// Why it did not pass.
    pub cause: Option<Cause>,
    /// The power of light that the compensated photographs would fit best with.
    pub curve: Curve,
    /// What the chain that was to compensate did instead.
    pub chain: Option<ChainFault>,
    /// Whether such a chain was verified; then the errors without compensation are what the
    /// table expects.
    pub wanted: bool,
    /// What a capture's gates say of the photographs.
    pub gates: Vec<Gate>,
    /// Mean error of the images without and with compensation.
    pub error: [f64; 2],
    /// What the latter is held against.
    pub bound: Bound,
    /// Image by image.
    pub images: Vec<ImageVerdict>,
    /// What a viewer sees of finer images; `None` without such, and where the photographs cannot
    /// tell.
    pub pixels: Option<PixelVerdict>,
    /// What has changed.
    pub drift: Drift,
    /// How far pictures that overlap lie from where they lay against each other.
    pub shifts: Vec<PictureShift>,
    /// Two projectors, from 0, that show each other's pictures.
    pub exchanged: Option<[usize; 2]>,
    /// Pairs of projectors, from 0, whose overlap the photographs do not show.
    pub unseen: Vec<[usize; 2]>,
    /// Light of wanted white on the wall, of that under the projector's own white; mean over
    /// the cells and colours.
    pub brightness: f64,
    /// The worst cells, the worst first.
    pub worst: Vec<WorstCell>,
    /// Cells compared, and cells that the table knows.
    pub cells: (usize, usize),
}

impl TableVerdict {
    /// The pictures that moved farthest against each other, if that keeps the table from passing.
    #[must_use]
    pub fn moved(&self) -> Option<&PictureShift> {
        let nudged = self.cause == Some(Cause::Nudged);
        self.farthest()
            .filter(|shift| nudged && shift.pixels > MOST_SHIFTED)
    }

    /// The pictures that moved farthest against each other, if any overlap.
    #[must_use]
    pub fn farthest(&self) -> Option<&PictureShift> {
        let shifts = self.shifts.iter();
        shifts.max_by(|a, b| a.pixels.total_cmp(&b.pixels))
    }

    /// Whether it is the error within the cells that keeps the table from passing.
    #[must_use]
    pub const fn fails_within_cells(&self) -> bool {
        matches!(self.cause, Some(Cause::Nudged | Cause::Texture))
    }
}

/// Judges a table by the photographs of its folder; `bound` is the largest error that
/// passes, by default 1.5 times what is to be expected.
///
/// # Errors
/// [`VerifyError::Order`] if a photograph shows the picture of another line.
pub fn judge(
    folder: &Path,
    table: &Table<'_>,
    readings: &Readings,
    bound: Option<f64>,
) -> Result<TableVerdict, VerifyError> {
    let mut expected = Expected::new(table);
    let known = expected.live().iter().filter(|live| **live).count();
    let lit = LiveCells::new(&readings.live);
    let models: Option<Vec<[CellPlanes; 2]>> = (readings.shown.iter())
        .map(|shown| {
            let [plain, compensated] = &shown.input;
            Some([
                expected.photograph(plain)?,
                expected.photograph(compensated)?,
            ])
        })
        .collect();
    // What the table does not tell of a photograph, its picture does, roughly.
    let wanted = |shown: &Shown| [shown.wanted.clone(), shown.wanted.clone()];
    let shows = models.as_ref().map(Cow::Borrowed);
    let shows = shows.unwrap_or_else(|| Cow::Owned(readings.shown.iter().map(wanted).collect()));
    check_order(folder, readings, &shows, &lit)?;
    let white = table.reference_white().to_num::<f64>();
    let images: Vec<ImageVerdict> = readings
        .shown
        .iter()
        .enumerate()
        .map(|(at, shown)| {
            let models = models.as_ref().map(|models| &models[at]);
            image(shown, models, white, &lit)
        })
        .collect();
    let mean = |of: &dyn Fn(&ImageVerdict) -> f64| {
        images.iter().map(of).sum::<f64>() / images.len().max(1) as f64
    };
    let error = [mean(&|image| image.error[0]), mean(&|image| image.error[1])];
    let cols = table.grid().cols();
    let drift = drift(readings, &mut expected, white, cols, &lit);
    let alone = drift.white.as_ref().map_or(0.0, |white| white.alone);
    let viewpoint = alone.min(MOST_VIEWPOINT_OF_ALL);
    let bound = self::bound(table, readings, &images, (error[0], bound), viewpoint, &lit);
    let curve = curve(readings, &lit);
    let found = (&readings.revisited, &drift, curve);
    let (mut outcome, mut cause) = decide(error[1], &bound, found);
    let search = readings.wanted && outcome != Outcome::Passed;
    let chain = if search && !cause.is_some_and(super::outcome::Cause::spoils_pictures) {
        let images = super::test_images(table)?;
        super::chain::find(table, &images, readings, &mut expected, &lit)?
    } else {
        None
    };
    if chain.is_some() {
        (outcome, cause) = (Outcome::Failed, Some(Cause::Chain));
    }
    let moved = (&readings.shifts[..], readings.exchanged.is_some());
    (outcome, cause) = decide_by_shifts(moved, (outcome, cause));
    // Photographs that cannot tell by cells tell less by pixels.
    let pixels = (outcome != Outcome::Inconclusive)
        .then(|| PixelVerdict::new(table, readings, &bound))
        .flatten();
    if let Some(pixels) = &pixels {
        (outcome, cause) = decide_by_pixels(pixels, (outcome, cause));
    }
    Ok(TableVerdict {
        curve,
        chain,
        wanted: readings.wanted,
        outcome,
        cause,
        gates: readings.revisited.gates.clone(),
        error,
        bound,
        pixels,
        drift,
        shifts: readings.shifts.clone(),
        exchanged: readings.exchanged,
        unseen: readings.unseen.clone(),
        brightness: brightness(readings, &images, &mut expected, &lit),
        worst: worst(table, &images),
        cells: (lit.0.len(), known),
        images,
    })
}

/// The power of light with which the compensated photographs fit best.
fn curve(readings: &Readings, lit: &LiveCells) -> Curve {
    let left = |power: f64| {
        let error = |shown: &Shown| {
            let raise = |light: &f64| light.max(0.0).powf(power);
            let planes = shown.seen[1].iter();
            let raised = planes.map(|plane| plane.iter().map(raise).collect());
            lit.compare(&raised.collect(), &shown.wanted).error
        };
        readings.shown.iter().map(error).sum::<f64>() / readings.shown.len().max(1) as f64
    };
    let powers = (-60..=60).map(|step| (f64::from(step) * 0.01).exp());
    let tried = powers.map(|power| Curve {
        power,
        left: left(power),
    });
    let best = tried.min_by(|a, b| a.left.total_cmp(&b.left));
    best.unwrap_or(Curve {
        power: 1.0,
        left: 1.0,
    })
}

/// The cells that are compared.
pub(super) struct LiveCells(Vec<usize>);

impl LiveCells {
    fn new(live: &[bool]) -> Self {
        Self((0..live.len()).filter(|cell| live[*cell]).collect())
    }

    /// Their light side by side, to be compared like a picture.
    pub(super) fn light(&self, light: &CellPlanes) -> LightPicture {
        let plane = |plane: &Vec<f64>| self.0.iter().map(|cell| plane[*cell] as f32).collect();
        let size = FrameSize::new(self.0.len() as u16, 1);
        let planes = light.iter().map(plane).collect();
        match size.and_then(|size| LightPicture::new(size, planes)) {
            Some(picture) => picture,
            None => unreachable!("a table has cells, and one or three channels"),
        }
    }

    pub(super) fn compare(&self, seen: &CellPlanes, wanted: &CellPlanes) -> Comparison {
        Comparison::new(&self.light(seen), &self.light(wanted))
    }

    /// Values of these cells, among all `cells`.
    fn among(&self, cells: usize, values: &[f32]) -> Vec<Option<f64>> {
        let mut all = vec![None; cells];
        for (cell, value) in self.0.iter().zip(values) {
            all[*cell] = Some(f64::from(*value));
        }
        all
    }

    /// Values of these cells in one channel.
    pub(super) fn of<'l>(&'l self, plane: &'l [f64]) -> impl Iterator<Item = f64> + 'l {
        self.0.iter().map(|cell| plane[*cell])
    }
}

fn image(
    shown: &Shown,
    models: Option<&[CellPlanes; 2]>,
    white: f64,
    lit: &LiveCells,
) -> ImageVerdict {
    let cells = shown.wanted[0].len();
    let compared = shown
        .seen
        .each_ref()
        .map(|seen| lit.compare(seen, &shown.wanted));
    let error = |model| lit.compare(model, &shown.wanted).error;
    let modelled = models.map(|models| models.each_ref().map(error));
    let scale = compared[1].scale;
    ImageVerdict {
        image: shown.image,
        title: shown.title.clone(),
        clipped: shown.clipped,
        error: compared.each_ref().map(|compared| compared.error),
        modelled,
        at_table_white: at_scale(&shown.seen[1], &shown.wanted, 1.0 / white, lit),
        white: if scale > 0.0 { 1.0 / scale } else { 0.0 },
        cells: compared.map(|compared| lit.among(cells, &compared.map)),
    }
}

/// The error at a scale that is not chosen.
fn at_scale(seen: &CellPlanes, wanted: &CellPlanes, scale: f64, lit: &LiveCells) -> f64 {
    let pairs = || {
        let planes = seen.iter().zip(wanted);
        planes.flat_map(|(seen, wanted)| lit.of(seen).zip(lit.of(wanted)))
    };
    let off: f64 = pairs().map(|(s, w)| (scale * s - w).powi(2)).sum();
    let norm: f64 = pairs().map(|(_, w)| w * w).sum();
    if norm > 0.0 { (off / norm).sqrt() } else { 1.0 }
}

/// What the error is held against.
fn bound(
    table: &Table<'_>,
    readings: &Readings,
    images: &[ImageVerdict],
    (before, given): (f64, Option<f64>),
    viewpoint: f64,
    lit: &LiveCells,
) -> Bound {
    // Cells are measured here, which err less than pixels.
    let predicted = Provenance::read(table.provenance()).predicted_error;
    let by_cells = predicted.and_then(|predicted| predicted.by_cells);
    let own = by_cells.unwrap_or_else(|| table.inverse_error().to_num());
    let predicted = tier_costs(table)
        .last()
        .map(|step| step.left_out.hypot(own));
    let range = |image: &ImageVerdict| image.modelled.map(|modelled| modelled[1]);
    let ranges: Vec<Option<f64>> = images.iter().map(range).collect();
    bound_of(
        predicted.filter(|_| own > 0.0),
        (before, given),
        &ranges,
        noise::of_compensated(readings, lit).as_deref(),
        viewpoint,
    )
}

/// The same from what the table predicts of itself, and from what range and noise make in each
/// image.
fn bound_of(
    predicted: Option<f64>,
    (before, given): (f64, Option<f64>),
    ranges: &[Option<f64>],
    noise: Option<&[PhotographNoise]>,
    viewpoint: f64,
) -> Bound {
    let count = ranges.len().max(1) as f64;
    let mean = |of: &dyn Fn(usize) -> f64| (0..ranges.len()).map(of).sum::<f64>() / count;
    let noise_of = |image: usize| noise.map_or(0.0, |noise| noise[image].most);
    let range_of = |image: usize| ranges[image].unwrap_or(0.0);
    let modelled = ranges.iter().all(Option::is_some);
    let unpredicted = given.unwrap_or(UNPREDICTED * before) / MARGIN;
    let promise_of = |image: usize| match (given, predicted) {
        (None, Some(predicted)) => predicted.hypot(range_of(image)),
        _ => unpredicted,
    };
    let added_of = |image: usize| noise_of(image).hypot(viewpoint);
    let counted_of = |image: usize| {
        let promise = promise_of(image);
        [
            noise_of(image).min(MOST_NOISE * promise),
            viewpoint.min(MOST_VIEWPOINT * promise),
        ]
    };
    let expected = mean(&|image| {
        let [noise, viewpoint] = counted_of(image);
        promise_of(image).hypot(noise).hypot(viewpoint)
    });
    let expected = predicted.filter(|_| given.is_none()).map(|_| expected);
    let limit = MARGIN * expected.unwrap_or(unpredicted);
    let explained = mean(&|image| promise_of(image).hypot(added_of(image)));
    Bound {
        limit,
        given: given.is_some(),
        predicted,
        range: modelled.then(|| mean(&range_of)),
        viewpoint,
        noise: noise.map(|noise| mean(&|image| noise[image].expected)),
        counted: [0, 1].map(|part| mean(&|image| counted_of(image)[part])),
        promise: mean(&promise_of),
        added: mean(&added_of),
        expected,
        doubt: (MARGIN * explained).max(limit),
    }
}

/// Refuses photographs that show another picture than their own.
fn check_order(
    folder: &Path,
    readings: &Readings,
    models: &[[CellPlanes; 2]],
    lit: &LiveCells,
) -> Result<(), VerifyError> {
    let named = |image: u8, half: usize| {
        let role = if readings.wanted {
            super::VerifyRole::Wanted
        } else {
            [super::VerifyRole::Plain, super::VerifyRole::Compensated][half]
        };
        role(image).to_string()
    };
    for (own, shown) in readings.shown.iter().enumerate() {
        for half in usize::from(readings.wanted)..2 {
            let error = |model: &CellPlanes| lit.compare(model, &shown.seen[half]).error;
            let mut of_own = error(&models[own][half]);
            if readings.wanted {
                // Perhaps nothing compensates.
                of_own = of_own.min(error(&models[own][0]));
            }
            // Plain and compensated pictures of one image differ by too little to tell
            // them apart where the table may be wrong.
            let others = models.iter().enumerate().filter(|(other, _)| *other != own);
            let fits = others.flat_map(|(other, pair)| {
                pair.iter()
                    .enumerate()
                    .map(move |(half, model)| (other, half, model))
            });
            let best = fits
                .map(|(other, half, model)| (other, half, error(model)))
                .min_by(|a, b| a.2.total_cmp(&b.2));
            if let Some((other, other_half, _)) = best.filter(|best| best.2 < EXCHANGED * of_own) {
                return Err(VerifyError::Order {
                    path: folder.join(&shown.photos[half]),
                    shows: named(readings.shown[other].image, other_half),
                    own: named(shown.image, half),
                });
            }
        }
    }
    Ok(())
}

/// White now against the white that the table expects, and against its first photograph.
fn drift(
    readings: &Readings,
    expected: &mut Expected<'_, '_>,
    white: f64,
    cols: usize,
    lit: &LiveCells,
) -> Drift {
    let seen = &readings.revisited.white;
    let total = |light: &CellPlanes| {
        light
            .iter()
            .map(|plane| lit.of(plane).sum::<f64>())
            .sum::<f64>()
    };
    let first = seen.first().map_or(0.0, total).max(1e-12);
    let changes = seen.iter().map(|light| (total(light) / first - 1.0).abs());
    let photographed = readings.expected_white.clone().map(|light| (light, 1.0));
    let expected = || Some((expected.photograph(&readings.flood)?, white));
    let flood = photographed.or_else(expected);
    Drift {
        white: flood.map(|(flood, white)| white_change(readings, &flood, white, cols, lit)),
        session: changes.fold(0.0, f64::max),
    }
}

fn white_change(
    readings: &Readings,
    flood: &CellPlanes,
    white: f64,
    cols: usize,
    lit: &LiveCells,
) -> WhiteChange {
    let seen = &readings.revisited.white;
    let mut level = Vec::new();
    let mut change = vec![0.0; lit.0.len()];
    let (mut square, mut shared) = (0.0, 0.0);
    for (channel, plane) in flood.iter().enumerate() {
        let mean = |cell: &usize| {
            seen.iter().map(|light| light[channel][*cell]).sum::<f64>() / seen.len().max(1) as f64
        };
        let ratio = |cell: &usize| mean(cell) / (white * plane[*cell]).max(1e-12);
        let ratios: Vec<f64> = lit.0.iter().map(ratio).collect();
        let median = median(ratios.clone());
        let off = |ratio: &f64| (ratio / median.max(1e-12) - 1.0) as f32;
        let off: Vec<f32> = ratios.iter().map(off).collect();
        for (change, off) in change.iter_mut().zip(&off) {
            let off = f64::from(*off);
            *change += off / flood.len() as f64;
            square += off * off;
        }
        shared += shared_by_neighbours(&lit.among(readings.live.len(), &off), cols);
        level.push(median);
    }
    let channels = flood.len().max(1) as f64;
    let square = square / (lit.0.len().max(1) as f64 * channels);
    let change: Vec<f32> = change.into_iter().map(|change| change as f32).collect();
    WhiteChange {
        level,
        shape: square.sqrt(),
        alone: (square - shared / channels).max(0.0).sqrt(),
        cells: lit.among(readings.live.len(), &change),
    }
}

/// Mean product of the values of neighbouring cells, at least 0.
fn shared_by_neighbours(cells: &[Option<f64>], cols: usize) -> f64 {
    let pairs = (0..cells.len()).flat_map(|cell| {
        let right = ((cell + 1) % cols != 0).then_some(cell + 1);
        [right, Some(cell + cols)].map(|other| Some(cells[cell]? * (*cells.get(other?)?)?))
    });
    let (sum, count) = pairs
        .flatten()
        .fold((0.0, 0_usize), |(sum, n), product| (sum + product, n + 1));
    (sum / count.max(1) as f64).max(0.0)
}

/// How bright wanted white is, of the projector's own.
fn brightness(
    readings: &Readings,
    images: &[ImageVerdict],
    expected: &mut Expected<'_, '_>,
    lit: &LiveCells,
) -> f64 {
    let ones = vec![vec![1.0; readings.live.len()]; readings.revisited.channels];
    // Where the projector's own white was not photographed, the table says it.
    let own = readings
        .wanted
        .then(|| expected.photograph(&ones))
        .flatten();
    if let Some(own) = own {
        let light = own.iter().flat_map(|plane| lit.of(plane));
        let (sum, count) = light.fold((0.0, 0_usize), |(sum, n), light| (sum + light, n + 1));
        return count as f64 / sum.max(1e-12);
    }
    let mut whites: Vec<f64> = images.iter().map(|image| image.white).collect();
    whites.sort_by(f64::total_cmp);
    let wanted = whites.get(whites.len() / 2).copied().unwrap_or(0.0);
    let flood = readings.revisited.white.iter().flatten();
    let (mut own, mut count) = (0.0, 0_usize);
    for light in flood.flat_map(|plane| lit.of(plane)) {
        own += light;
        count += 1;
    }
    if own > 0.0 {
        wanted * count as f64 / own
    } else {
        0.0
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Error of every cell over all images, with (1) or without (0) compensation.
pub(super) fn over_images(images: &[ImageVerdict], half: usize) -> Vec<Option<f64>> {
    let cells = images.first().map_or(0, |image| image.cells[half].len());
    let of_cell = |cell: usize| {
        let squares: Option<Vec<f64>> = images
            .iter()
            .map(|image| image.cells[half][cell].map(|error| error * error))
            .collect();
        let squares = squares?;
        Some((squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt())
    };
    (0..cells).map(of_cell).collect()
}

fn worst(table: &Table<'_>, images: &[ImageVerdict]) -> Vec<WorstCell> {
    let cols = table.grid().cols();
    let cells = over_images(images, 1).into_iter().enumerate();
    let mut worst: Vec<WorstCell> = cells
        .filter_map(|(cell, error)| {
            Some(WorstCell {
                row: cell / cols,
                col: cell % cols,
                error: error?,
            })
        })
        .collect();
    worst.sort_by(|a, b| b.error.total_cmp(&a.error));
    worst.truncate(WORST);
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::test_scene::scene;
    use iltm_capture::{CellReadings, NoiseModel, Registration};
    use iltm_compile::{CompileOptions, compile};
    use iltm_runtime::Grid;
    use std::path::PathBuf;

    fn close(found: f64, wanted: f64) -> bool {
        (found - wanted).abs() < 1e-12
    }

    #[test]
    fn the_error_at_a_given_scale_is_over_live_cells_of_all_channels() {
        let lit = LiveCells::new(&[true, false, true]);
        let wanted = vec![vec![0.5, 9.0, 0.5], vec![0.5, 9.0, 0.5]];
        let seen = vec![vec![1.2, 0.0, 1.0], vec![1.0, 0.0, 0.8]];
        // At half the light two of four are off by .1, of a norm of 1.
        let error = at_scale(&seen, &wanted, 0.5, &lit);
        assert!(close(error, 0.02_f64.sqrt()), "{error}");
        let dark = vec![vec![0.0; 3]];
        assert!(close(at_scale(&dark, &dark, 1.0, &lit), 1.0));
    }

    #[test]
    fn noise_or_viewpoint_beyond_its_share_of_the_promise_cannot_tell() {
        let unsure = |noise: f64, viewpoint: f64| {
            let bound = Bound {
                limit: 0.02,
                given: false,
                predicted: Some(0.01),
                range: None,
                noise: Some(noise),
                viewpoint,
                counted: [noise, viewpoint],
                promise: 0.01,
                added: noise.hypot(viewpoint),
                expected: None,
                doubt: 0.02,
            };
            (bound.unsure(), bound.worst())
        };
        assert_eq!(unsure(0.014, 0.024), (None, Cause::Viewpoint));
        assert_eq!(unsure(0.016, 0.0), (Some(Cause::Noise), Cause::Noise));
        let viewpoint = Cause::Viewpoint;
        assert_eq!(unsure(0.0, 0.026), (Some(viewpoint), viewpoint));
    }

    #[test]
    fn a_limit_counts_noise_and_viewpoint_up_to_their_share_of_each_images_promise() {
        // Promises of .05 and .03: the table's own .03, and what range leaves.
        let ranges = [Some(0.04), Some(0.0)];
        // What is expected of it does not count.
        let noise = |most: f64| PhotographNoise {
            most,
            expected: most / 2.0,
        };
        let bound = bound_of(
            Some(0.03),
            (0.5, None),
            &ranges,
            Some(&[noise(0.0); 2]),
            0.0,
        );
        assert!(close(bound.promise, 0.04) && close(bound.range.unwrap(), 0.02));
        assert!(close(bound.limit, 0.06) && close(bound.doubt, 0.06));
        // Noise beyond 1.5 promises, and a viewpoint beyond 2.5, raise the doubt only.
        let one = |most, viewpoint| {
            bound_of(
                Some(0.03),
                (0.5, None),
                &[Some(0.04)],
                Some(&[noise(most)]),
                viewpoint,
            )
        };
        let noisy = one(1.0, 0.0);
        assert!(close(noisy.limit, 1.5 * 0.05_f64.hypot(0.075)));
        assert!(close(noisy.counted[0], 0.075) && close(one(0.0, 1.0).counted[1], 0.125));
        assert!(close(noisy.doubt, 1.5 * 0.05_f64.hypot(1.0)));
        assert!(close(one(0.0, 1.0).limit, 1.5 * 0.05_f64.hypot(0.125)));
        // A bound that is asked for, or half of the error before, is the limit as it is.
        for (predicted, given, limit) in [
            (Some(0.03), Some(0.02), 0.02),
            (None, None, 0.25),
            (None, Some(0.1), 0.1),
        ] {
            let bound = bound_of(predicted, (0.5, given), &ranges, None, 0.0);
            assert!(close(bound.limit, limit), "{bound:?}");
            assert!(close(bound.promise, limit / 1.5), "{bound:?}");
            assert_eq!((bound.expected, bound.noise), (None, None));
        }
        assert_eq!(
            bound_of(Some(0.03), (0.5, None), &[None], None, 0.0).range,
            None
        );
    }

    /// White as photographs of 2 x 2 cells in two channels show it.
    fn readings(white: Vec<CellPlanes>) -> Readings {
        let registration = Registration {
            camera: (0, 0),
            binning: 1,
            cell_of_pixel: Vec::new(),
            seen_cell: Vec::new(),
            centre: vec![None; 4],
        };
        Readings {
            shown: Vec::new(),
            fine: Vec::new(),
            revisited: CellReadings {
                grid: Grid::new(2, 2).unwrap(),
                channels: 2,
                live: vec![true; 4],
                left_out: Vec::new(),
                pixels_of_cells: vec![Vec::new(); 4],
                registration,
                gates: Vec::new(),
                cause: None,
                white,
                black: Vec::new(),
                noise: Vec::new(),
                pictures: Vec::new(),
                views: Vec::new(),
                step: 1,
                pixels: None,
                correspondences: Vec::new(),
            },
            live: vec![true; 4],
            wanted: false,
            expected_white: None,
            shifts: Vec::new(),
            exchanged: None,
            unseen: Vec::new(),
            flood: Vec::new(),
        }
    }

    #[test]
    fn the_camera_s_own_noise_is_smaller_in_darker_photographs_and_nothing_else_is() {
        // Four pixels a cell, and shot noise alone: .005 between two means of .5.
        let (shot, pixels, white, dark) = (1e-4, 4.0, 0.5, 0.125);
        let by_camera: f64 = shot * white / pixels;
        let noise_of = |times: f64, models: usize| {
            let off = times * (2.0 * by_camera).sqrt();
            let signs = [1.0, -1.0, -1.0, 1.0];
            let other: Vec<f64> = signs.iter().map(|sign| white + sign * off).collect();
            let mut readings = readings(vec![vec![vec![white; 4]; 3], vec![other; 3]]);
            readings.revisited.pixels_of_cells = vec![vec![0; 4]; 4];
            readings.revisited.noise = vec![NoiseModel { shot, floor: 0.0 }; models];
            let light = || vec![vec![dark; 4]; 3];
            readings.shown.push(Shown {
                image: 0,
                title: String::new(),
                clipped: 0.0,
                wanted: light(),
                input: [light(), light()],
                seen: [light(), light()],
                photos: [PathBuf::new(), PathBuf::new()],
                views: [None, None],
            });
            let noise = noise::of_compensated(&readings, &LiveCells::new(&[true; 4]));
            noise.unwrap()[0]
        };
        let near = |found: PhotographNoise, [most, expected]: [f64; 2]| {
            for (found, share) in [(found.most, most), (found.expected, expected)] {
                let wanted = (share * by_camera).sqrt() / dark;
                assert!((found / wanted - 1.0).abs() < 1e-3, "{found} {wanted}");
            }
        };
        // A quarter of white's light has a quarter of its shot noise.
        near(noise_of(1.0, 3), [1.0, 0.25]);
        // The model says more than photographs differ by: they are right.
        near(noise_of(0.5, 3), [0.25, 0.25 * 0.25]);
        // What the camera does not explain stays as large as in white.
        near(noise_of(2.0, 3), [4.0, 3.0 + 0.25]);
        near(noise_of(1.0, 0), [1.0, 1.0]);
    }

    #[test]
    fn white_changes_by_a_level_for_each_channel_and_a_shape_over_the_cells() {
        // The means of both photographs: .9 of what is expected, in one cell .99; .8 in the other
        // channel.
        let one = vec![vec![0.8, 0.8, 0.8, 0.89], vec![0.8; 4]];
        let other = vec![vec![1.0, 1.0, 1.0, 1.09], vec![0.8; 4]];
        let lit = LiveCells::new(&[true; 4]);
        let flood = vec![vec![0.5; 4]; 2];
        let change = white_change(&readings(vec![one, other]), &flood, 2.0, 2, &lit);
        assert!(close(change.level[0], 0.9) && close(change.level[1], 0.8));
        let near = |found: f64, wanted: f64| (found - wanted).abs() < 1e-6;
        assert!(near(change.shape, (0.01_f64 / 8.0).sqrt()));
        // A cell alone shares nothing with its neighbours; all of a row do.
        assert!(near(change.alone, change.shape));
        let row = vec![vec![0.9, 0.9, 0.99, 0.99], vec![0.9, 0.9, 0.99, 0.99]];
        let change = white_change(&readings(vec![row]), &flood, 2.0, 2, &lit);
        assert!(change.alone < 0.9 * change.shape, "{change:?}");
        let one = vec![vec![0.9, 0.9, 0.9, 0.99], vec![0.8; 4]];
        let change = white_change(&readings(vec![one]), &flood, 2.0, 2, &lit);
        // The mean over the channels.
        let cells: Vec<f64> = change.cells.iter().flatten().copied().collect();
        assert!(cells[..3].iter().all(|off| near(*off, 0.0)), "{cells:?}");
        assert!(near(cells[3], 0.05), "{cells:?}");
    }

    #[test]
    fn brightness_is_wanted_white_of_the_middle_image_over_the_projector_s_own() {
        let options = CompileOptions::default();
        let compiled = compile(&scene(1), None, &options).unwrap();
        let table = Table::check(&compiled.image).unwrap();
        let image = |white: f64| ImageVerdict {
            white,
            ..verdict([Vec::new(), Vec::new()])
        };
        let images = [0.2, 0.4, 0.3, 0.1, 0.5].map(image);
        let readings = readings(vec![vec![vec![0.5, 0.7, 0.6, 0.6]; 2]]);
        let lit = LiveCells::new(&[true; 4]);
        let found = brightness(&readings, &images, &mut Expected::new(&table), &lit);
        assert!(close(found, 0.3 / 0.6), "{found}");
    }

    fn verdict(cells: [Vec<Option<f64>>; 2]) -> ImageVerdict {
        ImageVerdict {
            image: 0,
            title: String::new(),
            clipped: 0.0,
            error: [0.0; 2],
            modelled: None,
            at_table_white: 0.0,
            white: 1.0,
            cells,
        }
    }

    #[test]
    fn a_cells_error_over_all_images_is_their_root_mean_square() {
        let one = verdict([vec![None, Some(0.5)], vec![Some(0.3), Some(0.0)]]);
        let other = verdict([vec![Some(1.0), Some(0.5)], vec![Some(0.4), Some(0.0)]]);
        let images = [one, other];
        let after = over_images(&images, 1);
        assert!(close(after[0].unwrap(), 0.125_f64.sqrt()), "{after:?}");
        assert_eq!(after[1], Some(0.0));
        assert_eq!(over_images(&images, 0), [None, Some(0.5)]);
        assert!(over_images(&[], 0).is_empty());
    }

    #[test]
    fn what_neighbours_share_is_the_mean_product_of_pairs_beside_and_below() {
        // 2 x 3 cells; the end of a row is no neighbour of the next one's begin.
        let cells = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(Some);
        let beside = 1.0 * 2.0 + 2.0 * 3.0 + 4.0 * 5.0 + 5.0 * 6.0;
        let below = 1.0 * 4.0 + 2.0 * 5.0 + 3.0 * 6.0;
        assert!(close(
            shared_by_neighbours(&cells, 3),
            (beside + below) / 7.0
        ));
        let apart = [Some(1.0), Some(-1.0), None];
        assert!(close(shared_by_neighbours(&apart, 3), 0.0));
    }
}
