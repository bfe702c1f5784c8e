//! A scene ready to be photographed: every effect decided, everything that does not
//! depend on the pattern computed once.

use super::decide::{self, percent};
use super::description::Scene;
use super::effects::{Decision, Decisions, Effect, Forced};
use super::exchange::{
    Exchange, ExchangeError, ExchangeOptions, How, Occlusion, RadiosityError, Stop, radiosity,
};
use super::facets::Facets;
use super::near::NearLight;
use super::patches::{Cut, Patch, Patches};
use super::projector_light::{Beam, ProjectorLight};
use super::sensor::{Readout, Sensor};
use super::sight::{Looks, Sight};
use super::sparse::Rows;
use super::specular::{Specular, Surfaces, TooGlossy};
use crate::progress::Progress;
use iltm_runtime::Grid;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::time::Instant;
use thiserror::Error;

/// Part of the threshold that bounces may leave out.
const OF_THRESHOLD: f64 = 0.1;
/// Times that light is sent over mirrors and lobes at most: each time, what is left
/// of it shrinks by their reflectance.
const MOST_SPECULAR: usize = 100;

/// How to simulate.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SimulationOptions {
    /// Effects wanted on or off whatever the scene says.
    pub forced: Forced,
    /// Share of white below which an effect is left out; `None` asks the camera's
    /// noise.
    pub threshold: Option<f64>,
}

/// Why a scene cannot be simulated.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// No surface is in the projector's light.
    #[error("the projector lights none of the panels")]
    NothingLit,
    /// The light between surfaces cannot be computed.
    #[error(transparent)]
    Exchange(#[from] ExchangeError),
    /// There is no end to the bounces.
    #[error(transparent)]
    Radiosity(#[from] RadiosityError),
    /// Lobes would take too long.
    #[error(transparent)]
    TooGlossy(#[from] TooGlossy),
}

impl SimulationError {
    /// What to do next, a sentence.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::NothingLit => {
                "Check the projector's position, look_at and field_of_view against the panels."
            }
            Self::Radiosity(_) => {
                "Lower the albedo of the panels, or leave more of the scene open."
            }
            Self::Exchange(_) | Self::TooGlossy(_) => "Use fewer cells or a coarser mesh.",
        }
    }
}

/// A scene that photographs can be taken of.
#[derive(Clone, Debug)]
pub struct Simulation<'s> {
    scene: &'s Scene,
    channels: usize,
    decisions: Decisions,
    threshold: f64,
    patches: Vec<Patch>,
    /// Irradiance of patches by cells.
    on_patches: Rows,
    exchange: Option<Exchange>,
    specular: Option<Specular>,
    sight: Sight,
    /// Seconds that following the camera's rays took.
    rays: f64,
}

/// What a simulation consists of.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Work {
    /// Pairs of a patch and a cell that lights it.
    pub lit: usize,
    /// Form factors evaluated.
    pub exchanged: u64,
}

/// Light in the scene under some patterns, all `patches x patterns`, one entry a
/// channel.
#[derive(Clone, Debug)]
pub struct Exposed {
    /// What the projector shows, cells x patterns, its black included.
    shown: DMatrix<f64>,
    /// Irradiance that is not straight from the projector.
    indirect: Vec<DMatrix<f64>>,
    /// Light that leaves patches.
    leaving: Vec<DMatrix<f64>>,
    /// Light from elsewhere.
    ambient: Vec<f64>,
    /// Bounces that were followed, or steps of the solve.
    pub bounces: usize,
    /// How the light after all bounces was found; `None` without any.
    pub how: Option<How>,
}

