//! Captures of several projectors that light one scene, each taken while the others were dark,
//! as one capture of a wide frame: their frames side by side.
//!
//! Every projector is registered by its own photographs. The cells of all are then measured in
//! the photographs of each, because what one projector shows lights the others' cells: directly,
//! where they overlap, and by bounces everywhere.

use crate::cells::CellEvidence;
use crate::cells::cell_pixels::CellPixels;
use crate::cells::measurements::{ChannelMeasurements, Measurements};
use crate::format::error::CaptureError;
use crate::format::sequence::{CaptureOptions, Sequence};
use crate::gate::Gate;
use crate::gates::between;
use crate::photographs::linearise::LinearPhotographs;
use crate::photographs::sampled::Sampled;
use crate::registration::black_shift;
use crate::registration::cell_map::{NO_CELL, Registration};
use crate::registration::projector_map::ProjectorMap;
use iltm_picture::progress::Progress;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};
use nalgebra::DMatrix;
use std::ops::Range;
use std::path::PathBuf;

/// Samples along a cell's sides by which its share is worked out.
const SHARE_SAMPLES: usize = 4;

/// Part of a cell's camera pixels that another projector must light to overlap with it.
const LEAST_OVERLAP: f64 = 0.02;

/// Captures of several projectors, and all of them as one.
#[derive(Clone, Debug)]
pub struct SeveralCaptures {
    /// Of the wide frame. The columns of patterns and observations are those of the first
    /// projector's photographs, then the second's and so on; a pattern is dark where others show.
    /// Where projectors overlap, a camera pixel belongs to the one with the largest share. The light
    /// of single pixels is that of the first capture.
    pub all: Measurements,
    /// The projectors, from left to right in the wide frame.
    pub projectors: Vec<OneOfSeveral>,
    /// Cells of other projectors that light the same place directly, by cell of the wide frame,
    /// length `N`; empty where nothing overlaps.
    pub overlaps: Vec<Vec<usize>>,
    /// Share of each projector at each camera pixel.
    pixel_shares: Vec<Vec<f32>>,
}

/// One of several projectors.
#[derive(Clone, Debug)]
pub struct OneOfSeveral {
    /// Its own capture.
    pub own: Measurements,
    /// Its columns of cells in the wide frame.
    pub columns: Range<usize>,
    /// The columns of its photographs in [`ChannelMeasurements::patterns`] of all.
    pub views: Range<usize>,
}

