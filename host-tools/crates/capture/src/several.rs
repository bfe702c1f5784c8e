//! Captures of several projectors that light one scene, each taken while the others were dark,
//! as one capture of a wide frame: their frames side by side.
//!
//! Every projector is registered by its own photographs. The cells of all are then measured in
//! the photographs of each, because what one projector shows lights the others' cells: directly,
//! where they overlap, and by bounces everywhere.

use crate::Examined;
use crate::cells::CellEvidence;
use crate::cells::cell_pixels::CellPixels;
use crate::cells::measurements::{ChannelMeasurements, Measurements};
use crate::crossing_light::{CrossingLight, ProjectorAreas, crossing_light, shown_under_black};
use crate::devices::Unmixing;
use crate::format::error::CaptureError;
use crate::format::sequence::{CaptureOptions, Sequence};
use crate::gate::Gate;
use crate::gates::between;
use crate::photographs::linearise::LinearPhotographs;
use crate::photographs::sampled::Sampled;
use crate::registration::black_shift;
use crate::registration::cell_map::{NO_CELL, Registration};
use crate::wide_frame::{WideFrame, place};
use iltm_picture::{FramePart, progress::Progress};
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
    /// Its cells in the wide frame.
    pub part: FramePart,
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
    check_once(folders)?;
    let (mut own, mut sequences, mut photographs) = (Vec::new(), Vec::new(), Vec::new());
    for folder in folders {
        let (measurements, (sequence, mut linear, _)) =
            crate::read_keeping(folder, options, as_the_first(&own), progress)?;
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
    let saturated = photographs.iter().map(|linear| &linear.saturated[..]);
    let pixels = wide.pixels(&saturated.collect::<Vec<_>>());
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

/// What gates say of captures of several projectors.
#[derive(Clone, Debug)]
pub struct ExaminedSeveral {
    /// Each capture by itself.
    pub each: Vec<Examined>,
    /// What is said of two of them, or of one beside the others; none where one was not measured.
    pub between: Vec<Gate>,
    /// Who lights whom; none where one was not measured.
    pub light: Vec<CrossingLight>,
}

/// Looks at captures of several projectors, from left to right in the wide frame, as closely as
/// [`read_several`] and says what every gate says of them.
///
/// # Errors
/// Those of [`examine`](crate::examine) for each; [`CaptureError::Unlike`] where they do not fit beside each
/// other.
pub fn examine_several(
    folders: &[PathBuf],
    options: &CaptureOptions,
    progress: &dyn Progress,
) -> Result<ExaminedSeveral, CaptureError> {
    check_once(folders)?;
    let (mut each, mut own, mut photographs) = (Vec::new(), Vec::new(), Vec::new());
    for folder in folders {
        let (examined, kept) =
            crate::examine_keeping(folder, options, as_the_first(&own), progress)?;
        if let (Some(measurements), Some((_, mut linear, _))) = (&examined.measurements, kept) {
            linear.photographs.forget();
            own.push(measurements.clone());
            photographs.push(linear);
        }
        each.push(examined);
    }
    let (mut gates, mut light) = (Vec::new(), Vec::new());
    if own.len() == folders.len() {
        let wide = WideFrame::new(folders, own)?;
        gates = wide.gates(folders, &photographs);
        light = crossing_light(&wide.pixel_shares, |of, pixel| {
            white_at(&wide.own[of], pixel)
        });
    }
    Ok(ExaminedSeveral {
        each,
        between: gates.into_iter().map(|(_, gate)| gate).collect(),
        light,
    })
}

/// The mixing that is undone for the next capture: that of the first one, so that white of projectors
/// which differ in colour is compared in the same channels.
pub(crate) fn as_the_first(own: &[Measurements]) -> Unmixing<'_> {
    own.first().map_or(Unmixing::Measured, |first| {
        let devices = &first.devices;
        Unmixing::As(devices.mixing().filter(|_| devices.unmixed))
    })
}

/// Refuses a folder that is given twice.
pub(crate) fn check_once(folders: &[PathBuf]) -> Result<(), CaptureError> {
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
    Ok(())
}

