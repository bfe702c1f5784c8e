//! Benchmark: every method once, on the same light, with its cost and its errors.

use super::acquisition::{self, Acquisition};
use super::inversion::{self, Inversion, Inverted, KnownTransport};
use super::{Answer, Description, Errors, GroundTruth, Rig, Unfit};
use iltm_picture::{FramePart, progress::Progress};
use std::time::Instant;

/// What one method did.
#[derive(Debug)]
pub struct BenchmarkRow {
    /// Which method.
    pub method: Description,
    /// What came of it, or why nothing did.
    pub result: Result<MethodResult, Unfit>,
}

/// The cost and the quality of an answer.
#[derive(Debug)]
pub struct MethodResult {
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
    truth: &GroundTruth,
    meter: Option<Meter>,
) -> BenchmarkRow {
    let mut rig = rig.clone();
    row(method.description(), truth, meter, || {
        let found = method.acquire(&mut rig)?;
        let inverse = found.inverse(&truth.live).ok_or(Unfit::Singular)?;
        let cells = rig.live_cells().len() as f64;
        Ok(Inverted {
            answer: Answer::Inverse(inverse),
            multiplications: Some(cells * cells),
            photographs: rig.photographs(),
            remark: String::new(),
        })
    })
}

/// Inverts by one method and judges what it finds.
pub fn invert(
    method: &dyn Inversion,
    known: KnownTransport<'_>,
    truth: &GroundTruth,
    meter: Option<Meter>,
) -> BenchmarkRow {
    row(method.description(), truth, meter, || method.invert(known))
}

/// The row of a method whose `work` ends with an answer.
fn row(
    method: Description,
    truth: &GroundTruth,
    meter: Option<Meter>,
    work: impl FnOnce() -> Result<Inverted, Unfit>,
) -> BenchmarkRow {
    let timed = || {
        let start = Instant::now();
        (work(), start.elapsed().as_secs_f64())
    };
    let ((found, seconds), memory) = match meter {
        Some(meter) => {
            let (result, bytes) = meter.measure(timed);
            (result, Some(bytes))
        }
        None => (timed(), None),
    };
    let result = found.map(|found| MethodResult {
        photographs: found.photographs,
        seconds,
        memory,
        multiplications: found.multiplications,
        errors: truth.judge(&found.answer),
        answer: found.answer,
        remark: found.remark,
    });
    BenchmarkRow { method, result }
}

/// Ways to photograph, and ways to invert.
pub type Methods = (Vec<Box<dyn Acquisition>>, Vec<Box<dyn Inversion>>);

/// All ways to photograph (with `photographs` where one likes) and all ways to invert. `parts` are
/// those of several projectors.
#[must_use]
pub fn all(parts: &[FramePart], photographs: usize, seed: u64) -> Methods {
    (acquisition::all(photographs, seed), inversion::all(parts))
}

/// What each of the methods does, in their order.
pub fn every(
    (truth, rig): (&GroundTruth, &Rig),
    (acquisitions, inversions): Methods,
    meter: Option<Meter>,
    progress: &dyn Progress,
) -> (Vec<BenchmarkRow>, Vec<BenchmarkRow>) {
    let total = acquisitions.len() + inversions.len();
    progress.begin("methods, one after the other", total as u64);
    let photographed = acquisitions.iter().map(|method| {
        let row = photograph(method.as_ref(), rig, truth, meter);
        progress.advance(1);
        row
    });
    let photographed = photographed.collect();
    let known = KnownTransport {
        grid: truth.grid,
        live: &truth.live,
        transport: &truth.transport,
        rig,
    };
    let inverted = inversions.iter().map(|method| {
        let row = invert(method.as_ref(), known, truth, meter);
        progress.advance(1);
        row
    });
    let inverted = inverted.collect();
    progress.end();
    (photographed, inverted)
}

/// Reads the program's allocator, which only the program itself can choose.
#[derive(Clone, Copy, Debug)]
pub struct Meter {
    /// Bytes held now.
    pub current: fn() -> usize,
    /// Most bytes held since the last [`Self::reset`].
    pub peak: fn() -> usize,
    /// Starts again from what is held now.
    pub reset: fn(),
}

impl Meter {
    /// Runs `work` and says how many bytes it held at most beyond what was held before.
    pub fn measure<T>(self, work: impl FnOnce() -> T) -> (T, usize) {
        (self.reset)();
        let before = (self.current)();
        let result = work();
        (result, (self.peak)().saturating_sub(before))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;
    use iltm_solve::Method;

    #[test]
    fn without_noise_every_way_that_is_exact_finds_the_inverse() {
        let scene = KnownScene::panels(6, 8);
        let truth = scene.truth();
        let row = photograph(&acquisition::BruteForce, &scene.rig, &truth, None);
        let done = row.result.unwrap();
        assert_eq!(done.photographs, 48);
        assert!(done.errors.inverse.unwrap() < 1e-12);
        let row = invert(&inversion::Exact, scene.known(), &truth, None);
        assert!(row.result.unwrap().errors.inverse.unwrap() < 1e-12);
        for method in [Method::TwoStage, Method::Direct, Method::Joint] {
            let sparse = acquisition::Sparse::new(method, 40, 1);
            let row = photograph(&sparse, &scene.rig, &truth, None);
            let errors = row.result.unwrap().errors;
            let name = row.method.name;
            assert!(errors.compensation < 0.05, "{name}: {errors:?}");
        }
    }
}
