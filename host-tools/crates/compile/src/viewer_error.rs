//! Viewer error: what a viewer would see of natural images, predicted pixel by pixel by an inverse
//! that has not seen all photographs.
//!
//! A table believes that a pixel's light is what the projector throws there and what bounces there:
//! `D + B` with `D = p / g` and `B = (U K c) / g`, for a pattern `p`, gains `g` and the cells'
//! light `c`. What a photograph shows beyond that is the table's error. It has three parts:
//!
//! | part | found from | in a natural image |
//! |---|---|---|
//! | how far direct and bounced light of a pixel are off: `a D + b B` | all photographs: two numbers of a pixel, which nothing fitted before; once from either half of them, so that the product of both has no noise | the same `a` and `b`, less what the table's gains leave out for the sake of an even light |
//! | how far gains change over as much as a place is off: photographs seen from the same wrong places do not show it | the map from cells to the camera, and its error | the same, of direct light |
//! | the rest, which is the operator's and differs from photograph to photograph | held-out photographs: products of neighbouring pixels, which have no noise either | less, by the contrast of the image's cells |

use crate::FineGains;
use crate::gain::{for_even_light, unshared_gains_of_several, white_gains};
use iltm_capture::{
    ChannelMeasurements, FineFlood, Measurements, OneOfSeveral, PixelLight, SeveralCaptures,
};
use iltm_picture::{LightPicture, PictureError};
use iltm_runtime::{FrameSize, Grid};
use iltm_solve::{
    DARKEST_WANTED, Inverse, InverseTransport, SUPERSAMPLING, Trial, fine_natural_images,
};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Natural images that are looked at.
const LOOKED_AT: usize = 6;

/// Camera pixels around one that must see the same light of a pattern: at an edge, the pattern's
/// own edge counts and not the table.
const CLEAR: f32 = 0.75;

/// Camera pixels between two whose errors are compared: neighbours share noise where a camera
/// interpolates its colours.
const APART: usize = 2;

/// Ways to halve the photographs: by the last bits of their numbers.
const HALVINGS: usize = 3;

/// Cells that a place which only the cells tell is off, root mean square in each direction: what
/// fine stripes say of the path tracer's sessions.
const PLACE_OFF: f32 = 0.03;

/// The same in camera pixels, of the light within one: gains that change from pixel to pixel change
/// within them too, and where they do is not known.
const WITHIN_PIXEL: f32 = 0.25;

/// What codes of 8 bits take away of an image, root mean square of light: half a step at most, and
/// a step at usual brightness is 1.7/255 of white.
const CODES: f64 = 1.7 / 255.0 / 3.464;

/// A fit is made where direct and bounced light differ by more than this.
const LEAST_DETERMINANT: f64 = 0.02;

/// What a viewer would see of natural images.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ViewerError {
    /// Of the images as they are.
    pub uncompensated: PictureError,
    /// With gains alone.
    pub gain_only: PictureError,
    /// With the inverse.
    pub compensated: PictureError,
}

impl ViewerError {
    /// Predicts it from the photographs that the `trials` have not seen. `None` if they are too
    /// few, or if too few pixels are seen.
    #[must_use]
    pub fn predict(
        measurements: &Measurements,
        trials: &[Trial],
        gain_only: &InverseTransport,
        flood: &FineFlood,
    ) -> Option<Self> {
        let one = PixelPhotographs::of(measurements);
        let fine = |inverse: &InverseTransport| {
            let white = white_gains(inverse, flood)?;
            let table = for_even_light(white.clone(), inverse, flood);
            Some(BothGains { table, white })
        };
        Self::of(&[one], trials, gain_only, fine)
    }

    /// The same of several projectors, by the photographs of each while the others are dark. Where they
    /// overlap, it is what would be seen if one of them showed all of the light.
    #[must_use]
    pub(crate) fn predict_several(
        several: &SeveralCaptures,
        trials: &[Trial],
        gain_only: &InverseTransport,
        flood: &FineFlood,
    ) -> Option<Self> {
        let photographed =
            (0..several.projectors.len()).map(|at| PixelPhotographs::of_one(several, at));
        let photographed: Vec<PixelPhotographs<'_>> = photographed.collect::<Option<_>>()?;
        let fine = |inverse: &InverseTransport| {
            let table = unshared_gains_of_several(inverse, flood, several)?;
            let white = table.clone();
            Some(BothGains { table, white })
        };
        Self::of(&photographed, trials, gain_only, fine)
    }

