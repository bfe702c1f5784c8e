//! Every method once, on the same light.

use super::acquisition::{self, Acquisition};
use super::inversion::{self, Inversion, Known};
use super::{Answer, Errors, Found, Meter, Rig, Source, Truth, Unfit};
use iltm_picture::progress::{Progress, Silent};
use iltm_solve::inverted;
use std::time::Instant;

/// What one method did.
#[derive(Debug)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Where it comes from.
    pub source: Source,
    /// What it does.
    pub how: &'static str,
    /// What came of it, or why nothing did.
    pub result: Result<Done, Unfit>,
}

/// The cost and the quality of an answer.
#[derive(Debug)]
pub struct Done {
    /// Photographs taken: in all for a way to photograph, a frame for a way to invert.
    pub photographs: usize,
    /// Wall-clock seconds from photographs to answer.
    pub seconds: f64,
    /// Most bytes held meanwhile; `None` without a [`Meter`].
    pub memory: Option<usize>,
    /// Multiplications a frame; `None` where photographs do the work.
    pub multiplications: Option<f64>,
    /// How far it is off.
    pub errors: Errors,
    /// The answer.
    pub answer: Answer,
    /// A remark with a number; may be empty.
    pub remark: String,
}

/// Photographs by one method and judges what it finds; transport is inverted exactly.
pub fn photograph(
    method: &dyn Acquisition,
    rig: &Rig,
    truth: &Truth,
    meter: Option<Meter>,
    progress: &dyn Progress,
) -> Row {
    let mut rig = rig.clone();
    let mut seconds = 0.0;
    let work = || {
        let start = Instant::now();
        let found = method.acquire(&mut rig, progress)?;
        let inverse = match found {
            Found::Inverse(inverse) => inverse,
            Found::Forward(transport) => {
                inverted(&transport, &truth.live).ok_or(Unfit::Singular)?
            }
        };
        seconds = start.elapsed().as_secs_f64();
        Ok(Answer::Inverse(inverse))
    };
    let (answer, memory) = measured(meter, work);
    let cells = rig.live_cells().len() as f64;
    Row {
        name: method.name(),
        source: method.source(),
        how: method.how(),
        result: answer.map(|answer| Done {
            photographs: rig.photographs(),
            seconds,
            memory,
            multiplications: Some(cells * cells),
            errors: truth.judge(&answer),
            answer,
            remark: String::new(),
        }),
    }
}

/// Inverts by one method and judges what it finds.
pub fn invert(
    method: &dyn Inversion,
    known: Known<'_>,
    truth: &Truth,
    meter: Option<Meter>,
    progress: &dyn Progress,
) -> Row {
    let mut seconds = 0.0;
    let work = || {
        let start = Instant::now();
        let inverted = method.invert(known, progress);
        seconds = start.elapsed().as_secs_f64();
        inverted
    };
    let (inverted, memory) = measured(meter, work);
    Row {
        name: method.name(),
        source: method.source(),
        how: method.how(),
        result: inverted.map(|inverted| Done {
            photographs: inverted.photographs,
            seconds,
            memory,
            multiplications: inverted.multiplications,
            errors: truth.judge(&inverted.answer),
            answer: inverted.answer,
            remark: inverted.remark,
        }),
    }
}

/// All ways to photograph (with `photographs` where one likes) and all ways to invert,
/// in that order.
pub fn every(
    (truth, rig): (&Truth, &Rig),
    photographs: usize,
    seed: u64,
    meter: Option<Meter>,
    progress: &dyn Progress,
) -> (Vec<Row>, Vec<Row>) {
    let (acquisitions, inversions) = (acquisition::all(photographs, seed), inversion::all());
    let total = acquisitions.len() + inversions.len();
    progress.begin("methods, one after the other", total as u64);
    let photographed = acquisitions.iter().map(|method| {
        let row = photograph(method.as_ref(), rig, truth, meter, &Silent);
        progress.advance(1);
        row
    });
    let photographed = photographed.collect();
    let known = Known {
        grid: truth.grid,
        live: &truth.live,
        transport: &truth.transport,
        rig,
    };
    let inverted = inversions.iter().map(|method| {
        let row = invert(method.as_ref(), known, truth, meter, &Silent);
        progress.advance(1);
        row
    });
    let inverted = inverted.collect();
    progress.end();
    (photographed, inverted)
}

fn measured<T>(meter: Option<Meter>, work: impl FnOnce() -> T) -> (T, Option<usize>) {
    match meter {
        Some(meter) => {
            let (result, bytes) = meter.measure(work);
            (result, Some(bytes))
        }
        None => (work(), None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_capture::NoiseModel;
    use iltm_runtime::Grid;
    use iltm_scene::coaxial::{Panels, Scene};
    use iltm_solve::Method;

    #[test]
    fn without_noise_every_way_that_is_exact_finds_the_inverse() {
        let grid = Grid::new(6, 8).unwrap();
        let scene = Scene::new(grid, &Panels::m_shape(grid, 75.0), 0.7);
        let live = scene.covered();
        let truth = Truth::new(grid, scene.transport(), live.clone()).unwrap();
        let rig = Rig::new(grid, scene.transport(), live, NoiseModel::default(), 1);
        let row = photograph(&acquisition::BruteForce, &rig, &truth, None, &Silent);
        let done = row.result.unwrap();
        assert_eq!(done.photographs, 48);
        assert!(done.errors.inverse.unwrap() < 1e-12);
        let known = Known {
            grid,
            live: &truth.live,
            transport: &truth.transport,
            rig: &rig,
        };
        let row = invert(&inversion::Exact, known, &truth, None, &Silent);
        assert!(row.result.unwrap().errors.inverse.unwrap() < 1e-12);
        for method in [Method::TwoStage, Method::Direct, Method::Joint] {
            let sparse = acquisition::Sparse::new(method, 40, 1);
            let row = photograph(&sparse, &rig, &truth, None, &Silent);
            let errors = row.result.unwrap().errors;
            assert!(errors.compensation < 0.05, "{}: {errors:?}", row.name);
        }
    }
}
