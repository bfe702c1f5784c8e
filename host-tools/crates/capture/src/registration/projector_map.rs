//! Projector map: which place of the projector's picture each camera pixel sees, from stripes.
//!
//! | photographs | a position is known to |
//! |---|---|
//! | waves of `stripes.csv` (phase shifting, four steps) | a fraction of a pixel |
//! | Gray code finer than the cells | the finest stripe that the camera tells apart |
//! | images of the projector's own pixels | what their noise and contrast allow |
//! | none of these | about a part of a cell: linear between the cells' centres |
//!
//! The cell of each pixel is known. The bits beyond it halve the cell until less than half a wave
//! is left, and the phase of the waves says where within the wave. The steps' second harmonic,
//! which no wave has, says how large the noise is.

use super::cell_map::{NO_CELL, Registration};
use super::{gray_code, local_planes};
use crate::format::bracket::Bracket;
use crate::format::error::CaptureError;
use crate::format::photo_files::find_photo;
use crate::format::picture_file::{Opened, Source};
use crate::format::role::{CodeAxis, Role};
use crate::format::sequence::Sequence;
use crate::format::settings::ProjectorSettings;
use crate::format::stripe_role::{STRIPES_FILE, StripeManifest, StripeRole, WAVE, coarse_bits};
use crate::photographs::channel_sum;
use crate::photographs::linearise::LinearPhotographs;
use iltm_picture::progress::Progress;
use iltm_picture::statistics::median;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::path::Path;
use strum::IntoStaticStr;

/// Contrast of stripes, of white's light, from which they are believed: what only bounces to a
/// pixel has none.
const LEAST_CONTRAST: f32 = 0.1;

/// Uncertainty, projector pixels, up to which the position in a wave is one.
const MOST_UNCERTAIN: f32 = 0.5;

/// Projector pixels that a place is off where a camera sees each of them with about one of its
/// own: steps of light as wide as a pixel are no wave.
const BEATING: f32 = 0.06;

/// Pixels on each side over which the noise is averaged.
const NOISE_REACH: usize = 2;

/// How far waves may be off the middle of the half that the code says, in halves: beside a border
/// the neighbour's code is as good.
const MOST_APART: f32 = 0.25;

/// Part of a wave that a camera's pixel may cover: of one that it covers whole, nothing is seen.
/// Up to here waves say the place better than the code, by path-traced photographs.
const MOST_OF_WAVE: f32 = 0.9;

/// How many halves as the last bit tells apart a camera's pixel may cover: stripes are two wide, and
/// those of four give as much light as dark.
const MOST_OF_STRIPE: f32 = 3.0;

/// Share of the pixels that see the waves of an axis in which code and waves may contradict each
/// other.
const MOST_WRONG: f64 = 0.2;

/// Share of the projection that must see the waves of an axis to judge them.
const LEAST_JUDGED: f64 = 0.1;

/// What a map was made from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum MapSource {
    /// Waves, a few projector pixels long.
    Waves,
    /// Gray code finer than the cells.
    Code,
    /// Known images, by the light of each pixel over all of them.
    Images,
    /// The cells alone.
    Cells,
}

