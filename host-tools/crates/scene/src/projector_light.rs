//! Projector light on a surface: shape of the beam, vignetting,
//! blur and shadows.

use super::description::Projector;
use super::facets::Facets;
use super::patches::{Patch, samples};
use super::pinhole::FramePlace;
use super::sparse::{SparseRows, merge};
use iltm_runtime::FrameSize;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Standard deviations of the blur beyond which nothing is counted: less than
/// 1e-4 of a cell's light is out there.
const BLUR_REACH: f64 = 4.0;
/// Samples along a patch of what varies within it.
const SAMPLES: usize = 6;

/// What is simulated of the projector's light.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Beam {
    /// Whether light falls off to the corners.
    pub vignetting: bool,
    /// Whether cells run into each other.
    pub blur: bool,
    /// Whether surfaces throw shadows.
    pub shadows: bool,
}

/// The projector as a source of light.
///
/// It is a point with a flat frame that it lights evenly: a plane that faces it has
/// the same irradiance everywhere, 1 at the distance of the place looked at.
#[derive(Clone, Debug)]
pub(crate) struct ProjectorLight<'f> {
    facets: &'f Facets<'f>,
    beam: Beam,
    /// Cells across and down, or the pixels of a finer frame.
    frame: FrameSize,
}

impl<'f> ProjectorLight<'f> {
    /// The light of the scene's projector, as much of it as `beam` says.
    pub(crate) fn new(facets: &'f Facets<'f>, beam: Beam) -> Self {
        Self {
            facets,
            beam,
            frame: FrameSize::of_grid(facets.projector().grid),
        }
    }

    /// The same light of a frame whose pixels are told apart instead of the cells. Their blur is
    /// left to whoever makes the frame.
    pub(crate) fn of_pixels(self, frame: FrameSize) -> Self {
        let beam = Beam {
            blur: false,
            ..self.beam
        };
        Self {
            beam,
            frame,
            ..self
        }
    }

    fn projector(&self) -> &'f Projector {
        self.facets.projector()
    }

    /// Irradiance by white of a point with this normal, blur and shadows aside.
    pub(crate) fn irradiance(
        &self,
        place: FramePlace,
        world: &Vector3<f64>,
        normal: &Vector3<f64>,
    ) -> f64 {
        let view = &self.projector().view;
        let way = world - view.position();
        // cos / (z^2 cos_axis), by lengths: the frame is flat, not round.
        let falling = -normal.dot(&way) * view.focus().powi(2) / place.depth.powi(3);
        falling.max(0.0) * self.vignette(place)
    }

    /// Share of the light that the frame has at a place.
    pub(crate) fn vignette(&self, place: FramePlace) -> f64 {
        if !self.beam.vignetting {
            return 1.0;
        }
        let (x, y) = (2.0 * place.across - 1.0, 2.0 * place.down - 1.0);
        (1.0 - self.projector().vignetting * (x * x + y * y) / 2.0).max(0.0)
    }

    /// Whether a surface stands between the projector and a point of a facet.
    pub(crate) fn shaded(&self, facet: usize, world: &Vector3<f64>) -> bool {
        if !self.beam.shadows || self.facets.shaded_by(facet).is_empty() {
            return false;
        }
        let from = self.projector().view.position();
        self.facets.obstacles().blocked(&from, world)
    }

    /// Calls `each` with every cell that lights a place of the frame and its share.
    pub(crate) fn cells(&self, place: FramePlace, mut each: impl FnMut(u32, f64)) {
        let (cols, rows) = (self.frame.width(), self.frame.height());
        let sizes = (cols as f64, rows as f64);
        let (x, y) = (place.across * sizes.0, place.down * sizes.1);
        if !self.beam.blur {
            let inside = x >= 0.0 && y >= 0.0 && x < sizes.0 && y < sizes.1;
            if inside {
                each((y as usize * cols + x as usize) as u32, 1.0);
            }
            return;
        }
        let sigma = self.projector().blur;
        for row in reached(y, sigma, rows) {
            let down = share(y, sigma, row);
            for col in reached(x, sigma, cols) {
                let weight = down * share(x, sigma, col);
                if weight > 0.0 {
                    each((row * cols + col) as u32, weight);
                }
            }
        }
    }

    /// Mean irradiance of each patch by each cell: `P`, patches x cells.
    pub(crate) fn on_patches(&self, patches: &[Patch]) -> SparseRows {
        let rows: Vec<_> = patches
            .par_iter()
            .map(|patch| self.on_patch(patch))
            .collect();
        SparseRows::from_rows(rows)
    }

    fn on_patch(&self, patch: &Patch) -> Vec<(u32, f64)> {
        if patch.back {
            return Vec::new();
        }
        let shaded = self.beam.shadows && !self.facets.shaded_by(patch.facet).is_empty();
        let plain = !(self.beam.blur || self.beam.vignetting || shaded);
        let white = self.whole(patch);
        if plain {
            return patch.cell.map(|cell| (cell, white)).into_iter().collect();
        }
        let view = &self.projector().view;
        let normal = patch.polygon.normal();
        let (mut cells, mut total) = (Vec::new(), 0.0);
        for (world, area) in samples(&patch.polygon, SAMPLES) {
            let Some(place) = view.place(&world) else {
                continue;
            };
            let even = area * self.irradiance(place, &world, &normal);
            total += even / self.vignette(place).max(f64::MIN_POSITIVE);
            if self.shaded(patch.facet, &world) {
                continue;
            }
            match patch.cell {
                // Rounding must not give a border's light to the next cell.
                Some(cell) if !self.beam.blur => cells.push((cell, even)),
                _ => self.cells(place, |cell, share| cells.push((cell, share * even))),
            }
        }
        let scale = white / total;
        if !scale.is_finite() {
            return Vec::new();
        }
        for (_, light) in &mut cells {
            *light *= scale;
        }
        merge(&mut cells, |sum, more| *sum += more);
        cells
    }

    /// Mean irradiance by white where nothing is in the way: the flux through the
    /// patch's outline in the frame, over its area.
    fn whole(&self, patch: &Patch) -> f64 {
        let view = &self.projector().view;
        let places = patch.polygon.corners().iter().map(|c| view.place(c));
        let Some(places) = places.collect::<Option<Vec<_>>>() else {
            return 0.0;
        };
        let next = places.iter().cycle().skip(1);
        let doubled: f64 = places
            .iter()
            .zip(next)
            .map(|(a, b)| {
                (a.across - places[0].across) * (b.down - places[0].down)
                    - (b.across - places[0].across) * (a.down - places[0].down)
            })
            .sum();
        let in_frame = doubled.abs() / 2.0 * view.frame_area();
        in_frame * view.focus().powi(2) / patch.polygon.area()
    }
}

/// Rows or columns that light a place.
pub(crate) fn reached(place: f64, sigma: f64, count: usize) -> std::ops::Range<usize> {
    let low = (place - BLUR_REACH * sigma).floor().max(0.0) as usize;
    let high = (place + BLUR_REACH * sigma).ceil().max(0.0) as usize;
    low.min(count)..high.min(count)
}

/// Share of a row's or column's light at a place: a box convolved with a Gaussian.
pub(crate) fn share(place: f64, sigma: f64, index: usize) -> f64 {
    let from = (index as f64 - place) / (sigma * std::f64::consts::SQRT_2);
    let to = (index as f64 + 1.0 - place) / (sigma * std::f64::consts::SQRT_2);
    0.5 * (libm::erf(to) - libm::erf(from))
}