    fn of(
        photographed: &[PixelPhotographs<'_>],
        trials: &[Trial],
        gain_only: &InverseTransport,
        fine: impl Fn(&InverseTransport) -> Option<BothGains>,
    ) -> Option<Self> {
        let images = Images::new(gain_only.grid);
        let gains: Vec<Option<BothGains>> =
            trials.iter().map(|trial| fine(&trial.inverse)).collect();
        let mut compensated = Vec::new();
        for (trial, gains) in trials.iter().zip(&gains) {
            let received = received(photographed.first()?.channels, trial);
            let errors = photographed.par_iter().map(|seen| {
                let scene = Scene::new(seen, &trial.inverse, gains.as_ref());
                let fits = scene.fits(seen, (trial, &received))?;
                Some(scene.with_errors(&images, &fits))
            });
            let errors: Vec<Vec<PictureError>> = errors.collect::<Option<_>>()?;
            compensated.extend(errors.into_iter().flatten());
        }
        let (mut corrected, mut uncompensated) = (Vec::new(), Vec::new());
        let first = &trials.first()?.inverse;
        let (of_first, of_gains) = (&gains[0], fine(gain_only));
        for seen in photographed {
            let scene = Scene::new(seen, first, of_first.as_ref());
            let of_gains = Scene::new(seen, gain_only, of_gains.as_ref());
            uncompensated.extend(scene.projected(&images, |_, _| (1.0, None), true)?);
            let gains = |channel: usize, site: usize| {
                let gain = of_gains.gains[channel][site];
                (gain, Some(&gain_only.channels[channel].gain))
            };
            corrected.extend(scene.projected(&images, gains, false)?);
        }
        Some(Self {
            uncompensated: PictureError::mean(&uncompensated)?,
            gain_only: PictureError::mean(&corrected)?,
            compensated: PictureError::mean(&compensated)?,
        })
    }
}

/// Gains of a table, and those that make the photograph of white right.
struct BothGains {
    table: FineGains,
    white: FineGains,
}

/// What cells receive of all others under each pattern, by channel, cell and pattern.
fn received(channels: &[ChannelMeasurements], trial: &Trial) -> Vec<DMatrix<f64>> {
    let of_channel = |(index, channel): (usize, &ChannelMeasurements)| {
        let mut received = &trial.inverse.channel(index).operator * &channel.observations;
        if let Some(thrown) = &trial.thrown[index] {
            received += thrown;
        }
        received
    };
    channels.iter().enumerate().map(of_channel).collect()
}

/// Photographs of patterns, and where some pixels look in a projector's picture.
struct PixelPhotographs<'m> {
    grid: Grid,
    /// Those of the projector itself first, then those of others while it is dark.
    sessions: Vec<PatternSession<'m>>,
    /// In cells, by pixel.
    places: Vec<Option<[f32; 2]>>,
    /// Light of all projectors that reach a pixel under their white, of this one's.
    together: Vec<f64>,
    /// How far off places are, in cells, root mean square in each direction.
    off: f32,
    /// Side of a cell in camera pixels.
    cell_side: f32,
    blur: f64,
    channels: &'m [ChannelMeasurements],
}

/// Photographs of one projector's patterns.
struct PatternSession<'m> {
    /// Light of the pixels.
    light: &'m PixelLight,
    /// Its columns of patterns and observations.
    views: Range<usize>,
    /// The first of its views that is an image.
    first_image: usize,
    /// Of another projector, whether it lights a pixel itself.
    lit: Option<Vec<bool>>,
}

impl<'m> PixelPhotographs<'m> {
    fn of(measurements: &'m Measurements) -> Self {
        let views = measurements.roles.len();
        let own = PatternSession {
            light: &measurements.pixel_light,
            views: 0..views,
            first_image: views - measurements.diagnostics.images,
            lit: None,
        };
        Self {
            grid: measurements.grid,
            sessions: vec![own],
            places: measurements.places(),
            together: vec![1.0; measurements.pixel_light.pixels.len()],
            off: places_off(measurements),
            cell_side: measurements.registration.cell_side() as f32,
            blur: measurements.devices.blur,
            channels: &measurements.channels,
        }
    }

