//! Simulation of a scene, ready to be photographed: every effect decided, everything that does not
//! depend on the pattern computed once.

use super::camera_sampling::{CameraSampling, SamplingOptions};
use super::decide;
use super::description::{Projector, Scene};
use super::effects::{Decision, Decisions, Effect, Forced};
use super::facets::Facets;
use super::interreflection;
use super::near_field::NearField;
use super::patches::{Patch, Patches};
use super::projector_light::{Beam, ProjectorLight};
use super::radiosity::{FormFactorError, FormFactorMatrix, RadiosityError};
use super::sensor::{Readout, Sensor};
use super::sparse::SparseRows;
use super::specular::{Specular, Surfaces, TooGlossy};
use iltm_picture::{numbers::percent, progress::Progress};
use iltm_runtime::Grid;
use nalgebra::DMatrix;
use std::iter;
use std::slice;
use std::time::Instant;
use thiserror::Error;

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
    FormFactorMatrix(#[from] FormFactorError),
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
            Self::FormFactorMatrix(_) | Self::TooGlossy(_) => "Use fewer cells or a coarser mesh.",
        }
    }
}

/// A scene that photographs can be taken of.
#[derive(Clone, Debug)]
pub struct Simulation<'s> {
    pub(super) scene: &'s Scene,
    /// Of the projector that lights it.
    pub(super) index: usize,
    pub(super) channels: usize,
    pub(super) decisions: Decisions,
    pub(super) threshold: f64,
    pub(super) patches: Vec<Patch>,
    /// Irradiance of patches by cells.
    pub(super) on_patches: SparseRows,
    pub(super) exchange: Option<FormFactorMatrix>,
    pub(super) specular: Option<Specular>,
    pub(super) sight: CameraSampling,
    /// In the light of each further projector; light adds up.
    pub(super) beside: Vec<Self>,
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

impl<'s> Simulation<'s> {
    /// Decides about every effect and computes what patterns do not change.
    ///
    /// # Errors
    /// [`SimulationError`] if a projector lights nothing, or surfaces keep too much light.
    pub fn new(
        scene: &'s Scene,
        options: &SimulationOptions,
        progress: &dyn Progress,
    ) -> Result<Self, SimulationError> {
        let of = |index| Self::of_projector(scene, index, options, progress);
        let mut first = of(0)?;
        let others = 1..scene.projectors.len();
        first.beside = others.map(of).collect::<Result<_, _>>()?;
        Ok(first)
    }

    /// In the light of one projector.
    fn of_projector(
        scene: &'s Scene,
        index: usize,
        options: &SimulationOptions,
        progress: &dyn Progress,
    ) -> Result<Self, SimulationError> {
        let threshold = options
            .threshold
            .unwrap_or_else(|| decide::threshold(scene));
        let mut decisions = Decisions::new(options.forced.clone());
        let facets = Facets::new(scene, index);
        decide::named(&facets, threshold, &mut decisions);
        let channels = if decisions.on(Effect::Colour) { 3 } else { 1 };
        let beam = Beam {
            vignetting: decisions.on(Effect::Vignetting),
            blur: decisions.on(Effect::Blur),
            shadows: decide::shadows(&facets, &mut decisions),
        };
        let clock = Instant::now();
        let (bounces, extent) = decide::between_surfaces(&facets, threshold, &mut decisions);
        decisions.took(Effect::Interreflection, clock.elapsed().as_secs_f64());
        let patches = Patches::new(&facets, extent);
        let light = ProjectorLight::new(&facets, beam);
        let clock = Instant::now();
        let on_patches = light.on_patches(patches.all());
        if on_patches.entries() == 0 {
            return Err(SimulationError::NothingLit);
        }
        if beam.shadows {
            decisions.took(Effect::Shadows, clock.elapsed().as_secs_f64());
        }
        let exchange = if bounces {
            let all = patches.all();
            let found = interreflection::exchange(&facets, all, &mut decisions, progress);
            Some(found?)
        } else {
            decisions.rule_out(Effect::Occlusion, "no light goes between surfaces");
            None
        };
        let mut simulation = Self {
            scene,
            index,
            channels,
            threshold,
            decisions,
            patches: patches.all().to_vec(),
            on_patches,
            exchange,
            specular: None,
            sight: CameraSampling::default(),
            beside: Vec::new(),
            rays: 0.0,
        };
        let surfaces = Surfaces {
            facets: &facets,
            patches: &patches,
            light: &light,
            on_patches: &simulation.on_patches,
        };
        let lobes = simulation.exchange.as_ref();
        simulation.specular =
            interreflection::specular(surfaces, lobes, &mut simulation.decisions)?;
        let near = simulation.detail(&facets)?;
        let clock = Instant::now();
        progress.begin("following the camera's rays", 0);
        let sampling = SamplingOptions {
            channels,
            gloss: simulation.decisions.on(Effect::Gloss),
            mirrors: simulation.decisions.on(Effect::Mirrors),
            distortion: simulation.decisions.on(Effect::Distortion),
        };
        simulation.sight = CameraSampling::new(&facets, &patches, &light, near.as_ref(), sampling);
        progress.end();
        simulation.rays = clock.elapsed().as_secs_f64();
        Ok(simulation)
    }

