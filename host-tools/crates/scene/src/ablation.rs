//! Ablation: what each effect contributes, from photographs with it and without it.

use super::description::Scene;
use super::effects::Effect;
use super::simulation::{Simulation, SimulationError, SimulationOptions};
use iltm_capture::{columns, pattern_set};
use iltm_picture::progress::Progress;
use std::time::Instant;

/// Bernoulli patterns among those that are photographed for a comparison.
const BERNOULLI: usize = 3;
/// Seed of patterns and noise.
const SEED: u64 = 1;

/// An effect turned the other way than was decided.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ablated {
    /// The effect.
    pub effect: Effect,
    /// Whether it was decided on; compared is then a simulation without it, and
    /// otherwise one with it.
    pub on: bool,
    /// Root mean square difference of the photographs, as a share of white.
    pub error: f64,
    /// Largest difference of any pixel, as a share of white.
    pub largest: f64,
    /// Seconds that the whole simulation takes longer with the effect than without
    /// it.
    pub seconds: f64,
}

/// Turns every effect that the scene leaves a choice about, one at a time.
///
/// # Errors
/// [`SimulationError`] of any of the simulations.
pub fn ablate(
    scene: &Scene,
    options: &SimulationOptions,
    progress: &dyn Progress,
) -> Result<Vec<Ablated>, SimulationError> {
    let decided = Photographed::new(scene, options, progress)?;
    let mut ablated = Vec::new();
    let choices = decided.decisions.iter().filter(|d| d.possible);
    for decision in choices {
        let (effect, on) = (decision.effect, decision.on);
        let turned = SimulationOptions {
            forced: options.forced.clone().with(effect, !on),
            // The threshold of the scene as it was decided, not as it is turned.
            threshold: Some(decided.threshold),
        };
        let other = Photographed::new(scene, &turned, progress)?;
        let of_sensor = [Effect::Noise, Effect::Quantisation, Effect::Response];
        let sensor = of_sensor.contains(&effect);
        let (error, largest) = decided.difference(&other, sensor);
        let longer = decided.seconds - other.seconds;
        ablated.push(Ablated {
            effect,
            on,
            error,
            largest,
            seconds: if on { longer } else { -longer },
        });
    }
    Ok(ablated)
}

/// Photographs of one simulation.
struct Photographed {
    decisions: Vec<super::Decision>,
    threshold: f64,
    /// Light by photograph and channel.
    light: Vec<Vec<Vec<f32>>>,
    /// Values of the file by photograph and channel, as shares of full scale.
    values: Vec<Vec<Vec<f32>>>,
    /// Light of white, and its value.
    white: [f64; 2],
    seconds: f64,
}

impl Photographed {
    fn new(
        scene: &Scene,
        options: &SimulationOptions,
        progress: &dyn Progress,
    ) -> Result<Self, SimulationError> {
        let start = Instant::now();
        let simulation = Simulation::new(scene, options, progress)?;
        let patterns = pattern_set(simulation.grid(), BERNOULLI, SEED);
        let exposed = simulation.expose(&columns(&patterns))?;
        let light: Vec<_> = (0..patterns.len())
            .map(|k| simulation.photograph(&exposed, k))
            .collect();
        // White is the first pattern.
        let sensor = simulation.sensor(&light[0]);
        let scale = f32::from(sensor.file_scale());
        let values = light.iter().zip(SEED..).map(|(planes, seed)| {
            let share = |plane: &Vec<f32>| {
                let values = sensor.values(plane, seed);
                values.into_iter().map(|v| f32::from(v) / scale).collect()
            };
            planes.iter().map(share).collect()
        });
        Ok(Self {
            decisions: simulation.decisions(),
            threshold: simulation.threshold(),
            values: values.collect(),
            white: [scene.camera.white / sensor.exposure(), scene.camera.white],
            light,
            seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Root mean square and largest difference as shares of white: of light, or of
    /// what the `sensor` makes of it.
    fn difference(&self, other: &Self, sensor: bool) -> (f64, f64) {
        let (mine, theirs) = if sensor {
            (&self.values, &other.values)
        } else {
            (&self.light, &other.light)
        };
        let (mut sum, mut largest, mut count) = (0.0, 0.0_f64, 0_usize);
        for (mine, theirs) in mine.iter().zip(theirs) {
            // A grey photograph has the same light in every channel.
            for channel in 0..mine.len().max(theirs.len()) {
                let mine = &mine[channel.min(mine.len() - 1)];
                let theirs = &theirs[channel.min(theirs.len() - 1)];
                for (a, b) in mine.iter().zip(theirs) {
                    let difference = f64::from(a - b).abs();
                    sum += difference * difference;
                    largest = largest.max(difference);
                    count += 1;
                }
            }
        }
        let white = self.white[usize::from(sensor)];
        ((sum / count.max(1) as f64).sqrt() / white, largest / white)
    }
}
