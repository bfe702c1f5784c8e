//! Bounded least squares, frame by frame: as accurate as any input within range can be.

use super::live::LiveTransport;
use super::{Inversion, Inverted, KnownTransport};
use crate::{Answer, Citation, Description, Unfit};
use iltm_solve::wanted_images;
use nalgebra::{DMatrix, DVector};

/// Steps of one frame at most.
const MOST_STEPS: usize = 3000;
/// A frame is done when its KKT residual is below this part of `|T^T d|`.
const TOLERANCE: f64 = 1e-8;
/// Frames that the cost is measured on.
const SAMPLES: usize = 4;

/// The `p` of 0 to 1 with the least `||T p - d||`.
#[derive(Clone, Copy, Debug)]
pub struct Bounded;

impl Inversion for Bounded {
    fn description(&self) -> Description {
        Description {
            name: "bounded least squares".to_owned(),
            source: Citation {
                authors: "Sheng, Yapo, Cutler",
                title: "Global Illumination Compensation for Spatially Augmented Reality",
                venue: "Computer Graphics Forum (Eurographics)",
                year: 2010,
            },
            how: "Minimises ||T p - d|| over inputs of 0 to 1 for every frame, by accelerated \
                projected gradients (Beck, Teboulle 2009; restarted as by O'Donoghue, Candes \
                2015): where the inverse would be clipped, the neighbours make up for it. The \
                ceiling of accuracy.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let frames = BoundedFrames::new(&live, known.live.len());
        let images = wanted_images(known.grid).select_rows(&live.chosen);
        let white = frames.flood.mean();
        let mut steps = 0;
        let mut residual = 0.0_f64;
        for image in images.column_iter().take(SAMPLES) {
            let wanted = image * white;
            let solved = frames.problem.solve(&wanted, &frames.start(&wanted));
            steps += solved.steps;
            residual = residual.max(solved.residual);
        }
        let n = live.len() as f64;
        let mean = steps as f64 / SAMPLES.min(images.ncols()) as f64;
        Ok(Inverted {
            answer: Answer::Frames(Box::new(move |wanted| frames.project(wanted))),
            // One product with T^T for the frame, one with T^T T for a step.
            multiplications: Some((mean + 1.0) * n * n),
            photographs: 0,
            remark: format!("{mean:.0} steps a frame; KKT residual {residual:.0e}"),
        })
    }
}

struct BoundedFrames {
    chosen: Vec<usize>,
    cells: usize,
    flood: DVector<f64>,
    problem: Problem,
}

impl BoundedFrames {
    fn new(live: &LiveTransport, cells: usize) -> Self {
        Self {
            chosen: live.chosen.clone(),
            cells,
            flood: live.transport.column_sum(),
            problem: Problem::new(&live.transport),
        }
    }

    /// Only saves steps: the answer does not depend on it.
    fn start(&self, wanted: &DVector<f64>) -> DVector<f64> {
        wanted.zip_map(&self.flood, |wanted, flood| {
            let input = wanted / flood;
            if input.is_finite() { input } else { 0.0 }
        })
    }

    fn project(&self, wanted: &DVector<f64>) -> DVector<f64> {
        let part = DVector::from_fn(self.chosen.len(), |place, _| wanted[self.chosen[place]]);
        let solved = self.problem.solve(&part, &self.start(&part));
        let mut input = DVector::zeros(self.cells);
        for (cell, value) in self.chosen.iter().zip(solved.input.iter()) {
            input[*cell] = *value;
        }
        input
    }
}

/// `min ||T p - d||` over `0 <= p <= 1`.
struct Problem {
    transport: DMatrix<f64>,
    /// `T^T T`.
    gram: DMatrix<f64>,
    /// At least its largest eigenvalue.
    curvature: f64,
}

struct BoundedInput {
    input: DVector<f64>,
    steps: usize,
    /// Relative to `|T^T d|`.
    residual: f64,
}

impl Problem {
    fn new(transport: &DMatrix<f64>) -> Self {
        let gram = transport.tr_mul(transport);
        let rows = gram.row_iter().map(|row| row.lp_norm(1));
        Self {
            // Gershgorin; nearly reached where elements are not negative.
            curvature: rows.fold(0.0, f64::max),
            transport: transport.clone(),
            gram,
        }
    }