impl MapSource {
    /// Its name for programs.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Which place of the projector's picture each camera pixel sees.
#[derive(Clone, PartialEq, Debug)]
pub struct ProjectorMap {
    /// What it was made from.
    pub source: MapSource,
    /// The pixels of the projector's picture; of the patterns, where the projector's are not known.
    pub projector: ProjectorPixels,
    /// Width and height of the registered photographs in pixels.
    pub camera: (usize, usize),
    /// Side of the square of file pixels that one registered pixel averages.
    pub binning: usize,
    /// `[x, y]` in pixels of the projector's picture, the centre of the first being `[0, 0]`; NaN
    /// where nothing is known. Row by row, length `width * height`.
    pub position: Vec<[f32; 2]>,
    /// Standard error of a position in pixels, of both directions together; NaN where nothing is
    /// known. Same length. Of waves it is what noise and neighbouring pixels tell; elsewhere it is
    /// that of any place within the finest stripe that was told apart, or within the cell.
    pub uncertainty: Vec<f32>,
}

/// Why fine stripes gave no map.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum MapError {
    /// Photographs are missing; the first and how many.
    #[error("photographs of fine stripes are missing: {first}, {count} in all")]
    Missing {
        /// The first of them.
        first: String,
        /// How many.
        count: usize,
    },
    /// Lines of the list are missing.
    #[error("{STRIPES_FILE} has no {role}")]
    NotListed {
        /// What is missing.
        role: String,
    },
    /// The slides are smaller than the border, or than the cells.
    #[error("the slides of fine stripes have {0} x {1} pixels, which leaves none for some cells")]
    Slides(u32, u32),
    /// Code and waves say different places.
    #[error(
        "the fine stripes contradict each other in {percent:.0} % of the pixels: photographs are \
         out of order, or something moved between them"
    )]
    Contradiction {
        /// Share of the pixels that see the waves of an axis, %.
        percent: f64,
    },
}

impl MapError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Missing { .. } => {
                "Take them with `iltm capture`, which goes on where it stopped."
            }
            Self::NotListed { .. } | Self::Slides(..) => {
                "Make the capture folder again with `iltm patterns`."
            }
            Self::Contradiction { .. } => {
                "Take the photographs of stripes.csv again, with a longer wait before each."
            }
        }
    }
}

impl ProjectorMap {
    /// A position in cells of a grid over the picture, from the left and upper edge of the first.
    pub(crate) fn in_cells(&self, [x, y]: [f32; 2], grid: Grid) -> [f32; 2] {
        let inner = self.projector.inner();
        let first = f32::from(self.projector.border()) - 0.5;
        [
            (x - first) * grid.cols() as f32 / inner.width() as f32,
            (y - first) * grid.rows() as f32 / inner.height() as f32,
        ]
    }

    /// Pixels whose position is known.
    #[must_use]
    pub fn known(&self) -> usize {
        let known = self.uncertainty.iter().filter(|known| !known.is_nan());
        known.count()
    }

    /// Median of the known uncertainties; `None` if nothing is known.
    #[must_use]
    pub fn usual_uncertainty(&self) -> Option<f32> {
        let known = self.uncertainty.iter().filter(|known| !known.is_nan());
        median(known.map(|known| f64::from(*known)).collect()).map(|median| median as f32)
    }
}

/// Standard deviation of a place of which only the stripe is known, in one direction.
pub(crate) fn within(side: f32) -> f32 {
    side / 12.0_f32.sqrt()
}

/// What the photographs of one axis show.
struct AxisLight {
    /// Pattern minus inverse of each bit beyond the cells'.
    bits: Vec<Vec<f32>>,
    /// Waves, if there are any.
    waves: Option<WaveLight>,
}

/// What the photographs of the waves of one axis show.
struct WaveLight {
    /// First step minus third, and second minus fourth.
    wave: [Vec<f32>; 2],
    /// First minus second plus third minus fourth: nothing but noise.
    rest: Vec<f32>,
}

/// Places along one axis.
struct Axis<'a> {
    /// Which of the two.
    along: CodeAxis,
    /// Number of the first cell in its code.
    offset: usize,
    /// Side of what the bits of `light` leave of a cell, pixels.
    side: f32,
    /// Where number 0 would begin, pixels before the first.
    before: f32,
    light: &'a AxisLight,
    /// Standard deviation of the light of a pixel in one photograph, around each pixel.
    noise: Vec<f32>,
}

/// A place along an axis.
struct Place {
    at: f32,
    uncertainty: f32,
    /// Whether code and waves agree; `None` where the camera sees no wave.
    agrees: Option<bool>,
}

/// Fine stripes: what was shown and how it was photographed.
struct Fine {
    roles: Vec<StripeRole>,
    light: Vec<Vec<f32>>,
}