/// Reads the captures of several projectors, from left to right in the wide frame.
///
/// # Errors
/// Those of [`read`](crate::read) for each; [`CaptureError::Unlike`] where captures are not of
/// one camera, or frames that do not fit beside each other.
pub fn read_several(
    folders: &[PathBuf],
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<SeveralCaptures, CaptureError> {
    for (at, folder) in folders.iter().enumerate() {
        let same = |other: &PathBuf| match (other.canonicalize(), folder.canonicalize()) {
            (Ok(other), Ok(own)) => other == own,
            _ => false,
        };
        if folders[..at].iter().any(same) {
            return Err(CaptureError::Unlike {
                path: folder.clone(),
                reason: "given twice".to_owned(),
                next_step: "Name the capture of each projector once, from left to right.",
            });
        }
    }
    let (mut own, mut sequences, mut photographs) = (Vec::new(), Vec::new(), Vec::new());
    for folder in folders {
        let (measurements, (sequence, mut linear)) =
            crate::read_keeping(folder, options, progress)?;
        // The others need the room.
        linear.photographs.leave_memory();
        own.push(measurements);
        sequences.push(sequence);
        photographs.push(linear);
    }
    let wide = WideFrame::new(folders, own)?;
    let gates = wide.gates(folders, &photographs);
    let failed = gates.iter().filter(|(_, gate)| options.refuses(gate));
    let failed: Vec<_> = failed.cloned().collect();
    if let Some((at, _)) = failed.first() {
        return Err(CaptureError::Refused {
            path: folders[*at].clone(),
            gates: failed.into_iter().map(|(_, gate)| gate).collect(),
        });
    }
    let pixels = wide.pixels(&photographs);
    let registration = wide.registration();
    let mut measured = Vec::new();
    for (index, (sequence, linear)) in sequences.iter().zip(&mut photographs).enumerate() {
        let sequence = wide.sequence(index, sequence);
        let sampled = Sampled::take(&mut linear.photographs, sequence.shots.len(), progress)?;
        let cells = CellEvidence::measure(
            &sequence,
            (&mut linear.photographs, None),
            &registration,
            (&pixels, &linear.saturated),
            &sampled,
            None,
            progress,
        )?;
        measured.push(cells.channels);
    }
    let mut several = wide.joined(&measured, &pixels, registration);
    let gates = gates.into_iter().map(|(_, gate)| gate);
    several.all.diagnostics.gates.extend(gates);
    Ok(several)
}

/// The frames of all projectors side by side.
struct WideFrame {
    grid: Grid,
    own: Vec<Measurements>,
    columns: Vec<Range<usize>>,
    pixel_shares: Vec<Vec<f32>>,
}

impl WideFrame {
    fn new(folders: &[PathBuf], own: Vec<Measurements>) -> Result<Self, CaptureError> {
        let first = &own[0];
        for (folder, other) in folders.iter().zip(&own) {
            let refuse = |reason: String, next_step| {
                Err(CaptureError::Unlike {
                    path: folder.clone(),
                    reason,
                    next_step,
                })
            };
            let camera = |of: &Measurements| (of.registration.camera, of.registration.binning);
            if camera(first) != camera(other) || first.channels.len() != other.channels.len() {
                let reason = format!("other photographs than in {}", folders[0].display());
                return refuse(
                    reason,
                    "Photograph all projectors with one camera that stays.",
                );
            }
            if first.grid.rows() != other.grid.rows() {
                let (rows, others) = (first.grid.rows(), other.grid.rows());
                let reason = format!("{others} rows of cells beside {rows}");
                return refuse(
                    reason,
                    "Make patterns with the same --rows for all projectors.",
                );
            }
            let cell = |of: &Measurements| {
                let pixels = of.settings.projector.pixels()?;
                let (inner, grid) = (pixels.inner(), of.grid);
                let whole = pixels.border() == 0 && inner.width() % grid.cols() == 0;
                let width = whole.then(|| inner.width() / grid.cols());
                Some((width, inner.height()))
            };
            let fits = matches!(cell(other), None | Some((Some(_), _)));
            if cell(first) != cell(other) || !fits {
                let reason = "its cells have not as many pixels as those of the others, or a \
                              border lies around them"
                    .to_owned();
                let next_step = "Use projectors of one height without a border, and columns that \
                                 divide their widths into cells of the same number of pixels.";
                return refuse(reason, next_step);
            }
            if other.diagnostics.images > 0 {
                let reason = "it has photographs of images".to_owned();
                return refuse(reason, "Use Bernoulli patterns for several projectors.");
            }
        }
        let mut columns = Vec::new();
        let mut cols = 0;
        for own in &own {
            columns.push(cols..cols + own.grid.cols());
            cols += own.grid.cols();
        }
        let side = |side: usize| u16::try_from(side).unwrap_or(u16::MAX);
        let grid =
            Grid::new(side(first.grid.rows()), side(cols)).map_err(|_| CaptureError::Unlike {
                path: folders[0].clone(),
                reason: format!("{} x {cols} cells in all", first.grid.rows()),
                next_step: "Make patterns with fewer cells.",
            })?;
        Ok(Self {
            pixel_shares: pixel_shares(&own),
            grid,
            own,
            columns,
        })
    }

    /// The cell in the wide frame of a projector's own.
    fn place(&self, projector: usize, cell: usize) -> usize {
        let cols = self.own[projector].grid.cols();
        cell / cols * self.grid.cols() + self.columns[projector].start + cell % cols
    }

    /// The projector of a cell, and its number there.
    fn own_cell(&self, cell: usize) -> (usize, usize) {
        let (row, col) = (cell / self.grid.cols(), cell % self.grid.cols());
        let projector = self.columns.iter().position(|all| all.contains(&col));
        let projector = projector.expect("all columns are a projector's");
        let columns = &self.columns[projector];
        (projector, row * columns.len() + col - columns.start)
    }

    /// An entry a cell from those of each projector's own cells.
    fn of_cells<T>(&self, of: impl Fn(usize, usize) -> T) -> Vec<T> {
        let cells = 0..self.grid.cells();
        cells
            .map(|cell| {
                let (projector, own) = self.own_cell(cell);
                of(projector, own)
            })
            .collect()
    }

    /// The patterns of one projector with the others dark.
    fn sequence(&self, projector: usize, own: &Sequence) -> Sequence {
        let mut wide = own.clone();
        wide.grid = self.grid;
        for view in &mut wide.views {
            let lit = std::mem::take(&mut view.lit);
            view.lit = self.of_cells(|of, cell| of == projector && lit[cell]);
        }
        wide
    }

    /// Pixels of all cells; one may be of a cell of each projector.
    fn pixels(&self, photographs: &[LinearPhotographs<'_>]) -> CellPixels {
        let own = self.own.iter().zip(photographs);
        let own: Vec<CellPixels> = own
            .map(|(own, linear)| CellPixels::choose(&own.registration, &linear.saturated))
            .collect();
        CellPixels::joined(&self.of_cells(|projector, cell| (&own[projector], cell)))
    }

    /// Judges whether the captures belong together; each gate with the capture that it is of.
    fn gates(
        &self,
        folders: &[PathBuf],
        photographs: &[LinearPhotographs<'_>],
    ) -> Vec<(usize, Gate)> {
        let names: Vec<String> = (folders.iter())
            .map(|folder| folder.display().to_string())
            .collect();
        let registration = &self.own[0].registration;
        let (width, binning) = (registration.camera.0, registration.binning);
        let cell = binning as f64 * registration.cell_side();
        let pair = |first: usize, other: usize| between::Pair {
            first: &names[first],
            other: &names[other],
        };
        let black = photographs[0].black_as_seen();
        let mut gates = Vec::new();
        for (other, linear) in photographs.iter().enumerate().skip(1) {
            let own = linear.black_as_seen();
            let shift = black_shift::find(&black, &own, width);
            let movement = between::movement(&pair(0, other), (binning, cell), shift);
            let brighter = black_shift::brighter(&black, &own);
            gates.push((other, movement));
            gates.push((other, between::black(&pair(0, other), brighter)));
        }
        for (other, shares) in self.pixel_shares.iter().enumerate() {
            let same = (0..other).filter_map(|first| {
                let same = same_places(&self.own[first], &self.own[other]);
                between::same_projector(&pair(first, other), same)
            });
            let reached = shares.iter().filter(|share| **share > 0.0);
            let shared = reached.clone().filter(|share| **share < 1.0).count();
            let shared = shared as f64 / reached.count().max(1) as f64;
            let found = same.chain(between::shared(&names[other], shared));
            gates.extend(found.map(|gate| (other, gate)));
        }
        gates
    }

    /// The projector with the largest share of each camera pixel.
    fn owners(&self) -> Vec<Option<usize>> {
        let shares = &self.pixel_shares;
        let owner = |pixel: usize| {
            let shares = shares.iter().map(|shares| shares[pixel]).enumerate();
            let most = shares.max_by(|(_, a), (_, b)| a.total_cmp(b));
            most.filter(|(_, share)| *share > 0.0)
                .map(|(projector, _)| projector)
        };
        (0..shares[0].len()).map(owner).collect()
    }

    fn registration(&self) -> Registration {
        let owners = self.owners();
        let labels = |of: fn(&Registration) -> &Vec<u32>| {
            let pixels = owners.iter().enumerate();
            let label = |(pixel, owner): (usize, &Option<usize>)| {
                let Some(projector) = *owner else {
                    return NO_CELL;
                };
                match of(&self.own[projector].registration)[pixel] {
                    NO_CELL => NO_CELL,
                    cell => self.place(projector, cell as usize) as u32,
                }
            };
            pixels.map(label).collect()
        };
        Registration {
            cell_of_pixel: labels(|registration| &registration.cell_of_pixel),
            seen_cell: labels(|registration| &registration.seen_cell),
            centre: self.of_cells(|projector, cell| self.own[projector].registration.centre[cell]),
            ..self.own[0].registration.clone()
        }
    }

    /// The projector map of the wide frame, if all projectors have one.
    fn map(&self) -> Option<ProjectorMap> {
        let maps = self.own.iter().map(|own| match &own.map {
            Some(Ok(map)) => Some(map),
            _ => None,
        });
        let maps: Vec<&ProjectorMap> = maps.collect::<Option<_>>()?;
        let size = |of: fn(FrameSize) -> usize, map: &ProjectorMap| of(map.projector.size());
        let width: usize = maps.iter().map(|map| size(FrameSize::width, map)).sum();
        let height = size(FrameSize::height, maps[0]);
        let frame = FrameSize::new(u16::try_from(width).ok()?, u16::try_from(height).ok()?)?;
        let mut before = Vec::new();
        let mut pixels = 0;
        for map in &maps {
            before.push(pixels as f32);
            pixels += size(FrameSize::width, map);
        }
        let unknown = ([f32::NAN; 2], f32::NAN);
        let place = |(pixel, owner): (usize, Option<usize>)| {
            owner.map_or(unknown, |projector| {
                let [x, y] = maps[projector].position[pixel];
                let place = [x + before[projector], y];
                (place, maps[projector].uncertainty[pixel])
            })
        };
        let (position, uncertainty) = self.owners().into_iter().enumerate().map(place).unzip();
        Some(ProjectorMap {
            projector: ProjectorPixels::new(frame, 0)?,
            position,
            uncertainty,
            ..maps[0].clone()
        })
    }

    /// Cells of other projectors that light the same place, by cell.
    fn overlaps(&self, pixels: &CellPixels) -> Vec<Vec<usize>> {
        let of_cell = |(cell, pixels): (usize, &[u32])| {
            let (own, _) = self.own_cell(cell);
            let mut found = Vec::new();
            for (projector, other) in self.own.iter().enumerate().filter(|(at, _)| *at != own) {
                let seen = &other.registration.seen_cell;
                let labels = pixels.iter().map(|pixel| seen[*pixel as usize]);
                let mut labels: Vec<u32> = labels.filter(|cell| *cell != NO_CELL).collect();
                if (labels.len() as f64) < LEAST_OVERLAP * pixels.len() as f64 {
                    continue;
                }
                labels.sort_unstable();
                labels.dedup();
                let places = labels.iter();
                found.extend(places.map(|label| self.place(projector, *label as usize)));
            }
            found
        };
        pixels.of_cells().enumerate().map(of_cell).collect()
    }

    /// Everything as one capture.
    fn joined(
        self,
        measured: &[Vec<ChannelMeasurements>],
        pixels: &CellPixels,
        registration: Registration,
    ) -> SeveralCaptures {
        let mut all = self.own[0].clone();
        let mut views = Vec::new();
        let mut before = 0;
        for own in &self.own {
            views.push(before..before + own.roles.len());
            before += own.roles.len();
        }
        all.grid = self.grid;
        all.roles = self.own.iter().flat_map(|own| own.roles.clone()).collect();
        all.repeats = self
            .own
            .iter()
            .flat_map(|own| own.repeats.clone())
            .collect();
        let channels = 0..all.channels.len();
        all.channels = channels
            .map(|channel| {
                let of = |projector: usize| &measured[projector][channel];
                let beside = |matrix: fn(&ChannelMeasurements) -> &DMatrix<f64>| {
                    let each = (0..measured.len()).map(|projector| matrix(of(projector)));
                    let columns: Vec<_> = each.flat_map(|matrix| matrix.column_iter()).collect();
                    DMatrix::from_columns(&columns)
                };
                let share = 1.0 / measured.len() as f64;
                let ambient = |cell: usize| {
                    let each = (0..measured.len()).map(|projector| of(projector).ambient[cell]);
                    share * each.sum::<f64>()
                };
                ChannelMeasurements {
                    patterns: beside(|channel| &channel.patterns),
                    observations: beside(|channel| &channel.observations),
                    ambient: (0..self.grid.cells()).map(ambient).collect(),
                    noise: (0..self.grid.cells())
                        .map(|cell| of(self.own_cell(cell).0).noise[cell])
                        .collect(),
                    noise_model: of(0).noise_model,
                }
            })
            .collect();
        all.live.clone_from(&pixels.live);
        all.pixels = pixels.counts();
        all.registration = registration;
        for other in &self.own[1..] {
            for (flood, more) in all.flood.iter_mut().zip(&other.flood) {
                flood
                    .iter_mut()
                    .zip(more)
                    .for_each(|(sum, more)| *sum += more);
            }
            all.flood_photographs = all.flood_photographs.min(other.flood_photographs);
            let (sum, more) = (&mut all.diagnostics, &other.diagnostics);
            sum.photographs += more.photographs;
            sum.bernoulli += more.bernoulli;
            sum.bernoulli_taken += more.bernoulli_taken;
            sum.exposure = sum.exposure.max(more.exposure);
            sum.gates.extend(more.gates.iter().cloned());
            let (sum, more) = (&mut sum.pixels, &more.pixels);
            sum.lit += more.lit;
            sum.coded += more.coded;
            sum.moved += more.moved;
            sum.mixed += more.mixed;
            sum.weak += more.weak;
            sum.kept += more.kept;
        }
        all.diagnostics.left_out.clone_from(&pixels.left_out);
        all.map = self.map().map(Ok);
        let widths = self.own.iter().map(|own| own.settings.projector.size);
        let widths: Option<Vec<[u16; 2]>> = widths.collect();
        all.settings.projector.size = widths.and_then(|sizes| {
            let width = sizes
                .iter()
                .map(|[width, _]| usize::from(*width))
                .sum::<usize>();
            Some([u16::try_from(width).ok()?, sizes[0][1]])
        });
        let overlaps = self.overlaps(pixels);
        let projectors = self.own.into_iter().zip(self.columns).zip(views);
        SeveralCaptures {
            all,
            projectors: projectors
                .map(|((own, columns), views)| OneOfSeveral {
                    own,
                    columns,
                    views,
                })
                .collect(),
            overlaps,
            pixel_shares: self.pixel_shares,
        }
    }
}

impl SeveralCaptures {
    /// Whether two projectors light one place.
    #[must_use]
    pub fn is_overlapping(&self) -> bool {
        self.overlaps.iter().any(|others| !others.is_empty())
    }

    /// The projector of a cell of the wide frame.
    #[must_use]
    pub fn projector_of(&self, cell: usize) -> usize {
        let col = cell % self.all.grid.cols();
        let of = |one: &OneOfSeveral| one.columns.contains(&col);
        self.projectors.iter().position(of).unwrap_or(0)
    }

    /// Share of the light that each projector has at each sample of the wide frame, 0 to 1, with so
    /// many samples along a cell's width and height, row by row: the mean over the camera pixels
    /// that see the sample.
    ///
    /// It is 1 where no other one reaches. Where projectors overlap it goes with the distance to
    /// where others light alone, against the sum of all distances: the shares of a place add up to
    /// one (Raskar and others, *Multi-projector displays using camera-based registration*, 1999).
    #[must_use]
    pub fn shares(&self, factor: [usize; 2]) -> Vec<f64> {
        let [wide, tall] = factor;
        let grid = self.all.grid;
        let width = grid.cols() * wide;
        let mut shares = vec![1.0; width * grid.rows() * tall];
        for (one, of_pixels) in self.projectors.iter().zip(&self.pixel_shares) {
            let cols = one.columns.len() * wide;
            let mut sums = vec![(0.0, 0.0); cols * grid.rows() * tall];
            for (pixel, share) in of_pixels.iter().enumerate() {
                let Some([x, y]) = place(&one.own, pixel) else {
                    continue;
                };
                let (col, row) = ((x * wide as f32).max(0.0), (y * tall as f32).max(0.0));
                let col = (col as usize).min(cols - 1);
                if let Some((sum, count)) = sums.get_mut(row as usize * cols + col) {
                    *sum += f64::from(*share);
                    *count += 1.0;
                }
            }
            let means = sums
                .into_iter()
                .map(|(sum, count)| (count > 0.0).then(|| sum / count));
            for (at, share) in filled(means.collect(), cols).into_iter().enumerate() {
                shares[at / cols * width + one.columns.start * wide + at % cols] = share;
            }
        }
        shares
    }

    /// The same for each cell, length `N`.
    #[must_use]
    pub fn shares_of_cells(&self) -> Vec<f64> {
        let side = SHARE_SAMPLES;
        let (grid, fine) = (self.all.grid, self.shares([side; 2]));
        let width = grid.cols() * side;
        // Corrections are interpolated between the centres of cells.
        let centre = |at: usize| at * side + side / 2 - 1;
        let share = |cell: usize| {
            let (row, col) = (centre(cell / grid.cols()), centre(cell % grid.cols()));
            let around = [0, 1, width, width + 1].map(|at| fine[row * width + col + at]);
            around.iter().sum::<f64>() / 4.0
        };
        (0..grid.cells()).map(share).collect()
    }
}

/// Where a camera pixel lies in a projector's picture, in cells from the left and upper edge of the
/// first; `None` where the projector does not reach.
fn place(own: &Measurements, pixel: usize) -> Option<[f32; 2]> {
    let grid = own.grid;
    if let Some(Ok(map)) = &own.map {
        let place = map.position[pixel];
        if place.iter().all(|side| side.is_finite()) {
            return Some(map.in_cells(place, grid));
        }
    }
    let cell = own.registration.seen_cell[pixel];
    let cell = (cell != NO_CELL).then_some(cell as usize)?;
    let centre = |at: usize| at as f32 + 0.5;
    Some([centre(cell % grid.cols()), centre(cell / grid.cols())])
}

/// Part of the pixels that either projector reaches which see the same place in both pictures, to
/// within half a cell.
fn same_places(one: &Measurements, other: &Measurements) -> f64 {
    let (width, height) = one.registration.camera;
    let (mut reached, mut same) = (0.0, 0.0);
    for pixel in 0..width * height {
        match (place(one, pixel), place(other, pixel)) {
            (None, None) => {}
            (Some([x, y]), Some([other_x, other_y])) => {
                reached += 1.0;
                same += f64::from(u8::from((x - other_x).hypot(y - other_y) < 0.5));
            }
            _ => reached += 1.0,
        }
    }
    same / f64::max(reached, 1.0)
}

/// Share of each projector at each camera pixel, by projector and pixel; 0 where it does not reach.
fn pixel_shares(own: &[Measurements]) -> Vec<Vec<f32>> {
    let (width, height) = own[0].registration.camera;
    let pixels = width * height;
    let lit: Vec<Vec<bool>> = own
        .iter()
        .map(|own| {
            let lit: Vec<bool> = (0..pixels)
                .map(|pixel| place(own, pixel).is_some())
                .collect();
            // Single pixels that tell no place are no border.
            closed(&lit, width, own.registration.cell_side() as f32)
        })
        .collect();
    let apart = |index: usize| {
        let alone = (0..pixels).map(|pixel| {
            let others = lit
                .iter()
                .enumerate()
                .any(|(at, lit)| at != index && lit[pixel]);
            others && !lit[index][pixel]
        });
        let mut apart = distances(&alone.collect::<Vec<_>>(), width);
        for (distance, lit) in apart.iter_mut().zip(&lit[index]) {
            // Finite, so that projectors which cover the same have equal shares.
            *distance = if *lit {
                distance.min(pixels as f32)
            } else {
                0.0
            };
        }
        apart
    };
    let mut shares: Vec<Vec<f32>> = (0..own.len()).map(apart).collect();
    for pixel in 0..pixels {
        let sum: f32 = shares.iter().map(|shares| shares[pixel]).sum();
        if sum > 0.0 {
            for shares in &mut shares {
                shares[pixel] /= sum;
            }
        }
    }
    shares
}

/// A region without its holes and notches up to `reach` pixels.
fn closed(region: &[bool], width: usize, reach: f32) -> Vec<bool> {
    let near = distances(region, width);
    let outside: Vec<bool> = near.iter().map(|distance| *distance > reach).collect();
    let away = distances(&outside, width);
    let within = away.iter().zip(region);
    within.map(|(away, own)| *own || *away > reach).collect()
}

/// Distance of each pixel to the nearest of a region, in pixels along the eight directions;
/// infinite if it is empty.
fn distances(region: &[bool], width: usize) -> Vec<f32> {
    let mut found: Vec<f32> = (region.iter())
        .map(|within| if *within { 0.0 } else { f32::INFINITY })
        .collect();
    let height = found.len() / width;
    let diagonal = std::f32::consts::SQRT_2;
    let mut visit = |pixel: usize, row: isize, side: isize| {
        let (x, y) = (pixel % width, pixel / width);
        let beside = [
            (row, -1, diagonal),
            (row, 0, 1.0),
            (row, 1, diagonal),
            (0, side, 1.0),
        ];
        for (down, right, step) in beside {
            let x = x.checked_add_signed(right).filter(|x| *x < width);
            let y = y.checked_add_signed(down).filter(|y| *y < height);
            if let (Some(x), Some(y)) = (x, y) {
                found[pixel] = found[pixel].min(found[y * width + x] + step);
            }
        }
    };
    (0..region.len()).for_each(|pixel| visit(pixel, -1, -1));
    (0..region.len()).rev().for_each(|pixel| visit(pixel, 1, 1));
    found
}

/// What is not known becomes the mean of what is known beside it, from there outwards.
fn filled(mut values: Vec<Option<f64>>, cols: usize) -> Vec<f64> {
    let rows = values.len() / cols;
    while values.contains(&None) && values.iter().any(Option::is_some) {
        let before = values.clone();
        for (at, value) in values
            .iter_mut()
            .enumerate()
            .filter(|(_, value)| value.is_none())
        {
            let (row, col) = (at / cols, at % cols);
            let beside = [
                (row > 0).then(|| at - cols),
                (row + 1 < rows).then(|| at + cols),
                (col > 0).then(|| at - 1),
                (col + 1 < cols).then(|| at + 1),
            ];
            let known = beside.into_iter().flatten().filter_map(|at| before[at]);
            let (sum, count) = known.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
            *value = (count > 0.0).then(|| sum / count);
        }
    }
    values
        .into_iter()
        .map(|value| value.unwrap_or(1.0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_go_along_the_eight_directions_and_are_infinite_without_a_region() {
        let mut region = vec![false; 7 * 5];
        assert!(distances(&region, 7).iter().all(|way| way.is_infinite()));
        region[2 * 7 + 3] = true;
        let found = distances(&region, 7);
        let diagonal = std::f32::consts::SQRT_2;
        for (pixel, way) in found.iter().enumerate() {
            let (x, y) = ((pixel % 7).abs_diff(3), (pixel / 7).abs_diff(2));
            let (least, most) = (x.min(y) as f32, x.max(y) as f32);
            let expected = diagonal * least + most - least;
            assert!((way - expected).abs() < 1e-5, "{pixel}: {way} {expected}");
        }
    }

    #[test]
    fn holes_are_closed_and_what_lies_far_from_a_region_stays_outside() {
        let (width, height) = (24, 20);
        let within = |pixel: usize| (4..20).contains(&(pixel % width)) && pixel / width >= 6;
        let whole: Vec<bool> = (0..width * height).map(within).collect();
        let mut holed = whole.clone();
        for (x, y) in [(10, 10), (11, 10), (12, 14), (6, 12)] {
            holed[y * width + x] = false;
        }
        assert_eq!(closed(&holed, width, 3.0), whole);
        assert_eq!(closed(&whole, width, 3.0), whole);
    }

    #[test]
    fn unknown_values_are_filled_from_their_neighbours_outwards() {
        let unknown = vec![None, None, Some(0.5), None, None, None];
        assert_eq!(filled(unknown, 3), [0.5; 6]);
        assert_eq!(filled(vec![None; 4], 2), [1.0; 4]);
        let row = vec![Some(0.0), None, Some(1.0)];
        assert_eq!(filled(row, 3), [0.0, 0.5, 1.0]);
    }
}