impl<'s> Simulation<'s> {
    /// Decides about every effect and computes what patterns do not change.
    ///
    /// # Errors
    /// [`SimulationError`] if nothing is lit, or surfaces keep too much light.
    pub fn new(
        scene: &'s Scene,
        options: &SimulationOptions,
        progress: &dyn Progress,
    ) -> Result<Self, SimulationError> {
        let threshold = options
            .threshold
            .unwrap_or_else(|| decide::threshold(scene));
        let mut decisions = Decisions::new(options.forced.clone());
        let facets = Facets::new(scene);
        decide::named(&facets, threshold, &mut decisions);
        let channels = if decisions.on(Effect::Colour) { 3 } else { 1 };
        let beam = Beam {
            vignetting: decisions.on(Effect::Vignetting),
            blur: decisions.on(Effect::Blur),
            shadows: decide::shadows(&facets, &mut decisions),
        };
        let clock = Instant::now();
        let taking = decide::between_surfaces(&facets, threshold, &mut decisions);
        decisions.took(Effect::Interreflection, clock.elapsed().as_secs_f64());
        let cut = Cut {
            detail: 1,
            surroundings: taking.surroundings,
            backs: taking.backs,
        };
        let patches = Patches::new(&facets, cut);
        let light = ProjectorLight::new(&facets, beam);
        let clock = Instant::now();
        let on_patches = light.on_patches(patches.all());
        if on_patches.entries() == 0 {
            return Err(SimulationError::NothingLit);
        }
        if beam.shadows {
            decisions.took(Effect::Shadows, clock.elapsed().as_secs_f64());
        }
        let exchange = if taking.interreflection {
            Some(exchange(&facets, patches.all(), &mut decisions, progress)?)
        } else {
            decisions.rule_out(Effect::Occlusion, "no light goes between surfaces");
            None
        };
        let mut simulation = Self {
            scene,
            channels,
            threshold,
            decisions,
            patches: patches.all().to_vec(),
            on_patches,
            exchange,
            specular: None,
            sight: Sight::blind(),
            rays: 0.0,
        };
        let surfaces = Surfaces {
            facets: &facets,
            patches: &patches,
            light: &light,
            on_patches: &simulation.on_patches,
        };
        let lobes = simulation.exchange.as_ref();
        simulation.specular = specular(surfaces, lobes, &mut simulation.decisions)?;
        let near = simulation.detail(&facets)?;
        let clock = Instant::now();
        progress.begin("following the camera's rays", 0);
        let looks = Looks {
            channels,
            gloss: simulation.decisions.on(Effect::Gloss),
            mirrors: simulation.decisions.on(Effect::Mirrors),
        };
        simulation.sight = Sight::new(&facets, &patches, &light, near.as_ref(), looks);
        progress.end();
        simulation.rays = clock.elapsed().as_secs_f64();
        Ok(simulation)
    }

    /// Decides whether bounced light differs within patches so much that it shows.
    fn detail(&mut self, facets: &Facets<'_>) -> Result<Option<NearLight>, SimulationError> {
        let Some(exchange) = &self.exchange else {
            self.decisions
                .rule_out(Effect::Detail, "no light is bounced");
            return Ok(None);
        };
        let clock = Instant::now();
        let hidden = exchange.report().occludable > 0 && self.decisions.on(Effect::Occlusion);
        let obstacles = hidden.then_some(facets.obstacles());
        let (width, height) = self.scene.camera.size;
        let near = NearLight::new(&self.patches, obstacles, (width * height) as usize);
        let white = DMatrix::from_element(self.scene.projector.grid.cells(), 1, 1.0);
        let flood = self.expose(&white)?;
        let level = self.level();
        let largest = flood
            .leaving
            .iter()
            .map(|leaving| near.largest(&self.patches, leaving.as_slice()))
            .fold(0.0, f64::max)
            / level;
        let on = self.decisions.decide(
            Effect::Detail,
            largest >= self.threshold,
            format!(
                "bounced light differs within a patch by up to {} of white, from {} neighbours",
                percent(largest),
                near.pairs()
            ),
        );
        self.decisions
            .took(Effect::Detail, clock.elapsed().as_secs_f64());
        Ok(on.then_some(near))
    }

