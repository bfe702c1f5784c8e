//! Exposure: light in the scene while the projector shows patterns, and what the camera's pixels
//! see of it.

use super::effects::Effect;
use super::pixel_sampling::FrameSampling;
use super::radiosity::{FormFactorMatrix, StopRule, radiosity};
use super::simulation::{Simulation, SimulationError};
use iltm_picture::FramePart;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::iter;

/// Part of the threshold that bounces may leave out.
const OF_THRESHOLD: f64 = 0.1;

/// Times that light is sent over mirrors and lobes at most: each time, what is left
/// of it shrinks by their reflectance.
const MOST_SPECULAR: usize = 100;

/// Light in the scene under some patterns, all `patches x patterns`, one entry a
/// channel.
#[derive(Clone, Debug)]
pub struct Exposed {
    /// What each channel of the camera gets from the projector, cells x patterns, its
    /// black included; one entry where it is the same for all channels.
    shown: Vec<DMatrix<f64>>,
    /// Irradiance that is not straight from the projector.
    indirect: Vec<DMatrix<f64>>,
    /// Light that leaves patches.
    pub(super) leaving: Vec<DMatrix<f64>>,
    /// Light from elsewhere.
    ambient: Vec<f64>,
    /// In the light of each further projector.
    beside: Vec<Self>,
    /// Bounces that were followed, or steps of the solve.
    pub bounces: usize,
}

/// The entry of a channel; there is one alone where all are the same.
fn of_channel(entries: &[DMatrix<f64>], channel: usize) -> &DMatrix<f64> {
    &entries[channel.min(entries.len() - 1)]
}

/// The factors of a projector's lamp.
fn of_projector(lamps: &[Vec<f64>], projector: usize) -> &[f64] {
    &lamps[projector.min(lamps.len() - 1)]
}

/// A part of frames of this width; frames are columns of a matrix, pixels x frames.
fn of_part(frames: &DMatrix<f64>, width: usize, part: &FramePart) -> DMatrix<f64> {
    frames.select_rows(&part.places(width).collect::<Vec<_>>())
}

/// Adds the light of a photograph, channel by channel.
fn add(planes: &mut [Vec<f32>], more: &[Vec<f32>]) {
    for (plane, more) in planes.iter_mut().zip(more) {
        for (light, more) in plane.iter_mut().zip(more) {
            *light += more;
        }
    }
}