    /// One of several projectors; `None` without its projector map.
    fn of_one(several: &'m SeveralCaptures, index: usize) -> Option<Self> {
        let OneOfSeveral { own, part, .. } = &several.projectors[index];
        own.map.as_ref()?.as_ref().ok()?;
        let beside = |place: Option<[f32; 2]>| {
            let [x, y] = place?;
            Some([x + part.columns.start as f32, y])
        };
        let pixels = || own.pixel_light.pixels.iter().map(|pixel| *pixel as usize);
        let session = |(at, one): (usize, &'m OneOfSeveral)| {
            let lit = || pixels().map(|pixel| several.reaches(at, pixel)).collect();
            PatternSession {
                light: &one.own.pixel_light,
                views: one.views.clone(),
                // All show patterns.
                first_image: one.views.len(),
                lit: (at != index).then(lit),
            }
        };
        let sessions = several.projectors.iter().enumerate();
        // Captures of unlike numbers of photographs may have looked at other pixels.
        let sessions =
            sessions.filter(|(_, one)| one.own.pixel_light.pixels == own.pixel_light.pixels);
        let mut sessions: Vec<PatternSession<'m>> = sessions.map(session).collect();
        sessions.sort_by_key(|session| session.lit.is_some());
        let alone = Self::of(own);
        Some(Self {
            grid: several.all.grid,
            sessions,
            places: alone.places.into_iter().map(beside).collect(),
            together: pixels()
                .map(|pixel| several.light_together(index, pixel))
                .collect(),
            channels: &several.all.channels,
            ..alone
        })
    }
}

/// Natural images: each at the grid's size, and finer.
struct Images {
    cells: Vec<DVector<f64>>,
    fine: Vec<Vec<f64>>,
}

impl Images {
    fn new(grid: Grid) -> Self {
        let wanted = |light: &mut f64| *light = DARKEST_WANTED + (1.0 - DARKEST_WANTED) * *light;
        let fine = fine_natural_images(grid).take(LOOKED_AT).map(|mut image| {
            image.iter_mut().for_each(wanted);
            image
        });
        let fine: Vec<Vec<f64>> = fine.collect();
        let width = grid.cols() * SUPERSAMPLING;
        let cells = |image: &Vec<f64>| {
            let mut cells = DVector::zeros(grid.cells());
            for (at, light) in image.iter().enumerate() {
                let (row, col) = (at / width / SUPERSAMPLING, at % width / SUPERSAMPLING);
                cells[row * grid.cols() + col] += light / (SUPERSAMPLING * SUPERSAMPLING) as f64;
            }
            cells
        };
        Self {
            cells: fine.iter().map(cells).collect(),
            fine,
        }
    }
}

/// Four values around a place and their shares.
#[derive(Clone, Copy)]
struct Corners([(usize, f64); 4]);

impl Corners {
    /// Around a place in cells, on a grid with `factor` times the cells' columns and rows.
    fn new([across, down]: [f32; 2], grid: Grid, factor: [usize; 2]) -> Self {
        let along = |at: f32, count: usize, factor: usize| {
            let last = (count * factor - 1) as f64;
            let at = (f64::from(at) * factor as f64 - 0.5).clamp(0.0, last);
            let before = at.floor();
            (
                before as usize,
                (before + 1.0).min(last) as usize,
                at - before,
            )
        };
        let (left, right, x) = along(across, grid.cols(), factor[0]);
        let (top, bottom, y) = along(down, grid.rows(), factor[1]);
        let width = grid.cols() * factor[0];
        Self([
            (top * width + left, (1.0 - y) * (1.0 - x)),
            (top * width + right, (1.0 - y) * x),
            (bottom * width + left, y * (1.0 - x)),
            (bottom * width + right, y * x),
        ])
    }

    fn of(&self, values: &[f64]) -> f64 {
        self.0.iter().map(|(at, share)| share * values[*at]).sum()
    }
}