impl WideFrame {
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
        let mut gates: Vec<(usize, Gate)> = (self.not_dark(photographs).into_iter())
            .filter_map(|([of, other], share)| {
                Some((of, between::not_dark(&pair(of, other), share)?))
            })
            .collect();
        let dark = gates.is_empty();
        for (other, linear) in photographs.iter().enumerate().skip(1) {
            let own = linear.black_as_seen();
            let shift = black_shift::find(&black, &own, width);
            let movement = between::movement(&pair(0, other), (binning, cell), shift);
            gates.push((other, movement));
            if dark {
                let brighter = black_shift::brighter(&black, &own);
                gates.push((other, between::black(&pair(0, other), brighter)));
            }
            let responses = [0, other].map(|at| self.own[at].devices.known_projector());
            gates.push((other, between::response(&pair(0, other), responses)));
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

    /// Which projector was photographed while which other one was not dark, and how much of its white that
    /// showed.
    fn not_dark(&self, photographs: &[LinearPhotographs<'_>]) -> Vec<([usize; 2], f64)> {
        let all = 0..photographs.len();
        let pairs = all
            .clone()
            .flat_map(|of| all.clone().map(move |other| [of, other]));
        let pairs = pairs.filter(|[of, other]| of != other);
        pairs
            .filter_map(|pair| {
                let of_pixel = |pixel: usize| {
                    let black = pair.map(|at| sum_at(&photographs[at].black, pixel));
                    [black, pair.map(|at| white_at(&self.own[at], pixel))]
                };
                let pixels = 0..photographs[pair[0]].black[0].len();
                Some((pair, shown_under_black(pixels.map(of_pixel))?))
            })
            .collect()
    }

    /// Cells of other projectors that light the same place, by cell.
    fn overlaps(&self, pixels: &CellPixels) -> Vec<Vec<usize>> {
        let of_cell = |(cell, pixels): (usize, &[u32])| {
            let Some((own, _)) = self.own_cell(cell) else {
                return Vec::new();
            };
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
                        .map(|cell| {
                            let own = self.own_cell(cell).map_or(0, |(projector, _)| projector);
                            of(own).noise[cell]
                        })
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
        let sizes = self.own.iter().map(|own| own.settings.projector.size);
        let sizes: Option<Vec<[u16; 2]>> = sizes.collect();
        all.settings.projector.size = sizes.and_then(|sizes| {
            let frames = (sizes.iter()).map(|[width, height]| [*height, *width].map(usize::from));
            let [height, width] = FramePart::around(&FramePart::side_by_side(frames));
            Some([width.try_into().ok()?, height.try_into().ok()?])
        });
        let overlaps = self.overlaps(pixels);
        let projectors = self.own.into_iter().zip(self.parts).zip(views);
        SeveralCaptures {
            all,
            projectors: projectors
                .map(|((own, part), views)| OneOfSeveral { own, part, views })
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

    /// The projector of a cell of the wide frame; `None` of a cell below a lower frame.
    #[must_use]
    pub fn projector_of(&self, cell: usize) -> Option<usize> {
        let cols = self.all.grid.cols();
        let of = |one: &OneOfSeveral| one.part.own(cols, cell).is_some();
        self.projectors.iter().position(of)
    }

    /// What several projectors light and how they share it, and the measurements of all.
    #[must_use]
    pub fn into_areas(self) -> (Measurements, ProjectorAreas) {
        let white = |of: usize, pixel: usize| white_at(&self.projectors[of].own, pixel);
        let areas = ProjectorAreas {
            overlap: self.is_overlapping(),
            crossing: crossing_light(&self.pixel_shares, white),
            cell_shares: self.shares_of_cells(),
            parts: (self.projectors.iter())
                .map(|one| one.part.clone())
                .collect(),
            pixel_shares: self.pixel_shares,
        };
        (self.all, areas)
    }

    /// Has what lies below a lower frame go on as the frame's last row, so that values which are
    /// interpolated do not fade there. `values` has so many along a cell's width and height, row by row.
    pub fn continue_below<T: Copy>(&self, [wide, tall]: [usize; 2], values: &mut [T]) {
        let width = self.all.grid.cols() * wide;
        for part in self.projectors.iter().map(|one| &one.part) {
            let columns = part.columns.start * wide..part.columns.end * wide;
            let (frame, below) = values.split_at_mut(part.rows * tall * width);
            let last = &frame[frame.len() - width..][columns.clone()];
            for row in below.chunks_exact_mut(width) {
                row[columns.clone()].copy_from_slice(last);
            }
        }
    }

    /// Whether a projector lights a camera pixel itself.
    #[must_use]
    pub fn reaches(&self, projector: usize, pixel: usize) -> bool {
        self.pixel_shares[projector][pixel] > 0.0
    }

    /// Light at a camera pixel under white of all projectors that reach it, of that under white of one of
    /// them; 1 where no other one reaches.
    #[must_use]
    pub fn light_together(&self, projector: usize, pixel: usize) -> f64 {
        let reach = self.projectors.iter().enumerate();
        let reach = reach.filter(|(at, _)| *at == projector || self.reaches(*at, pixel));
        let all: f64 = reach.map(|(_, one)| white_at(&one.own, pixel)).sum();
        let own = white_at(&self.projectors[projector].own, pixel);
        if own > 0.0 { all / own } else { 1.0 }
    }

    /// Share of the light that each projector has at each sample of the wide frame, 0 to 1, with so
    /// many samples along a cell's width and height, row by row: the mean over the camera pixels
    /// that see the sample.
    ///
    /// It is 1 where no other one reaches, and below a lower frame; the shares of a place add up to
    /// one (`blending.rs` says how).
    #[must_use]
    pub fn shares(&self, factor: [usize; 2]) -> Vec<f64> {
        let [wide, tall] = factor;
        let grid = self.all.grid;
        let width = grid.cols() * wide;
        let mut shares = vec![1.0; width * grid.rows() * tall];
        for (one, of_pixels) in self.projectors.iter().zip(&self.pixel_shares) {
            let part = FramePart {
                columns: one.part.columns.start * wide..one.part.columns.end * wide,
                rows: one.part.rows * tall,
            };
            let cols = part.columns.len();
            let mut sums = vec![(0.0, 0.0); cols * part.rows];
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
                shares[part.place(width, at)] = share;
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

/// White's light at a camera pixel, over all channels.
fn white_at(own: &Measurements, pixel: usize) -> f64 {
    sum_at(&own.flood, pixel)
}

/// The sum of all planes at a pixel.
fn sum_at(planes: &[Vec<f32>], pixel: usize) -> f64 {
    planes.iter().map(|plane| f64::from(plane[pixel])).sum()
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
    fn unknown_values_are_filled_from_their_neighbours_outwards() {
        let unknown = vec![None, None, Some(0.5), None, None, None];
        assert_eq!(filled(unknown, 3), [0.5; 6]);
        assert_eq!(filled(vec![None; 4], 2), [1.0; 4]);
        let row = vec![Some(0.0), None, Some(1.0)];
        assert_eq!(filled(row, 3), [0.0, 0.5, 1.0]);
    }
}