/// Decodes stripes that are finer than the cells; `None` if there are none.
///
/// # Errors
/// A manifest's or a photograph's own error; [`CaptureError::Unlike`] if they are not of the
/// capture's kind.
pub(crate) fn decode(
    folder: &Path,
    sequence: &Sequence,
    settings: &ProjectorSettings,
    linear: &LinearPhotographs<'_>,
    registration: &Registration,
    progress: &dyn Progress,
) -> Result<Option<Result<DecodedStripes, MapError>>, CaptureError> {
    let list = (sequence.part.as_ref()).map_or(STRIPES_FILE, |part| &part.stripes);
    match StripeManifest::read_named(folder, list)? {
        Some(manifest) => {
            let list = folder.join(list);
            let of = (list.as_path(), sequence, settings);
            let found = listed(folder, of, manifest, linear, progress)?;
            Ok(Some(found.map(|found| {
                let pixel = registration.pixel_in_cells(sequence.grid);
                found.told_apart(pixel.map(|pixel| pixel as f32))
            })))
        }
        None if sequence.finer.is_empty() => Ok(None),
        None => left_out(folder, sequence, linear, progress).map(Some),
    }
}

/// All that a map is made from.
pub(crate) struct DecodedStripes {
    projector: ProjectorPixels,
    /// Columns of cells.
    cols: usize,
    /// Side of what the bits leave of a cell, where number 0 would begin, and the number of the
    /// first cell, by axis.
    scale: [(f32, f32, usize); 2],
    light: [AxisLight; 2],
}

/// Stripes of a `list`.
fn listed(
    folder: &Path,
    (list, sequence, settings): (&Path, &Sequence, &ProjectorSettings),
    manifest: StripeManifest,
    linear: &LinearPhotographs<'_>,
    progress: &dyn Progress,
) -> Result<Result<DecodedStripes, MapError>, CaptureError> {
    let all = manifest.shots.len();
    let (mut shots, mut missing) = (Vec::new(), None);
    for mut shot in manifest.shots {
        match find_photo(folder, &shot.photo)? {
            Some(found) => {
                shot.photo = found;
                shots.push(shot);
            }
            None => missing = missing.or_else(|| Some(shot.photo.display().to_string())),
        }
    }
    if let Some(first) = missing {
        let count = all - shots.len();
        return Ok(Err(MapError::Missing { first, count }));
    }
    let Some(slide) = shots.first() else {
        let (axis, bit) = (CodeAxis::Column, coarse_bits(sequence.grid.cols()));
        let inverse = false;
        return Ok(Err(not_listed(StripeRole::Code { axis, bit, inverse })));
    };
    let picture = Opened::open(Source {
        path: &folder.join(&slide.pattern),
        what: "pattern",
        line: slide.line,
    })?;
    let (width, height) = picture.size();
    let side = |side: u32| u16::try_from(side).unwrap_or(0);
    let mut size = FrameSize::new(side(width), side(height));
    if let Some(part) = &sequence.part {
        size = size.and_then(|wide| part.pixels(wide));
    }
    let projector = size.and_then(|size| ProjectorPixels::new(size, settings.border));
    let cells = [sequence.grid.cols(), sequence.grid.rows()];
    let inner = projector.map(ProjectorPixels::inner);
    let inner = inner.map_or([0; 2], |inner| [inner.width(), inner.height()]);
    let enough = (0..2).all(|axis| inner[axis] >= cells[axis]);
    let Some(projector) = projector.filter(|_| enough) else {
        return Ok(Err(MapError::Slides(width, height)));
    };
    let brackets = Bracket::of_list(&shots, list, sequence.longest)?;
    let fine = Fine {
        roles: shots.iter().map(|shot| shot.role).collect(),
        light: light(folder, brackets, linear, progress)?,
    };
    let along = |axis: CodeAxis, at: usize| fine.axis(axis, cells[at], inner[at], linear);
    let light = along(CodeAxis::Column, 0).and_then(|x| Ok([x, along(CodeAxis::Row, 1)?]));
    Ok(light.map(|light| {
        let scale = [0, 1].map(|at: usize| {
            let parts = cells[at] << light[at].bits.len();
            (inner[at] as f32 / parts as f32, 0.0, 0)
        });
        DecodedStripes {
            projector,
            cols: cells[0],
            scale,
            light,
        }
    }))
}