/// A pixel that is judged.
struct Site {
    /// Its number among the measured pixels.
    at: usize,
    /// Light of all projectors that reach it under their white, of its own one's.
    together: f64,
    /// Where it looks, in cells.
    place: [f32; 2],
    cells: Corners,
}

/// The scene as an inverse describes it, at the pixels that are judged.
struct Scene {
    grid: Grid,
    sites: Vec<Site>,
    /// All pixels that were measured.
    pixels: usize,
    inverses: Vec<Inverse>,
    /// Drives that make as much light as there is ambient light, by channel and cell.
    ambient: Vec<Vec<f64>>,
    /// `g` by channel and site: that of the photograph of white.
    gains: Vec<Vec<f64>>,
    /// Share of direct light that the table's gains leave out beside it.
    left_out: Vec<Vec<f64>>,
    /// Square of how far they change over as much as a place is off, relative to themselves.
    unsteady: Vec<Vec<f64>>,
}

/// What is wrong with a table, by channel.
struct Fits {
    channels: Vec<ChannelFits>,
    /// Mean square of the error that varies with the picture, for cells' light of variance 1.
    varying: f64,
}

/// What is wrong at each site; `None` where the photographs do not tell.
type ChannelFits = Vec<Option<SiteFit>>;

/// How far off direct and bounced light are.
#[derive(Clone, Copy)]
struct SiteFit {
    whole: [f64; 2],
    /// The same from one half of the photographs and from the other, for each way to halve them.
    halves: [Option<[[f64; 2]; 2]>; HALVINGS],
}

impl Scene {
    fn new(
        seen: &PixelPhotographs<'_>,
        inverse: &InverseTransport,
        fine: Option<&BothGains>,
    ) -> Self {
        let grid = seen.grid;
        let places = &seen.places;
        let site = |(at, place): (usize, &Option<[f32; 2]>)| {
            let place = (*place)?;
            let cells = Corners::new(place, grid, [1; 2]);
            let live = cells.0.iter().all(|(cell, _)| inverse.live[*cell]);
            live.then_some(Site {
                at,
                together: seen.together[at],
                place,
                cells,
            })
        };
        let sites: Vec<Site> = places.iter().enumerate().filter_map(site).collect();
        let at_place = |fine: Option<&FineGains>, channel: usize, place: [f32; 2]| match fine {
            Some(FineGains { size, channels }) => {
                let factor = [size.width() / grid.cols(), size.height() / grid.rows()];
                Corners::new(place, grid, factor).of(&channels[channel])
            }
            None => Corners::new(place, grid, [1; 2]).of(&inverse.channels[channel].gain),
        };
        let table = fine.map(|fine| &fine.table);
        let white = fine.map(|fine| &fine.white);
        let gain_at = |channel: usize, place: [f32; 2]| at_place(table, channel, place);
        let gains = |channel: usize| {
            let sites = sites.iter();
            sites
                .map(|site| at_place(white, channel, site.place))
                .collect()
        };
        let left_out = |channel: usize| {
            let share = |site: &Site| {
                let whole = at_place(white, channel, site.place);
                if whole > 0.0 {
                    1.0 - gain_at(channel, site.place) / whole
                } else {
                    0.0
                }
            };
            sites.iter().map(share).collect()
        };
        let off = seen.off;
        let unsteady = |channel: usize| {
            let at = |site: &Site| {
                let [x, y] = site.place;
                let own = gain_at(channel, site.place);
                let around = [(x - off, y), (x + off, y), (x, y - off), (x, y + off)];
                let change = around.map(|(x, y)| gain_at(channel, [x, y]) / own - 1.0);
                let square: f64 = change.iter().map(|change| change * change).sum();
                // Left and right are one direction, up and down the other.
                if own > 0.0 { square / 2.0 } else { 0.0 }
            };
            sites.iter().map(at).collect()
        };
        let channels = 0..inverse.channels.len();
        Self {
            grid,
            gains: channels.clone().map(gains).collect(),
            left_out: channels.clone().map(left_out).collect(),
            unsteady: channels.clone().map(unsteady).collect(),
            inverses: channels.map(|channel| inverse.channel(channel)).collect(),
            ambient: inverse
                .channels
                .iter()
                .map(|channel| {
                    let cells = channel.gain.iter().zip(&channel.ambient);
                    cells.map(|(gain, ambient)| gain * ambient).collect()
                })
                .collect(),
            pixels: places.len(),
            sites,
        }
    }

