//! Peeling: a photograph loses bounce after bounce until what is left is below the noise.
//!
//! With `S = F1 K` the bounce that follows any light, `F1 T^-1 = I - S`: the first
//! bounce of `l` is `l - S l`, what is left is `S l`, and the first bounce of that is
//! the second of `l`. Bounce `k` is `S^(k-1) l - S^k l`, so that all bounces and what
//! is left add up to `l` whatever `S` is; that they are the light's bounces is what
//! the inverse says.

use super::BouncesError;
use super::bounce_operator::BounceOperator;

/// Bounces that are peeled at most. Where each returns three quarters of the light
/// of the one before, a millionth is left after 48.
pub const MOST_BOUNCES: usize = 64;

/// Without noise, peeling ends at this part of the photograph's root mean square:
/// what 32-bit numbers can tell.
const LEAST_LEFT: f64 = 1e-6;

/// What a layer shows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LayerKind {
    /// Light that was reflected this many times on its way from the projector: 1 is
    /// direct light.
    Bounce(usize),
    /// What is left of all further bounces, below the noise of a cell's mean.
    Rest,
    /// Light on camera pixels that no cell of the solve belongs to, which cannot be
    /// separated.
    Unseparated,
}

/// One part of a photograph's light.
#[derive(Clone, PartialEq, Debug)]
pub struct Layer {
    /// What it shows.
    pub kind: LayerKind,
    /// Light, camera units, one plane a channel, row by row. Noise makes some of it
    /// negative.
    pub planes: Vec<Vec<f32>>,
    /// Part of the photograph's light: its sum over the photograph's. These add up
    /// to 1.
    pub light_share: f64,
    /// Part of the photograph's energy: its sum of squares over the photograph's.
    /// These do not add up to 1, since the bounces overlap.
    pub energy_share: f64,
    /// Root mean square over the pixels on the wall and all channels (of the
    /// unseparated light: over the other pixels), camera units.
    pub rms: f64,
    /// Largest value, camera units.
    pub brightest: f64,
    /// Smallest value, camera units.
    pub darkest: f64,
}

/// A photograph and the layers that add up to it, bounces first.
#[derive(Clone, PartialEq, Debug)]
pub struct Separated {
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// The photograph with black subtracted, camera units, one plane a channel.
    pub photograph: Vec<Vec<f32>>,
    /// Bounces in order, then [`LayerKind::Rest`] and [`LayerKind::Unseparated`].
    pub layers: Vec<Layer>,
    /// Root mean square below which peeling ended, camera units: the noise of a cell's
    /// mean.
    pub noise: f64,
    /// Pixels on the wall.
    pub wall_pixels: usize,
}

impl Separated {
    /// Separates a photograph of the wall, one plane a channel with black subtracted,
    /// until what is left has less root mean square than `noise`.
    ///
    /// # Errors
    /// [`BouncesError::DoesNotFade`] if that takes more than [`MOST_BOUNCES`].
    ///
    /// # Panics
    /// If the planes are not of the wall's size and channels.
    pub fn new(
        wall: &BounceOperator,
        photograph: &[Vec<f32>],
        noise: f64,
    ) -> Result<Self, BouncesError> {
        let mut left: Vec<Vec<f32>> = photograph.iter().map(|p| wall.gather(p)).collect();
        let whole = rms(&left);
        let end = noise.max(LEAST_LEFT * whole);
        let mut layers = Vec::new();
        while layers.is_empty() || rms(&left) >= end {
            if layers.len() == MOST_BOUNCES {
                return Err(BouncesError::DoesNotFade {
                    bounces: layers.len(),
                    percent: 100.0 * rms(&left) / whole,
                });
            }
            let mut bounce = left.clone();
            for (channel, (bounce, left)) in bounce.iter_mut().zip(&mut left).enumerate() {
                *left = wall.next_bounce(channel, left);
                for (bounce, left) in bounce.iter_mut().zip(left) {
                    *bounce -= *left;
                }
            }
            layers.push((LayerKind::Bounce(layers.len() + 1), bounce));
        }
        layers.push((LayerKind::Rest, left));
        let sums = Sums::of(photograph);
        let on_wall = |(kind, values): (LayerKind, Vec<Vec<f32>>)| {
            let rms = rms(&values);
            let planes = values.iter().map(|values| wall.scatter(values)).collect();
            sums.layer(kind, planes, rms)
        };
        let mut layers: Vec<Layer> = layers.into_iter().map(on_wall).collect();
        let beside = beside(wall, photograph);
        layers.push(sums.layer(LayerKind::Unseparated, beside.0, beside.1));
        Ok(Self {
            size: wall.size(),
            photograph: photograph.to_vec(),
            layers,
            noise,
            wall_pixels: wall.pixels().count(),
        })
    }

    /// Largest difference, in any pixel and channel, between the layers' sum and the
    /// photograph, camera units.
    #[must_use]
    pub fn largest_gap(&self) -> f64 {
        let mut largest = 0.0_f64;
        for (channel, plane) in self.photograph.iter().enumerate() {
            for (pixel, light) in plane.iter().enumerate() {
                let parts = self.layers.iter().map(|layer| layer.planes[channel][pixel]);
                let sum: f64 = parts.map(f64::from).sum();
                largest = largest.max((sum - f64::from(*light)).abs());
            }
        }
        largest
    }
}

/// What no cell belongs to, and its root mean square there.
fn beside(wall: &BounceOperator, photograph: &[Vec<f32>]) -> (Vec<Vec<f32>>, f64) {
    let mut planes = photograph.to_vec();
    for plane in &mut planes {
        for pixel in wall.pixels() {
            plane[pixel] = 0.0;
        }
    }
    let others = wall.size().0 * wall.size().1 - wall.pixels().count();
    let squares: f64 = planes.iter().flatten().map(|v| f64::from(*v).powi(2)).sum();
    let mean = squares / (others * planes.len()).max(1) as f64;
    (planes, mean.sqrt())
}

fn rms(planes: &[Vec<f32>]) -> f64 {
    let squares: f64 = planes.iter().flatten().map(|v| f64::from(*v).powi(2)).sum();
    let samples: usize = planes.iter().map(Vec::len).sum();
    (squares / samples.max(1) as f64).sqrt()
}

/// Sums of a picture over all pixels and channels.
struct Sums {
    light: f64,
    energy: f64,
}

impl Sums {
    fn of(planes: &[Vec<f32>]) -> Self {
        let values = || planes.iter().flatten().copied().map(f64::from);
        Self {
            light: values().sum(),
            energy: values().map(|value| value * value).sum(),
        }
    }

    /// A layer of the photograph whose sums these are.
    fn layer(&self, kind: LayerKind, planes: Vec<Vec<f32>>, rms: f64) -> Layer {
        let share = |part: f64, whole: f64| if whole == 0.0 { 0.0 } else { part / whole };
        let own = Self::of(&planes);
        let values = || planes.iter().flatten().copied().map(f64::from);
        Layer {
            kind,
            light_share: share(own.light, self.light),
            energy_share: share(own.energy, self.energy),
            rms,
            brightest: values().fold(0.0, f64::max),
            darkest: values().fold(0.0, f64::min),
            planes,
        }
    }
}