impl Simulation<'_> {
    /// Light in the scene while the projector shows `patterns`, cells x patterns, 0
    /// to 1.
    ///
    /// # Errors
    /// [`SimulationError::Radiosity`] if there is no end to the bounces.
    pub fn expose(&self, patterns: &DMatrix<f64>) -> Result<Exposed, SimulationError> {
        let lamp = vec![1.0; patterns.ncols()];
        self.expose_projected(std::slice::from_ref(patterns), &[lamp])
    }

    /// Light in the scene while each of the projector's channels shows an entry of
    /// `projected`, cells x patterns, 0 to 1, or all the same one entry. An entry of `lamps`
    /// multiplies all of a projector's light, black as well, one factor a pattern; the last
    /// one is for all further projectors.
    ///
    /// A grey camera sees the mean of the channels.
    ///
    /// # Errors
    /// [`SimulationError::Radiosity`] if there is no end to the bounces.
    pub fn expose_projected(
        &self,
        projected: &[DMatrix<f64>],
        lamps: &[Vec<f64>],
    ) -> Result<Exposed, SimulationError> {
        if self.beside.is_empty() {
            return self.expose_one(projected, of_projector(lamps, 0));
        }
        let (width, parts) = (self.grid().cols(), self.scene.parts());
        let of = |index: usize| -> Vec<_> {
            let channels = projected.iter();
            channels
                .map(|all| of_part(all, width, &parts[index]))
                .collect()
        };
        let mut exposed = self.expose_one(&of(0), of_projector(lamps, 0))?;
        for (index, one) in (1..).zip(&self.beside) {
            let beside = one.expose_one(&of(index), of_projector(lamps, index))?;
            exposed.bounces = exposed.bounces.max(beside.bounces);
            exposed.beside.push(beside);
        }
        Ok(exposed)
    }

    /// In the light of one projector.
    pub(super) fn expose_one(
        &self,
        projected: &[DMatrix<f64>],
        lamp: &[f64],
    ) -> Result<Exposed, SimulationError> {
        let shown = self.seen_by_channels(projected, lamp);
        let direct: Vec<_> = shown.iter().map(|s| self.on_patches.product(s)).collect();
        let mut exposed = Exposed {
            shown,
            indirect: Vec::new(),
            leaving: Vec::new(),
            ambient: Vec::new(),
            beside: Vec::new(),
            bounces: 0,
        };
        for channel in 0..self.channels {
            let ambient = if self.decisions.on(Effect::Ambient) {
                self.scene.ambient_beside(self.index)[channel]
            } else {
                0.0
            };
            let albedo: Vec<f64> = self.patches.iter().map(|p| p.albedo[channel]).collect();
            // It comes from where no other surface is in the way.
            let open = self.exchange.as_ref().map(FormFactorMatrix::row_sums);
            let direct = of_channel(&direct, channel);
            let mut indirect = DMatrix::from_fn(direct.nrows(), direct.ncols(), |patch, _| {
                ambient * (1.0 - open.as_ref().map_or(0.0, |sums| sums[patch]))
            });
            if let Some(specular) = &self.specular {
                indirect += specular
                    .from_cells
                    .product(of_channel(&exposed.shown, channel));
            }
            let leaving = self.bounce(&albedo, direct, &mut indirect, &mut exposed)?;
            exposed.indirect.push(indirect);
            exposed.leaving.push(leaving);
            exposed.ambient.push(ambient);
        }
        Ok(exposed)
    }

    /// What each of the camera's channels gets of the projector's, its black included.
    fn seen_by_channels(&self, projected: &[DMatrix<f64>], lamp: &[f64]) -> Vec<DMatrix<f64>> {
        let black = if self.decisions.on(Effect::Black) {
            self.projector().black
        } else {
            0.0
        };
        let lit = |light: &DMatrix<f64>| {
            let mut lit = light.map(|light| black + (1.0 - black) * light);
            for (mut column, lamp) in lit.column_iter_mut().zip(lamp) {
                column *= *lamp;
            }
            lit
        };
        let lit: Vec<_> = projected.iter().map(lit).collect();
        let mixed = |weights: [f64; 3]| {
            let mut sum = weights[0] * of_channel(&lit, 0);
            sum += weights[1] * of_channel(&lit, 1);
            sum += weights[2] * of_channel(&lit, 2);
            sum
        };
        if self.channels == 1 {
            return if lit.len() == 1 {
                lit
            } else {
                vec![mixed([1.0 / 3.0; 3])]
            };
        }
        if self.decisions.on(Effect::Mixing) {
            return self.projector().mixing.map(mixed).into();
        }
        lit
    }

    /// The light that leaves patches, from what arrives straight and otherwise; adds
    /// to `indirect` what other patches send.
    fn bounce(
        &self,
        albedo: &[f64],
        direct: &DMatrix<f64>,
        indirect: &mut DMatrix<f64>,
        exposed: &mut Exposed,
    ) -> Result<DMatrix<f64>, SimulationError> {
        let reflected = |light: &DMatrix<f64>| {
            let mut light = light.clone();
            for mut column in light.column_iter_mut() {
                column.iter_mut().zip(albedo).for_each(|(l, a)| *l *= a);
            }
            light
        };
        let stop = StopRule::Share(OF_THRESHOLD * self.threshold);
        let arriving = direct + &*indirect;
        let mut leaving = reflected(&arriving);
        // What mirrors and lobes add is bounced in turn, until little is added.
        let mut fresh = arriving;
        for round in 0..MOST_SPECULAR {
            let sent = match &self.exchange {
                Some(exchange) => {
                    let all = radiosity(exchange, albedo, &fresh, stop)?;
                    exposed.bounces = exposed.bounces.max(all.bounces);
                    *indirect += exchange.irradiance(&all.light);
                    all.light
                }
                None => reflected(&fresh),
            };
            if round == 0 {
                leaving.copy_from(&sent);
            } else {
                leaving += &sent;
            }
            let Some(specular) = &self.specular else {
                break;
            };
            fresh = specular.from_patches.product(&sent);
            *indirect += &fresh;
            if fresh.norm() <= OF_THRESHOLD * self.threshold * leaving.norm() {
                break;
            }
        }
        Ok(leaving)
    }

    /// What the camera's pixels see of one of the patterns, one plane a channel, row
    /// by row, before exposure and noise.
    #[must_use]
    pub fn photograph(&self, exposed: &Exposed, pattern: usize) -> Vec<Vec<f32>> {
        let mut planes = self.seen(exposed, pattern, &|channel, pixel| {
            let shown = of_channel(&exposed.shown, channel).column(pattern);
            self.sight.direct[channel].times(pixel, |cell| shown[cell])
        });
        for (one, exposed) in self.beside.iter().zip(&exposed.beside) {
            add(&mut planes, &one.photograph(exposed, pattern));
        }
        planes
    }

    /// The same of a frame that is finer than the cells, whose means the pattern was. `projected`
    /// is what each of the projector's channels shows of it, one column, or all the same one
    /// entry; `lamps` has a factor for each projector.
    pub(crate) fn photograph_of_pixels(
        &self,
        exposed: &Exposed,
        pattern: usize,
        sampling: &FrameSampling,
        projected: &[DMatrix<f64>],
        lamps: &[f64],
    ) -> Vec<Vec<f32>> {
        let all = iter::once((self, exposed)).chain(self.beside.iter().zip(&exposed.beside));
        let of_projectors = sampling.projectors.iter().zip(lamps);
        let each = all
            .zip(of_projectors)
            .map(|((one, exposed), ((part, pixels), lamp))| {
                let own = |frame| of_part(frame, sampling.size.width(), part);
                let own: Vec<_> = projected.iter().map(own).collect();
                let mut shown = one.seen_by_channels(&own, &[*lamp]);
                for light in &mut shown {
                    pixels.blur(light);
                }
                one.seen(exposed, pattern, &|channel, pixel| {
                    let shown = of_channel(&shown, channel);
                    pixels.direct[channel].times(pixel, |at| shown[at])
                })
            });
        let sum = each.reduce(|mut planes, more| {
            add(&mut planes, &more);
            planes
        });
        sum.unwrap_or_default()
    }

    /// What the camera's pixels see, with light straight from the projector by channel and pixel.
    fn seen(
        &self,
        exposed: &Exposed,
        pattern: usize,
        direct: &(dyn Fn(usize, usize) -> f64 + Sync),
    ) -> Vec<Vec<f32>> {
        (0..self.channels)
            .map(|channel| {
                let indirect = exposed.indirect[channel].column(pattern);
                let leaving = exposed.leaving[channel].column(pattern);
                let ambient = exposed.ambient[channel];
                let pixel = |pixel| {
                    let bounced = self.sight.indirect[channel].times(pixel, |at| indirect[at]);
                    let detail = self.sight.detail[channel]
                        // Where a surface is in view, light from elsewhere is not.
                        .times(pixel, |at| leaving[at] - ambient);
                    let lobes = self.sight.lobes.times(pixel, |at| leaving[at]);
                    let elsewhere = ambient * f64::from(self.sight.open[pixel]);
                    let direct = direct(channel, pixel);
                    (direct + bounced + detail + lobes + elsewhere).max(0.0) as f32
                };
                let (width, height) = self.scene.camera.size;
                (0..(width * height) as usize)
                    .into_par_iter()
                    .map(pixel)
                    .collect()
            })
            .collect()
    }
}