    /// Light that bounces to each site, of cells with this light.
    fn bounced(&self, channel: usize, received: &[f64]) -> Vec<f64> {
        let sites = self.sites.iter().zip(&self.gains[channel]);
        let bounced = |(site, gain): (&Site, &f64)| {
            if *gain > 0.0 {
                site.cells.of(received) / gain
            } else {
                0.0
            }
        };
        sites.map(bounced).collect()
    }

    /// What photographs show beyond what the table believes, given what cells receive in them.
    fn fits(
        &self,
        photographed: &PixelPhotographs<'_>,
        (trial, received): (&Trial, &[DMatrix<f64>]),
    ) -> Option<Fits> {
        let clear = CLEAR / photographed.cell_side;
        let blur = photographed.blur;
        let blurring = (blur > 0.0).then(|| iltm_solve::blur(self.grid, blur));
        let (mut varying, mut contrast) = (Mean::default(), Mean::default());
        let mut channels = Vec::new();
        for (channel, received) in received.iter().enumerate() {
            let ChannelMeasurements {
                patterns,
                observations: observed,
                ..
            } = &photographed.channels[channel];
            let blurred = blurring.as_ref().map(|blur| blur * patterns);
            let thrown_at = |session: &PatternSession<'_>, site: &Site, view: usize| {
                if let Some(lit) = &session.lit {
                    return (!lit[site.at]).then_some(0.0);
                }
                let column = session.views.start + view;
                if let Some(blurred) = &blurred {
                    return Some(site.cells.of(blurred.column(column).as_slice()));
                }
                let images = &session.light.thrown[channel];
                let image = images.get(view.wrapping_sub(session.first_image));
                let thrown = image.map(|image| image[site.at]).filter(|v| v.is_finite());
                thrown.map(f64::from).or_else(|| {
                    let pattern = patterns.column(column);
                    lit(self.grid, site.place, clear, pattern.as_slice())
                })
            };
            let mut sums = vec![[[Sums::default(); 2]; HALVINGS]; self.sites.len()];
            let mut held_out = vec![Vec::new(); self.sites.len()];
            let sessions = photographed.sessions.iter();
            let views = sessions.flat_map(|session| {
                // White tells no more than the gains, which come from it.
                let own = session.lit.is_none();
                let first = Measurements::WHITE + usize::from(own);
                (first..session.views.len()).map(move |view| (session, view))
            });
            for (session, view) in views {
                let column = session.views.start + view;
                let is_held_out = trial.held_out.contains(&column);
                if is_held_out {
                    contrast.add(observed.column(column).variance());
                }
                let bounced = self.bounced(channel, received.column(column).as_slice());
                for (at, site) in self.sites.iter().enumerate() {
                    let gain = self.gains[channel][at];
                    let thrown = thrown_at(session, site, view).filter(|_| gain > 0.0);
                    let sample = thrown.map(|thrown| {
                        let (direct, bounced) = (thrown / gain, bounced[at]);
                        let seen = f64::from(session.light.channels[channel][view][site.at]);
                        Sample {
                            direct,
                            bounced,
                            error: seen - direct - bounced,
                        }
                    });
                    if is_held_out {
                        held_out[at].push(sample);
                    }
                    if let Some(sample) = sample {
                        for (bit, halves) in sums[at].iter_mut().enumerate() {
                            halves[column >> bit & 1].add(sample);
                        }
                    }
                }
            }
            let fits: ChannelFits = sums.iter().map(SiteFit::new).collect();
            varying.join(&self.varying(&held_out, &fits));
            channels.push(fits);
        }
        let mut told = channels
            .iter()
            .flatten()
            .flatten()
            .flat_map(|fit| fit.halves);
        told.any(|halves| halves.is_some()).then(|| Fits {
            varying: (varying.mean() / contrast.mean()).max(0.0),
            channels,
        })
    }

    /// Mean square of what the fits do not explain, without noise: by products of pixels beside
    /// each other.
    fn varying(&self, samples: &[Vec<Option<Sample>>], fits: &ChannelFits) -> Mean {
        let mut at_pixel = vec![None; self.pixels];
        for (number, site) in self.sites.iter().enumerate() {
            at_pixel[site.at] = Some(number);
        }
        let mut varying = Mean::default();
        for (at, site) in self.sites.iter().enumerate() {
            let (row, col) = (
                site.at % (PixelLight::SIDE * PixelLight::SIDE) / PixelLight::SIDE,
                site.at % PixelLight::SIDE,
            );
            let beside = [
                (col + APART < PixelLight::SIDE, APART),
                (row + APART < PixelLight::SIDE, APART * PixelLight::SIDE),
            ];
            for (_, offset) in beside.into_iter().filter(|(within, _)| *within) {
                let Some(other) = at_pixel[site.at + offset] else {
                    continue;
                };
                let (Some(own), Some(others)) = (fits[at], fits[other]) else {
                    continue;
                };
                for (a, b) in samples[at].iter().zip(&samples[other]) {
                    if let (Some(a), Some(b)) = (a, b) {
                        varying.add(a.rest(own.whole) * b.rest(others.whole));
                    }
                }
            }
        }
        varying
    }

    /// Natural images with the errors that were found.
    fn with_errors(&self, images: &Images, fits: &Fits) -> Vec<PictureError> {
        let judged = |at: usize| fits.channels.iter().all(|fits| fits[at].is_some());
        let judged: Vec<bool> = (0..self.sites.len()).map(judged).collect();
        let of_image = |(cells, fine): (&DVector<f64>, &Vec<f64>)| {
            let wanted = self.wanted(fine);
            // Square of the error with its noise, and without.
            let (mut noisy, mut known) = (Mean::default(), Mean::default());
            let mut unsteady = Mean::default();
            let mut errors = Vec::new();
            for (channel, inverse) in self.inverses.iter().enumerate() {
                let received = &inverse.operator * cells;
                let bounced = self.bounced(channel, received.as_slice());
                let sites = wanted.iter().zip(bounced).zip(&fits.channels[channel]);
                let sites = sites.zip(&self.unsteady[channel]);
                let sites = sites.zip(&self.left_out[channel]);
                let mut of_channel = Vec::with_capacity(wanted.len());
                for ((((light, bounced), fit), change), left_out) in sites {
                    unsteady.add(change * light * light);
                    let off =
                        |[a, b]: [f64; 2]| a * (light - bounced) + b * bounced - left_out * light;
                    let whole = fit.map_or(0.0, |fit| off(fit.whole));
                    of_channel.push(whole);
                    if let Some(fit) = fit {
                        noisy.add(whole * whole);
                        let halves = fit.halves.into_iter().flatten();
                        halves.for_each(|[a, b]| known.add(off(a) * off(b)));
                    }
                }
                errors.push(of_channel);
            }
            let varying = fits.varying * cells.variance();
            let square = known.mean().max(0.0) + unsteady.mean() + varying + CODES * CODES;
            let size = (square / noisy.mean().max(f64::MIN_POSITIVE)).sqrt();
            let shown = errors.iter().map(|errors| {
                let sites = wanted.iter().zip(errors);
                sites.map(|(light, error)| light + size * error).collect()
            });
            self.compare(&shown.collect::<Vec<_>>(), &wanted, &judged)
        };
        let images = images.cells.iter().zip(&images.fine);
        images.filter_map(of_image).collect()
    }

    /// Natural images as they would look with a projector input of so much a light in each site
    /// and cell: as they are with ambient light, or by a table that takes it away, rounds to
    /// codes and has gains of wrong places. `None` if light would grow without end.
    fn projected<'g>(
        &self,
        images: &Images,
        drive: impl Fn(usize, usize) -> (f64, Option<&'g Vec<f64>>),
        as_it_is: bool,
    ) -> Option<Vec<PictureError>> {
        let mut errors = Vec::new();
        let judged = vec![true; self.sites.len()];
        for (cells, fine) in images.cells.iter().zip(&images.fine) {
            let wanted = self.wanted(fine);
            let mut shown = Vec::new();
            for (channel, inverse) in self.inverses.iter().enumerate() {
                let input = |(cell, light): (usize, &f64)| {
                    drive(channel, 0)
                        .1
                        .map_or(*light, |gains| gains[cell] * light)
                };
                let input: Vec<f64> = cells.iter().enumerate().map(input).collect();
                let light = inverse.light(&DMatrix::from_column_slice(input.len(), 1, &input))?;
                let received = &inverse.operator * &light.column(0).into_owned();
                let bounced = self.bounced(channel, received.as_slice());
                let seen = |(at, bounced): (usize, f64)| {
                    let gain = self.gains[channel][at].max(f64::MIN_POSITIVE);
                    let direct = drive(channel, at).0 * wanted[at] / gain;
                    let ambient = self.sites[at].cells.of(&self.ambient[channel]) / gain;
                    if as_it_is {
                        return bounced + self.sites[at].together * direct + ambient;
                    }
                    let unsteady = self.unsteady[channel][at] * wanted[at] * wanted[at];
                    bounced + direct + either_sign(at) * (unsteady + CODES * CODES).sqrt()
                };
                shown.push(bounced.into_iter().enumerate().map(seen).collect());
            }
            errors.extend(self.compare(&shown, &wanted, &judged));
        }
        Some(errors)
    }

    /// An image at the sites.
    fn wanted(&self, fine: &[f64]) -> Vec<f64> {
        let at = |site: &Site| Corners::new(site.place, self.grid, [SUPERSAMPLING; 2]).of(fine);
        self.sites.iter().map(at).collect()
    }

    /// Compares light at the sites, one plane a channel, square below square with a gap between.
    fn compare(&self, shown: &[Vec<f64>], wanted: &[f64], judged: &[bool]) -> Option<PictureError> {
        let square = PixelLight::SIDE * PixelLight::SIDE;
        let squares = self.pixels / square;
        let size = FrameSize::new(
            PixelLight::SIDE as u16,
            u16::try_from(squares * (PixelLight::SIDE + 1)).ok()?,
        )?;
        let at = |site: &Site| site.at + site.at / square * PixelLight::SIDE;
        let plane = |values: &[f64]| {
            let mut plane = vec![0.0; size.pixels()];
            for (site, value) in self.sites.iter().zip(values) {
                plane[at(site)] = *value as f32;
            }
            plane
        };
        let mut mask = vec![false; size.pixels()];
        for (site, judged) in self.sites.iter().zip(judged) {
            mask[at(site)] = *judged;
        }
        let wanted = LightPicture::new(size, vec![plane(wanted); shown.len()])?;
        let shown = LightPicture::new(size, shown.iter().map(|light| plane(light)).collect())?;
        PictureError::new(&shown, &wanted, &mask)
    }
}