    fn solve(&self, wanted: &DVector<f64>, start: &DVector<f64>) -> BoundedInput {
        let towards = self.transport.tr_mul(wanted);
        let scale = towards.norm();
        let mut input = start.map(|p| p.clamp(0.0, 1.0));
        if self.curvature == 0.0 || scale == 0.0 {
            input.fill(0.0);
            return BoundedInput {
                input,
                steps: 0,
                residual: 0.0,
            };
        }
        let mut ahead = input.clone();
        let mut momentum = 1.0_f64;
        let mut residual = f64::INFINITY;
        for step in 1..=MOST_STEPS {
            let slope = &self.gram * &ahead - &towards;
            let next = (&ahead - slope / self.curvature).map(|p| p.clamp(0.0, 1.0));
            // How far a plain step from `ahead` moves is the KKT residual there.
            residual = (&next - &ahead).norm() * self.curvature / scale;
            if residual <= TOLERANCE {
                return BoundedInput {
                    input: next,
                    steps: step,
                    residual,
                };
            }
            let moved = &next - &input;
            // Momentum that leads uphill is dropped.
            if (&ahead - &next).dot(&moved) > 0.0 {
                momentum = 1.0;
            }
            let faster = f64::midpoint(1.0, (1.0 + 4.0 * momentum * momentum).sqrt());
            ahead = &next + moved * ((momentum - 1.0) / faster);
            momentum = faster;
            input = next;
        }
        BoundedInput {
            input,
            steps: MOST_STEPS,
            residual,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;
    use iltm_solve::inverted;

    /// Least squares with every choice of cells at 0, at 1 and free, the feasible best.
    fn exhaustive(transport: &DMatrix<f64>, wanted: &DVector<f64>) -> DVector<f64> {
        let n = transport.ncols();
        let mut best = DVector::zeros(n);
        let mut least = f64::INFINITY;
        for choice in 0..3_usize.pow(n as u32) {
            let kind = |cell: usize| choice / 3_usize.pow(cell as u32) % 3;
            let fixed = DVector::from_fn(n, |cell, _| if kind(cell) == 1 { 1.0 } else { 0.0 });
            let free: Vec<usize> = (0..n).filter(|cell| kind(*cell) == 2).collect();
            let mut input = fixed.clone();
            if !free.is_empty() {
                let part = transport.select_columns(&free);
                let right = part.tr_mul(&(wanted - transport * &fixed));
                let solved = part.tr_mul(&part).cholesky().unwrap().solve(&right);
                for (cell, value) in free.iter().zip(solved.iter()) {
                    input[*cell] = *value;
                }
            }
            let off = (transport * &input - wanted).norm();
            if input.iter().all(|p| (-1e-12..=1.0 + 1e-12).contains(p)) && off < least {
                least = off;
                best = input;
            }
        }
        best
    }

    #[test]
    fn tiny_frames_are_as_an_exhaustive_search_finds_them() {
        let before = KnownScene::textured(2, 3);
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..20 {
            // Brighter than white here, darker than black there.
            let wanted = DVector::from_fn(6, |_, _| 1.2 * random.f64() - 0.1);
            let drive = before.drive(&Bounded, &wanted);
            let best = exhaustive(&before.transport, &wanted);
            assert!((&drive - &best).norm() < 1e-6, "{drive} {best}");
        }
    }

    #[test]
    fn within_range_it_is_the_inverse() {
        let before = KnownScene::textured(5, 8);
        let input = DVector::from_fn(40, |cell, _| 0.1 + 0.1 * ((cell * 5) % 9) as f64);
        let wanted = &before.transport * &input;
        let exact = inverted(&before.transport, &before.live).unwrap() * &wanted;
        let drive = before.drive(&Bounded, &wanted);
        assert!((drive - &exact).norm() < 1e-6 * exact.norm());
    }

    #[test]
    fn no_clipped_inverse_shows_images_better() {
        let before = KnownScene::textured(8, 12);
        let truth = before.truth();
        let bounded = truth.judge(&before.answer(&Bounded)).compensation;
        let clipped = truth.judge(&Answer::Inverse(truth.inverse.clone()));
        assert!(bounded <= clipped.compensation + 1e-7);
    }
}