    /// Brightest light straight from the projector's white on any patch.
    fn level(&self) -> f64 {
        let of = |patch: usize| {
            let lit = self.on_patches.times(patch, |_| 1.0);
            let albedo = self.patches[patch].albedo.into_iter().fold(0.0, f64::max);
            lit * albedo
        };
        let level = (0..self.patches.len()).map(of).fold(0.0, f64::max);
        if level > 0.0 { level } else { 1.0 }
    }

    /// Light in the scene while the projector shows `patterns`, cells x patterns, 0
    /// to 1.
    ///
    /// # Errors
    /// [`SimulationError::Radiosity`] if there is no end to the bounces.
    pub fn expose(&self, patterns: &DMatrix<f64>) -> Result<Exposed, SimulationError> {
        let black = if self.decisions.on(Effect::Black) {
            self.scene.projector.black
        } else {
            0.0
        };
        let shown = patterns.map(|light| black + (1.0 - black) * light);
        let direct = self.on_patches.product(&shown);
        let mut exposed = Exposed {
            shown,
            indirect: Vec::new(),
            leaving: Vec::new(),
            ambient: Vec::new(),
            bounces: 0,
            how: None,
        };
        for channel in 0..self.channels {
            let ambient = if self.decisions.on(Effect::Ambient) {
                self.scene.ambient[channel]
            } else {
                0.0
            };
            let albedo: Vec<f64> = self.patches.iter().map(|p| p.albedo[channel]).collect();
            // It comes from where no other surface is in the way.
            let open = self.exchange.as_ref().map(Exchange::row_sums);
            let mut indirect = DMatrix::from_fn(direct.nrows(), direct.ncols(), |patch, _| {
                ambient * (1.0 - open.as_ref().map_or(0.0, |sums| sums[patch]))
            });
            if let Some(specular) = &self.specular {
                indirect += specular.from_cells.product(&exposed.shown);
            }
            let leaving = self.bounce(&albedo, &direct, &mut indirect, &mut exposed)?;
            exposed.indirect.push(indirect);
            exposed.leaving.push(leaving);
            exposed.ambient.push(ambient);
        }
        Ok(exposed)
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
        let stop = Stop::Share(OF_THRESHOLD * self.threshold);
        let arriving = direct + &*indirect;
        let mut leaving = reflected(&arriving);
        // What mirrors and lobes add is bounced in turn, until little is added.
        let mut fresh = arriving;
        for round in 0..MOST_SPECULAR {
            let sent = match &self.exchange {
                Some(exchange) => {
                    let all = radiosity(exchange, albedo, &fresh, stop)?;
                    exposed.bounces = exposed.bounces.max(all.bounces);
                    exposed.how = Some(all.how);
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
        let shown = exposed.shown.column(pattern);
        (0..self.channels)
            .map(|channel| {
                let indirect = exposed.indirect[channel].column(pattern);
                let leaving = exposed.leaving[channel].column(pattern);
                let ambient = exposed.ambient[channel];
                let pixel = |pixel| {
                    let direct = self.sight.direct[channel].times(pixel, |cell| shown[cell]);
                    let bounced = self.sight.indirect[channel].times(pixel, |at| indirect[at]);
                    let detail = self.sight.detail[channel]
                        // Where a surface is in view, light from elsewhere is not.
                        .times(pixel, |at| leaving[at] - ambient);
                    let lobes = self.sight.lobes.times(pixel, |at| leaving[at]);
                    let elsewhere = ambient * f64::from(self.sight.open[pixel]);
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

    /// Seconds that following the camera's rays took, which no effect is charged for.
    #[must_use]
    pub fn rays_seconds(&self) -> f64 {
        self.rays
    }

    /// What was decided about every effect.
    #[must_use]
    pub fn decisions(&self) -> Vec<Decision> {
        self.decisions.all()
    }

    /// Share of white below which an effect was left out.
    #[must_use]
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// What the simulation consists of.
    #[must_use]
    pub fn work(&self) -> Work {
        Work {
            lit: self.on_patches.entries(),
            exchanged: self.exchange.as_ref().map_or(0, |e| e.report().evaluated),
        }
    }

    /// Whether the projector's blur is simulated.
    #[must_use]
    pub fn blurred(&self) -> bool {
        self.decisions.on(Effect::Blur)
    }

    /// The projector's cells.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.scene.projector.grid
    }

    /// Pieces that surfaces were cut into.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.patches.len()
    }

    /// 1 for grey, 3 for colour.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The camera's sensor, exposed for a flood photograph.
    #[must_use]
    pub fn sensor(&self, flood: &[Vec<f32>]) -> Sensor<'s> {
        let readout = Readout {
            noise: self.decisions.on(Effect::Noise),
            quantisation: self.decisions.on(Effect::Quantisation),
            response: self.decisions.on(Effect::Response),
        };
        Sensor::exposed(&self.scene.camera, readout, flood)
    }
}

/// Light between patches, with what was found on the way.
fn exchange(
    facets: &Facets<'_>,
    patches: &[Patch],
    decisions: &mut Decisions,
    progress: &dyn Progress,
) -> Result<Exchange, ExchangeError> {
    let piece = |patch: &Patch| super::exchange::Patch {
        polygon: patch.polygon.clone(),
        facet: patch.facet,
    };
    let pieces: Vec<_> = patches.iter().map(piece).collect();
    let forced = decisions.forced(Effect::Occlusion);
    let options = ExchangeOptions {
        occlusion: match forced {
            Some(true) => Occlusion::Everywhere,
            Some(false) => Occlusion::Ignore,
            None => Occlusion::Decide,
        },
        ..ExchangeOptions::default()
    };
    let exchange = Exchange::new(&pieces, facets.obstacles(), &options, progress)?;
    let report = exchange.report();
    let reason = match report
        .pairs
        .iter()
        .find_map(|p| Some((p.facets, p.between?)))
    {
        Some(((a, b), between)) => {
            let [a, b, between] = [a, b, between].map(|facet| facets.name(facet));
            let which = if a == b && a == between {
                format!("parts of `{a}` between others of it")
            } else {
                format!("`{between}` between `{a}` and `{b}`")
            };
            format!(
                "between {} of {} pairs of surfaces another may stand, {which}; {} pairs are hidden wholly",
                report.occludable, report.surveyed, report.blocked,
            )
        }
        None => "no surface reaches between two others".to_owned(),
    };
    decisions.decide(Effect::Occlusion, report.occludable > 0, reason);
    let found = format!(
        "{} form factors, {} stored, {} of it as low rank",
        thousands(report.evaluated as usize),
        megabytes(report.bytes),
        match report.low_rank_blocks {
            0 => "none".to_owned(),
            n => format!("{n} blocks"),
        },
    );
    decisions.found(Effect::Interreflection, &found);
    decisions.took(Effect::Interreflection, report.seconds);
    Ok(exchange)
}

/// A count for people.
fn thousands(count: usize) -> String {
    match count {
        0..10_000 => count.to_string(),
        10_000..10_000_000 => format!("{} thousand", count / 1_000),
        _ => format!("{} million", count / 1_000_000),
    }
}

fn megabytes(bytes: usize) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// Light over mirrors and lobes, where the scene calls for it.
fn specular(
    surfaces: Surfaces<'_>,
    exchange: Option<&Exchange>,
    decisions: &mut Decisions,
) -> Result<Option<Specular>, TooGlossy> {
    let (mirrors, gloss) = (decisions.on(Effect::Mirrors), decisions.on(Effect::Gloss));
    if !mirrors && !gloss {
        return Ok(None);
    }
    let clock = Instant::now();
    let specular = Specular::new(surfaces, mirrors, exchange.filter(|_| gloss))?;
    let effect = if mirrors {
        Effect::Mirrors
    } else {
        Effect::Gloss
    };
    decisions.took(effect, clock.elapsed().as_secs_f64());
    Ok(Some(specular))
}
