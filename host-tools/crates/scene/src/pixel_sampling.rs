//! Pixel sampling: what the camera sees straight of a frame that is finer than the cells.
//!
//! Surfaces are cut where cells end, so that bounced light knows cells only: it comes from the
//! mean light of each. Light straight from the projector knows every pixel.

use super::camera_sampling::{self, SamplingOptions};
use super::effects::Effect;
use super::facets::Facets;
use super::projector_light::{Beam, ProjectorLight, reached, share};
use super::simulation::Simulation;
use super::sparse::SparseRows;
use iltm_picture::FramePart;
use iltm_runtime::FrameSize;
use nalgebra::DMatrix;
use std::iter;

/// What each camera pixel sees of each pixel of a frame, which all projectors share.
#[derive(Clone, Debug)]
pub(crate) struct FrameSampling {
    /// Of the frame, borders left out.
    pub(crate) size: FrameSize,
    /// The part of each projector and what is seen of it.
    pub(crate) projectors: Vec<(FramePart, PixelSampling)>,
}

impl FrameSampling {
    /// Follows the camera's rays to the pixels of a frame.
    ///
    /// # Panics
    /// If projectors share a pixel of it.
    pub(crate) fn new(simulation: &Simulation<'_>, size: FrameSize) -> Self {
        let parts = simulation.scene.parts_of(size);
        let parts = parts.expect("a frame that divides among the projectors");
        let all = iter::once(simulation).chain(&simulation.beside);
        let projectors = parts.into_iter().zip(all).map(|(part, one)| {
            let own = part.frame().expect("a pixel a cell or more");
            (part, PixelSampling::new(one, own))
        });
        Self {
            size,
            projectors: projectors.collect(),
        }
    }
}

/// What each camera pixel sees of each pixel of a projector's frame.
#[derive(Clone, Debug)]
pub(crate) struct PixelSampling {
    size: FrameSize,
    /// Camera pixels x frame pixels, one entry a channel.
    pub(crate) direct: Vec<SparseRows>,
    /// Standard deviation of the blur in frame pixels, across and down; 0 for none.
    blur: [f64; 2],
}

impl PixelSampling {
    fn new(simulation: &Simulation<'_>, size: FrameSize) -> Self {
        let on = |effect| simulation.decisions.on(effect);
        let facets = Facets::new(simulation.scene, simulation.index);
        let beam = Beam {
            vignetting: on(Effect::Vignetting),
            blur: false,
            shadows: on(Effect::Shadows),
        };
        let light = ProjectorLight::new(&facets, beam).of_pixels(size);
        let options = SamplingOptions {
            channels: simulation.channels,
            gloss: on(Effect::Gloss),
            mirrors: on(Effect::Mirrors),
            distortion: on(Effect::Distortion),
        };
        let projector = simulation.projector();
        let cells = FrameSize::of_grid(projector.grid);
        let sigma = if on(Effect::Blur) {
            projector.blur
        } else {
            0.0
        };
        Self {
            size,
            direct: camera_sampling::direct(&facets, &light, options),
            blur: [
                sigma * size.width() as f64 / cells.width() as f64,
                sigma * size.height() as f64 / cells.height() as f64,
            ],
        }
    }

    /// Blurs the light of a frame, which is black all around.
    pub(crate) fn blur(&self, light: &mut DMatrix<f64>) {
        let (width, height) = (self.size.width(), self.size.height());
        if self.blur[0] > 0.0 {
            let kernel = Kernel::new(self.blur[0], width);
            for row in light.as_mut_slice().chunks_exact_mut(width) {
                let blurred = kernel.blurred(|x| row[x]);
                row.copy_from_slice(&blurred);
            }
        }
        if self.blur[1] > 0.0 {
            let kernel = Kernel::new(self.blur[1], height);
            for x in 0..width {
                let blurred = kernel.blurred(|y| light[y * width + x]);
                for (y, blurred) in blurred.into_iter().enumerate() {
                    light[y * width + x] = blurred;
                }
            }
        }
    }
}

/// Blur along a line of pixels.
struct Kernel {
    /// Share of a pixel's light as far as some pixels away, from none to the last that counts.
    shares: Vec<f64>,
    count: usize,
}

impl Kernel {
    fn new(sigma: f64, count: usize) -> Self {
        let reach = reached(0.5, sigma, count);
        let shares = reach.map(|at| share(0.5, sigma, at)).collect();
        Self { shares, count }
    }

    fn blurred(&self, line: impl Fn(usize) -> f64) -> Vec<f64> {
        let reach = self.shares.len().saturating_sub(1);
        let at = |at: usize| {
            let near = at.saturating_sub(reach)..(at + reach + 1).min(self.count);
            near.map(|other| self.shares[at.abs_diff(other)] * line(other))
                .sum()
        };
        (0..self.count).map(at).collect()
    }
}