/// 1 or -1, without an order that an image could have.
fn either_sign(at: usize) -> f64 {
    let mixed = (at as u32).wrapping_mul(0x9e37_79b9);
    if mixed >> 31 == 0 { 1.0 } else { -1.0 }
}

/// How far off the places of pixels are, in cells, root mean square in each direction.
fn places_off(measurements: &Measurements) -> f32 {
    let Some(Ok(map)) = &measurements.map else {
        let pixels = measurements.registration.cell_side() as f32;
        return PLACE_OFF.hypot(WITHIN_PIXEL / pixels);
    };
    let pixels = map.projector.inner().width() as f32 / measurements.grid.cols() as f32;
    // Of both directions together.
    map.usual_uncertainty().unwrap_or(0.0) / 2.0_f32.sqrt() / pixels
}

/// What a pattern throws on a place, if it is the same for `clear` cells around it.
fn lit(grid: Grid, [across, down]: [f32; 2], clear: f32, pattern: &[f64]) -> Option<f64> {
    let cell = |x: f32, y: f32| -> Option<f64> {
        let inside = x >= 0.0 && y >= 0.0;
        let (col, row) = (x as usize, y as usize);
        let inside = inside && col < grid.cols() && row < grid.rows();
        inside.then(|| pattern[row * grid.cols() + col])
    };
    let first = cell(across - clear, down - clear)?;
    let others = [(1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
    let same = |(x, y): (f32, f32)| cell(across + x * clear, down + y * clear) == Some(first);
    others.into_iter().all(same).then_some(first)
}

impl SiteFit {
    fn new(sums: &[[Sums; 2]; HALVINGS]) -> Option<Self> {
        let halves = |bit: usize| Some([sums[bit][0].fit()?, sums[bit][1].fit()?]);
        let [first, second] = sums[0];
        Some(Self {
            whole: first.joined(second).fit()?,
            halves: std::array::from_fn(halves),
        })
    }
}

/// A pixel in a photograph.
#[derive(Clone, Copy)]
struct Sample {
    direct: f64,
    bounced: f64,
    /// What is seen beyond both.
    error: f64,
}

impl Sample {
    fn explained(self, [a, b]: [f64; 2]) -> f64 {
        a * self.direct + b * self.bounced
    }

    fn rest(self, fit: [f64; 2]) -> f64 {
        self.error - self.explained(fit)
    }
}

/// Sums of products of direct light, bounced light and error over some photographs.
#[derive(Clone, Copy, Default)]
struct Sums([f64; 5]);

impl Sums {
    fn add(&mut self, sample: Sample) {
        let Sample {
            direct,
            bounced,
            error,
        } = sample;
        let products = [
            direct * direct,
            direct * bounced,
            bounced * bounced,
            direct * error,
            bounced * error,
        ];
        *self = self.joined(Self(products));
    }

    fn joined(self, other: Self) -> Self {
        Self(std::array::from_fn(|at| self.0[at] + other.0[at]))
    }

    /// How far off direct and bounced light are, by least squares; `None` where the photographs
    /// do not tell the two apart.
    fn fit(self) -> Option<[f64; 2]> {
        let [dd, db, bb, de, be] = self.0;
        let determinant = dd * bb - db * db;
        let told = determinant > LEAST_DETERMINANT * dd * bb;
        told.then(|| {
            [
                (bb * de - db * be) / determinant,
                (dd * be - db * de) / determinant,
            ]
        })
    }
}

/// A mean that is still growing.
#[derive(Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn join(&mut self, other: &Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count.max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_at_an_edge_of_a_pattern_is_not_judged() {
        let grid = Grid::new(2, 3).unwrap();
        let pattern = [1.0, 1.0, 0.0, 1.0, 1.0, 0.0];
        assert_eq!(lit(grid, [1.0, 0.5], 0.1, &pattern), Some(1.0));
        assert_eq!(lit(grid, [2.5, 1.0], 0.1, &pattern), Some(0.0));
        assert_eq!(lit(grid, [1.95, 0.5], 0.1, &pattern), None);
        assert_eq!(lit(grid, [0.05, 0.5], 0.1, &pattern), None);
    }

    #[test]
    fn values_between_four_centres_are_linear_and_constant_beyond_them() {
        let grid = Grid::new(2, 2).unwrap();
        let values = [0.0, 1.0, 2.0, 3.0];
        let at = |place| Corners::new(place, grid, [1; 2]).of(&values);
        assert!((at([1.0, 1.0]) - 1.5).abs() < 1e-9);
        assert!((at([0.75, 0.5]) - 0.25).abs() < 1e-6);
        assert!((at([0.1, 1.9]) - 2.0).abs() < 1e-6);
        let fine: Vec<f64> = (0..16).map(|at| f64::from(at % 4)).collect();
        assert!((Corners::new([1.0, 1.0], grid, [2; 2]).of(&fine) - 1.5).abs() < 1e-6);
    }

    #[test]
    fn errors_of_direct_and_bounced_light_are_told_apart_where_photographs_do() {
        let sample = |direct: f64, bounced: f64| Sample {
            direct,
            bounced,
            error: 0.1 * direct - 0.2 * bounced,
        };
        let mut sums = Sums::default();
        sums.add(sample(1.0, 0.3));
        assert_eq!(sums.fit(), None);
        sums.add(sample(0.0, 0.2));
        let [a, b] = sums.fit().unwrap();
        assert!((a - 0.1).abs() < 1e-9 && (b + 0.2).abs() < 1e-9);
    }
}