/// Stripes of `capture.csv` that were left out because no table has so many cells.
fn left_out(
    folder: &Path,
    sequence: &Sequence,
    linear: &LinearPhotographs<'_>,
    progress: &dyn Progress,
) -> Result<Result<DecodedStripes, MapError>, CaptureError> {
    let stripe = |bracket: &Bracket| {
        let (axis, bit, inverse) = bracket.shots.first()?.role.as_stripe()?;
        Some(StripeRole::Code { axis, bit, inverse })
    };
    let roles: Vec<Option<StripeRole>> = sequence.finer.iter().map(stripe).collect();
    let brackets = sequence.finer.iter().zip(&roles);
    let brackets = brackets.filter(|(_, role)| role.is_some());
    let brackets = brackets.map(|(bracket, _)| bracket.clone()).collect();
    let fine = Fine {
        light: light(folder, brackets, linear, progress)?,
        roles: roles.into_iter().flatten().collect(),
    };
    let axes = [CodeAxis::Column, CodeAxis::Row];
    let light = [0, 1].map(|at: usize| AxisLight {
        bits: fine.bits(axes[at], sequence.codes[at].bits, linear),
        waves: None,
    });
    let scale = [0, 1].map(|at: usize| {
        let missing = usize::from(sequence.coarser).saturating_sub(light[at].bits.len());
        let offset = sequence.shown[at].1.offset;
        let side = (1_usize << missing) as f32;
        (side, offset as f32, sequence.codes[at].offset)
    });
    let [width, height] = [0, 1].map(|at: usize| sequence.shown[at].0);
    let size = FrameSize::new(width as u16, height as u16);
    let Some(size) = size else {
        return Ok(Err(MapError::Slides(width as u32, height as u32)));
    };
    Ok(Ok(DecodedStripes {
        projector: ProjectorPixels::whole(size),
        cols: sequence.grid.cols(),
        scale,
        light,
    }))
}

fn not_listed(role: StripeRole) -> MapError {
    let role = role.to_string();
    MapError::NotListed { role }
}

