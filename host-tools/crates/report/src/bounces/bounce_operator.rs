//! One-bounce operator `F1 K`: the next bounce of any light that has landed on the wall,
//! at the camera's full resolution.

use iltm_capture::{NO_CELL, Registration};
use iltm_solve::{Interreflection, InverseTransport};
use nalgebra::DVector;
use rayon::prelude::*;

/// A camera pixel on the wall.
#[derive(Clone, Debug)]
struct WallPixel {
    pixel: u32,
    /// Cells around it and their weights: `U`.
    weights: [(u32, f32); 4],
}

/// The wall as the camera sees it: pixels, and how light goes between them.
///
/// A bounce is `S l = F1 K l`, at a pixel `x`
///
/// ```text
/// (S l)(x) = (U K A l)(x) / g(x),    g(x) = (U (g b))(x) / b(x)
/// ```
///
/// with `A` the mean over each cell's pixels, `U` linear between the cells' centres,
/// `K` and `g` the solved inverse's and `b` the flood photograph: texture finer than
/// the cells is the flood photograph's own, as in a table's
/// [fine gains](iltm_compile::gain::fine_gains).
#[derive(Clone, Debug)]
pub struct BounceOperator {
    size: (usize, usize),
    places: Vec<WallPixel>,
    /// Cell whose mean a pixel is part of, by place; `None` where it sees two.
    members: Vec<Option<u32>>,
    /// Pixels of each cell's mean, length `N`.
    counts: Vec<u32>,
    channels: Vec<OperatorChannel>,
}

#[derive(Clone, Debug)]
struct OperatorChannel {
    operator: Interreflection,
    /// `1 / g(x)` by place: light that is seen for light that lands.
    fade: Vec<f32>,
}

impl BounceOperator {
    /// The pixels whose cells took part in the solve; `flood` is the photograph of
    /// white with black subtracted, one plane a channel.
    ///
    /// # Panics
    /// If the inverse is not of the registration's grid or the flood photograph's
    /// channels.
    #[must_use]
    pub fn new(
        registration: &Registration,
        flood: &[Vec<f32>],
        inverse: &InverseTransport,
    ) -> Self {
        let grid = inverse.grid;
        let mut places = Vec::new();
        for pixel in 0..registration.seen_cell.len() {
            let weights = registration.weights(grid, &inverse.live, pixel);
            places.extend(weights.map(|weights| WallPixel {
                pixel: pixel as u32,
                weights: weights.map(|(cell, weight)| (cell as u32, weight as f32)),
            }));
        }
        let cell = |place: &WallPixel| {
            let cell = registration.cell_of_pixel[place.pixel as usize];
            (cell != NO_CELL).then_some(cell)
        };
        let members: Vec<Option<u32>> = places.iter().map(cell).collect();
        let mut counts = vec![0; grid.cells()];
        for cell in members.iter().flatten() {
            counts[*cell as usize] += 1;
        }
        let mut wall = Self {
            size: registration.camera,
            places,
            members,
            counts,
            channels: Vec::new(),
        };
        let channels = (0..inverse.channels.len()).map(|channel| {
            let found = inverse.channel(channel);
            let on_wall: Vec<f32> = wall.gather(&flood[channel]);
            // 1 + K b where the inverse is exact: all light that lands under white.
            let landed = wall.means(&on_wall).component_mul(&found.gain);
            let landed = wall.interpolated(&landed);
            let fade =
                on_wall.iter().zip(landed).map(
                    |(flood, landed)| {
                        if landed > 0.0 { flood / landed } else { 0.0 }
                    },
                );
            OperatorChannel {
                fade: fade.collect(),
                operator: found.operator,
            }
        });
        let channels: Vec<OperatorChannel> = channels.collect();
        wall.channels = channels;
        wall
    }

    /// Width and height of the camera's pictures.
    #[must_use]
    pub const fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The pixels on the wall, ascending.
    pub fn pixels(&self) -> impl Iterator<Item = usize> {
        self.places.iter().map(|place| place.pixel as usize)
    }

    /// Whether a pixel is on the wall.
    #[must_use]
    pub fn holds(&self, pixel: usize) -> bool {
        let found = self
            .places
            .binary_search_by_key(&pixel, |place| place.pixel as usize);
        found.is_ok()
    }

    /// The values of a plane at the wall's pixels.
    pub(super) fn gather(&self, plane: &[f32]) -> Vec<f32> {
        self.pixels().map(|pixel| plane[pixel]).collect()
    }

    /// A plane of the camera's size with values at the wall's pixels, 0 elsewhere.
    pub(super) fn scatter(&self, values: &[f32]) -> Vec<f32> {
        let mut plane = vec![0.0; self.size.0 * self.size.1];
        for (pixel, value) in self.pixels().zip(values) {
            plane[pixel] = *value;
        }
        plane
    }

    /// The bounce that follows `light`, of one channel, at the wall's pixels.
    ///
    /// # Panics
    /// If there is no such channel, or not a value a pixel.
    pub(super) fn next_bounce(&self, channel: usize, light: &[f32]) -> Vec<f32> {
        let channel = &self.channels[channel];
        let thrown = &channel.operator * &self.means(light);
        let mut next = self.interpolated(&thrown);
        for (light, fade) in next.iter_mut().zip(&channel.fade) {
            *light *= fade;
        }
        next
    }

    /// `A`: the mean over each cell's pixels, length `N`; 0 where there is none.
    fn means(&self, light: &[f32]) -> DVector<f64> {
        let mut means = DVector::zeros(self.counts.len());
        for (cell, light) in self.members.iter().zip(light) {
            if let Some(cell) = cell {
                means[*cell as usize] += f64::from(*light);
            }
        }
        for (mean, count) in means.iter_mut().zip(&self.counts) {
            *mean /= f64::from((*count).max(1));
        }
        means
    }

    /// Variance of a cell's mean, mean over the cells, from the variances of independent
    /// pixels.
    pub(super) fn mean_variance(&self, variances: &[f32]) -> f64 {
        let means = self.means(variances);
        let counted = || {
            means
                .iter()
                .zip(&self.counts)
                .filter(|(_, count)| **count > 0)
        };
        let sum: f64 = counted()
            .map(|(mean, count)| mean / f64::from(*count))
            .sum();
        sum / counted().count().max(1) as f64
    }

    /// `U`: values of cells, linear between their centres.
    fn interpolated(&self, cells: &DVector<f64>) -> Vec<f32> {
        let at = |place: &WallPixel| {
            let corner = |(cell, weight): (u32, f32)| f64::from(weight) * cells[cell as usize];
            place.weights.map(corner).iter().sum::<f64>() as f32
        };
        self.places.par_iter().map(at).collect()
    }
}