    /// Decides whether bounced light differs within patches so much that it shows.
    fn detail(&mut self, facets: &Facets<'_>) -> Result<Option<NearField>, SimulationError> {
        let Some(exchange) = &self.exchange else {
            self.decisions
                .rule_out(Effect::Detail, "no light is bounced");
            return Ok(None);
        };
        let clock = Instant::now();
        let hidden = exchange.report().occludable > 0 && self.decisions.on(Effect::Occlusion);
        let obstacles = hidden.then_some(facets.obstacles());
        let (width, height) = self.scene.camera.size;
        let near = NearField::new(&self.patches, obstacles, (width * height) as usize);
        let white = DMatrix::from_element(self.projector().grid.cells(), 1, 1.0);
        let flood = self.expose_one(slice::from_ref(&white), &[1.0])?;
        let level = self.level();
        let largest = flood
            .leaving
            .iter()
            .map(|leaving| near.largest(&self.patches, leaving.as_slice()))
            .fold(0.0, f64::max)
            / level;
        let reason = format!(
            "bounced light differs within a patch by up to {} of white, from {} neighbours",
            percent(largest),
            near.pairs()
        );
        let (decisions, shows) = (&mut self.decisions, largest >= self.threshold);
        let on = decisions.decide(Effect::Detail, shows, reason);
        decisions.took(Effect::Detail, clock.elapsed().as_secs_f64());
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

    /// Seconds that following the camera's rays took, which no effect is charged for.
    #[must_use]
    pub fn rays_seconds(&self) -> f64 {
        self.rays + self.beside.iter().map(Self::rays_seconds).sum::<f64>()
    }

    /// What was decided about every effect: that it is on if it is for any projector.
    #[must_use]
    pub fn decisions(&self) -> Vec<Decision> {
        let mut decisions = self.decisions.all();
        for other in self.beside.iter().flat_map(|one| one.decisions.all()) {
            for decision in decisions.iter_mut().filter(|d| d.effect == other.effect) {
                let seconds = decision.seconds + other.seconds;
                if other.on && !decision.on {
                    *decision = other.clone();
                }
                decision.seconds = seconds;
            }
        }
        decisions
    }

    /// Share of white below which an effect was left out.
    #[must_use]
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// What the simulation consists of.
    #[must_use]
    pub fn work(&self) -> Work {
        let mut work = Work {
            lit: self.on_patches.entries(),
            exchanged: self.exchange.as_ref().map_or(0, |e| e.report().evaluated),
        };
        for of_other in self.beside.iter().map(Self::work) {
            work.lit += of_other.lit;
            work.exchanged += of_other.exchanged;
        }
        work
    }

    /// Light of each projector's lamp at a moment of a session, 0 to 1 from its first
    /// photograph to its last, relative to the first.
    #[must_use]
    pub fn lamps(&self, moment: f64) -> Vec<f64> {
        let all = iter::once(self).chain(&self.beside);
        all.map(|one| one.lamp(moment)).collect()
    }

    fn lamp(&self, moment: f64) -> f64 {
        /// Time constants in a session: a lamp settles in some ten minutes.
        const SETTLING: f64 = 3.0;
        if !self.decisions.on(Effect::Drift) {
            return 1.0;
        }
        let settled = |moment: f64| 1.0 - (-SETTLING * moment).exp();
        1.0 - self.projector().drift * settled(moment) / settled(1.0)
    }

    /// Whether the first projector's blur is simulated.
    #[must_use]
    pub fn blurred(&self) -> bool {
        self.decisions.on(Effect::Blur)
    }

    /// The projector that lights it.
    pub(super) fn projector(&self) -> &'s Projector {
        &self.scene.projectors[self.index]
    }

    /// Cells of the projector, or of all side by side.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.scene.grid()
    }

    /// Pieces that surfaces were cut into.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.patches.len() + self.beside.iter().map(Self::patches).sum::<usize>()
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