/// Light of each photograph, channels added.
fn light(
    folder: &Path,
    brackets: Vec<Bracket>,
    linear: &LinearPhotographs<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Vec<f32>>, CaptureError> {
    if brackets.is_empty() {
        return Ok(Vec::new());
    }
    let count = brackets.len();
    let mut photographs = linear.others(folder, brackets)?.read_once();
    progress.begin("reading fine stripes", count as u64);
    let mut light = vec![Vec::new(); count];
    let all: Vec<usize> = (0..count).collect();
    photographs.for_batches(&all, progress, |photos| {
        for (at, photo) in photos {
            light[*at] = channel_sum(&photo.planes);
        }
    })?;
    progress.end();
    Ok(light)
}

fn minus(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

impl Fine {
    fn of(&self, role: StripeRole) -> Option<&[f32]> {
        let at = self.roles.iter().position(|known| *known == role)?;
        Some(&self.light[at])
    }

    /// Pattern minus inverse of the bits of an axis from `first` on, as far as they were
    /// photographed.
    fn bits(&self, axis: CodeAxis, first: u8, linear: &LinearPhotographs<'_>) -> Vec<Vec<f32>> {
        let middle = linear.middle();
        let difference = |bit: u8| {
            let of = |inverse| self.of(StripeRole::Code { axis, bit, inverse });
            gray_code::difference(of(false), of(true), &middle)
        };
        (first..Role::MAX_BITS).map_while(difference).collect()
    }

    /// Bits and waves of an axis with so many cells over so many pixels.
    fn axis(
        &self,
        axis: CodeAxis,
        cells: usize,
        pixels: usize,
        linear: &LinearPhotographs<'_>,
    ) -> Result<AxisLight, MapError> {
        let first = coarse_bits(cells);
        let bits = self.bits(axis, first, linear);
        let step = |step: u8| StripeRole::Wave { axis, step };
        let steps = [0, 1, 2, 3].map(|at| self.of(step(at)));
        let waves = match steps {
            [None, None, None, None] => None,
            [Some(first), Some(second), Some(third), Some(fourth)] => {
                let wave = [minus(first, third), minus(second, fourth)];
                let others = minus(third, fourth);
                let pairs = minus(first, second).into_iter().zip(others);
                let rest = pairs.map(|(a, b)| a + b).collect();
                Some(WaveLight { wave, rest })
            }
            _ => {
                let missing = (0..4).find(|at| steps[usize::from(*at)].is_none());
                return Err(not_listed(step(missing.unwrap_or(0))));
            }
        };
        // Waves alone do not tell which wave it is, and nothing at all tells nothing.
        let needed = StripeRole::of_axis(axis, cells, pixels).1 - first;
        let given = bits.len() as u8;
        if given < needed && (waves.is_some() || given == 0) {
            let bit = first + given;
            let inverse = false;
            return Err(not_listed(StripeRole::Code { axis, bit, inverse }));
        }
        Ok(AxisLight { bits, waves })
    }
}

impl DecodedStripes {
    /// Leaves out what is too fine for a camera whose pixel covers `covered` cells along their
    /// width and height: its contrast is there by chance, or turned round.
    fn told_apart(mut self, covered: [f32; 2]) -> Self {
        let axes = self.light.iter_mut().zip(&mut self.scale);
        for ((light, (side, _, _)), covered) in axes.zip(covered) {
            let halves = |bits: usize| (1_u32 << bits) as f32;
            let pixel = *side * halves(light.bits.len()) * covered;
            if pixel > MOST_OF_WAVE * WAVE as f32 {
                light.waves = None;
            }
            while !light.bits.is_empty() && pixel > MOST_OF_STRIPE * *side {
                light.bits.pop();
                *side *= 2.0;
            }
        }
        self
    }

    /// Contrast of the stripes that each camera pixel shows, of white's light: the largest of all that
    /// the camera tells apart. What only bounces to a pixel has next to none.
    pub(crate) fn contrast(&self, linear: &LinearPhotographs<'_>) -> Vec<f32> {
        let of = |(pixel, white): (usize, &f32)| {
            let of_axis = |light: &AxisLight| {
                let bits = light.bits.iter().map(|bit| bit[pixel].abs());
                let waves = light.waves.iter().map(|waves| waves.size(pixel));
                bits.chain(waves).fold(0.0, f32::max)
            };
            self.light.iter().map(of_axis).fold(0.0, f32::max) / white
        };
        linear
            .flood_light()
            .pixels
            .iter()
            .enumerate()
            .map(of)
            .collect()
    }

    /// The map of all pixels that see a cell: both axes together.
    ///
    /// # Errors
    /// [`MapError::Contradiction`] where the waves are not at the places that the code says.
    pub(crate) fn map(
        &self,
        registration: &Registration,
        linear: &LinearPhotographs<'_>,
    ) -> Result<ProjectorMap, MapError> {
        let flood = linear.flood_light().pixels;
        let camera = registration.camera;
        let axes = [CodeAxis::Column, CodeAxis::Row];
        let axes = [0, 1].map(|at: usize| {
            let (light, (side, before, offset)) = (&self.light[at], self.scale[at]);
            let waves = light.waves.as_ref();
            Axis {
                along: axes[at],
                offset,
                side,
                before,
                light,
                noise: waves.map_or_else(Vec::new, |waves| waves.noise(camera)),
            }
        });
        let found = |pixel: usize| {
            let cell = registration.seen_cell[pixel];
            if cell == NO_CELL {
                return None;
            }
            let place = |axis: &Axis<'_>| {
                let cell = match axis.along {
                    CodeAxis::Column => cell as usize % self.cols,
                    CodeAxis::Row => cell as usize / self.cols,
                };
                axis.place(cell, pixel, flood[pixel])
            };
            Some([place(&axes[0]), place(&axes[1])])
        };
        let found: Vec<Option<[Place; 2]>> = (0..registration.seen_cell.len())
            .into_par_iter()
            .map(found)
            .collect();
        let in_waves = |place: &[Place; 2]| place.iter().all(|axis| axis.agrees.is_some());
        let contradicts = |place: &[Place; 2]| place.iter().any(|at| at.agrees == Some(false));
        let seen = || found.iter().flatten();
        let waves = seen().filter(|place| in_waves(place)).count();
        for axis in 0..2 {
            let agrees = seen().filter_map(|place| place[axis].agrees);
            let (all, wrong) = agrees.fold((0_usize, 0_usize), |(all, wrong), agrees| {
                (all + 1, wrong + usize::from(!agrees))
            });
            // A camera that sees waves in a few places sees them there by chance.
            let judged = all as f64 > LEAST_JUDGED * seen().count() as f64;
            if judged && wrong as f64 > MOST_WRONG * all as f64 {
                let percent = 100.0 * wrong as f64 / all as f64;
                return Err(MapError::Contradiction { percent });
            }
        }
        let source = if 2 * waves > seen().count() {
            MapSource::Waves
        } else {
            MapSource::Code
        };
        let known = |place: &Option<[Place; 2]>| {
            let place = place.as_ref().filter(|place| !contradicts(place))?;
            let own = place[0].uncertainty.hypot(place[1].uncertainty);
            Some((own, in_waves(place)))
        };
        let known: Vec<Option<(f32, bool)>> = found.iter().map(known).collect();
        let shift = f32::from(self.projector.border()) - 0.5;
        let at =
            |place: &Option<[Place; 2]>| place.as_ref().map(|[x, y]| [x.at + shift, y.at + shift]);
        let places = found.iter().zip(&known);
        let mut position: Vec<_> = places
            .map(|(place, known)| at(place).filter(|_| known.is_some()))
            .collect();
        let left = local_planes::settle(&mut position, camera);
        let uncertainty = known
            .iter()
            .zip(left)
            .map(|(known, left)| match (*known, left) {
                (None, _) => f32::NAN,
                (Some((own, true)), Some(left)) => left.max(own).hypot(BEATING),
                // Anywhere within a pixel of the projector.
                (Some((own, true)), None) => own.hypot(within(1.0)).hypot(within(1.0)),
                (Some((own, false)), left) => left.unwrap_or(0.0).max(own),
            });
        let uncertainty = uncertainty.collect();
        let position = position.into_iter();
        let position = position
            .map(|place| place.unwrap_or([f32::NAN; 2]))
            .collect();
        Ok(ProjectorMap {
            source,
            projector: self.projector,
            camera,
            binning: registration.binning,
            position,
            uncertainty,
        })
    }
}

impl Axis<'_> {
    /// Middle and side of the stripe that the first `bits` bits say, pixels.
    fn stripe(&self, cell: usize, pixel: usize, bits: usize) -> (f32, f32) {
        let mut number = cell + self.offset;
        for bit in &self.light.bits[..bits] {
            let lit = usize::from(bit[pixel] > 0.0);
            number = number << 1 | ((number & 1) ^ lit);
        }
        let side = self.side * (1_u32 << (self.light.bits.len() - bits)) as f32;
        ((number as f32 + 0.5) * side - self.before, side)
    }

    /// The place that a pixel with this light under white sees.
    fn place(&self, cell: usize, pixel: usize, flood: f32) -> Place {
        let waves = self.light.waves.as_ref();
        let in_wave = waves.and_then(|waves| self.in_wave(waves, cell, pixel, flood));
        in_wave.unwrap_or_else(|| self.in_stripe(cell, pixel, flood))
    }

    /// The same by the code alone.
    fn in_stripe(&self, cell: usize, pixel: usize, flood: f32) -> Place {
        // A border between two stripes may have any bit; after the last one that has contrast, the
        // camera sees none.
        let seen = |bit: &Vec<f32>| bit[pixel].abs() >= LEAST_CONTRAST * flood;
        let told = self.light.bits.iter().rposition(seen);
        let (at, side) = self.stripe(cell, pixel, told.map_or(0, |last| last + 1));
        Place {
            at,
            uncertainty: within(side),
            agrees: None,
        }
    }

    /// The same by waves; `None` where the camera sees none.
    fn in_wave(&self, waves: &WaveLight, cell: usize, pixel: usize, flood: f32) -> Option<Place> {
        let size = waves.size(pixel);
        if size < LEAST_CONTRAST * flood {
            return None;
        }
        let (middle, side) = self.stripe(cell, pixel, self.light.bits.len());
        let wave = WAVE as f32;
        let uncertainty = wave / TAU * 2.0_f32.sqrt() * self.noise[pixel] / size;
        let [re, im] = [0, 1].map(|part: usize| waves.wave[part][pixel]);
        let phase = im.atan2(re) / TAU * wave;
        let at = phase + wave * ((middle - phase) / wave).round();
        (uncertainty < MOST_UNCERTAIN).then_some(Place {
            at,
            uncertainty,
            agrees: Some((at - middle).abs() <= (0.5 + MOST_APART) * side),
        })
    }
}

impl WaveLight {
    /// Size of the wave that a pixel shows: opposite steps differ by all the light that comes straight
    /// from the projector.
    fn size(&self, pixel: usize) -> f32 {
        self.wave[0][pixel].hypot(self.wave[1][pixel])
    }

    /// Standard deviation of the light of a pixel in one photograph, around each pixel.
    fn noise(&self, (width, height): (usize, usize)) -> Vec<f32> {
        let around =
            |at: usize, of: usize| at.saturating_sub(NOISE_REACH)..(at + NOISE_REACH + 1).min(of);
        let at = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width);
            let rows = around(y, height);
            let all = rows.flat_map(|y| self.rest[y * width..][around(x, width)].iter());
            let (sum, count) = all.fold((0.0_f32, 0.0_f32), |(sum, count), rest| {
                (sum + rest * rest, count + 1.0)
            });
            // Four photographs are in it.
            0.5 * (sum / count).sqrt()
        };
        (0..width * height).into_par_iter().map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of 96 pixels, halved four times, and waves.
    fn decoding() -> DecodedStripes {
        let light = || AxisLight {
            bits: vec![Vec::new(); 4],
            waves: Some(WaveLight {
                wave: [Vec::new(), Vec::new()],
                rest: Vec::new(),
            }),
        };
        DecodedStripes {
            projector: ProjectorPixels::whole(FrameSize::new(960, 960).unwrap()),
            cols: 10,
            scale: [(6.0, 0.0, 0); 2],
            light: [light(), light()],
        }
    }

    #[test]
    fn a_coarse_camera_is_asked_for_no_stripes_finer_than_its_pixels() {
        for (pixels, waves, bits, side) in [
            (48.0, true, 4, 6.0),
            (14.0, true, 4, 6.0),
            (13.0, false, 4, 6.0),
            (6.0, false, 4, 6.0),
            (5.0, false, 3, 12.0),
            (1.0, false, 1, 48.0),
        ] {
            let found = decoding().told_apart([1.0 / pixels; 2]);
            for (light, (own, _, _)) in found.light.iter().zip(found.scale) {
                let told = (light.waves.is_some(), light.bits.len());
                assert_eq!(told, (waves, bits), "{pixels}");
                assert!((own - side).abs() < 1e-6, "{pixels}");
            }
        }
    }
}
