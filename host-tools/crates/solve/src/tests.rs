//! Whole solves of a scene whose transport is known.

// Zero is exact, and the same bits are the same bits.
#![allow(clippy::float_cmp)]

use super::test_scene::{Corner, add_noise, patterns};
use super::*;
use iltm_picture::progress::Silent;
use nalgebra::DMatrix;
use strum::VariantArray;

const NO_NOISE: CellNoise = CellNoise {
    lit: 0.0,
    unlit: 0.0,
};

/// The methods that look for gains and a non-negative operator of all channels.
const PHYSICAL: [Method; 2] = [Method::Joint, Method::Links];

/// Owns what an [`Observed`] borrows.
#[derive(Clone)]
struct Capture {
    grid: Grid,
    patterns: DMatrix<f64>,
    roles: Vec<Role>,
    live: Vec<bool>,
    light: Vec<DMatrix<f64>>,
    ambient: Vec<f64>,
    noise: CellNoise,
}

impl Capture {
    fn new(scene: &Corner, (rows, cols): (u16, u16), bernoulli: usize) -> Self {
        let grid = Grid::new(rows, cols).unwrap();
        let patterns = patterns(grid.cells(), bernoulli);
        let mut roles = vec![Role::Bernoulli; bernoulli + 1];
        roles[0] = Role::White;
        Self {
            grid,
            roles,
            live: vec![true; grid.cells()],
            light: vec![scene.photograph(&patterns)],
            ambient: vec![0.0; grid.cells()],
            patterns,
            noise: CellNoise {
                lit: 1e-3,
                unlit: 1e-3,
            },
        }
    }

    fn observed(&self) -> Observed<'_> {
        let channel = |light| ObservedChannel {
            patterns: &self.patterns,
            light,
            ambient: &self.ambient,
            noise: vec![self.noise; self.grid.cells()],
        };
        Observed {
            grid: self.grid,
            roles: &self.roles,
            live: &self.live,
            channels: self.light.iter().map(channel).collect(),
            blur: 0.0,
        }
    }

    fn solve(&self, options: &SolveOptions) -> Result<(InverseTransport, SolveReport), SolveError> {
        solve_observed(&self.observed(), options, &Silent)
    }

    fn solved(&self) -> (InverseTransport, SolveReport) {
        self.solve(&SolveOptions::default()).unwrap()
    }

    fn error(&self) -> SolveError {
        self.solve(&SolveOptions::default()).unwrap_err()
    }
}

fn method(method: Method) -> SolveOptions {
    SolveOptions {
        method: Some(method),
        ..SolveOptions::default()
    }
}

/// Albedo between 0.3 and 0.8, another one in every cell.
fn textured(cell: usize) -> f64 {
    0.55 + 0.25 * (cell as f64 * 2.3).sin()
}

fn corner(rows: u16, cols: u16) -> Corner {
    Corner::new(rows.into(), cols.into(), textured)
}

/// `diag(g) - K` of a channel.
fn inverse(found: &InverseTransport, channel: usize) -> DMatrix<f64> {
    found.channel(channel).dense()
}

fn relative(found: &DMatrix<f64>, wanted: &DMatrix<f64>) -> f64 {
    (found - wanted).norm() / wanted.norm()
}

/// Mean relative error of the light that compensated smooth images make.
fn closed_loop(found: &InverseTransport, scene: &Corner, size: (u16, u16)) -> f64 {
    loop_error(&inverse(found, 0), scene, size)
}

fn loop_error(inverse: &DMatrix<f64>, scene: &Corner, (rows, cols): (u16, u16)) -> f64 {
    let wanted = DMatrix::from_fn(usize::from(rows) * usize::from(cols), 3, |cell, image| {
        let (row, col) = (cell / usize::from(cols), cell % usize::from(cols));
        let phase = (image + 1) as f64
            * (row as f64 / f64::from(rows) + 2.0 * col as f64 / f64::from(cols));
        0.5 + 0.3 * (3.0 * phase).sin()
    });
    relative(&scene.photograph(&(inverse * &wanted)), &wanted)
}

#[test]
fn enough_noiseless_photographs_give_the_exact_inverse() {
    let scene = corner(6, 8);
    let capture = Capture::new(&scene, (6, 8), 100);
    let options = SolveOptions {
        lambda: Some(1e-7),
        tolerance: 1e-7,
        ..SolveOptions::default()
    };
    let (found, report) = capture.solve(&options).unwrap();
    assert!(relative(&found.shared.dense(), &scene.operator) < 2e-4);
    assert!(relative(&inverse(&found, 0), &scene.inverse()) < 2e-5);
    let predicted = report.prediction.compensated;
    assert!(predicted < 1e-3, "{predicted}");
}

#[test]
fn the_papers_method_gives_the_exact_inverse_from_as_many_photographs_as_cells() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 100);
    capture.noise.lit = 0.0;
    let options = SolveOptions {
        tolerance: 1e-9,
        ..method(Method::Direct)
    };
    let (found, _) = capture.solve(&options).unwrap();
    assert!(relative(&inverse(&found, 0), &scene.inverse()) < 1e-6);
}

#[test]
fn fewer_photographs_than_cells_suffice_and_knowing_physics_helps() {
    let scene = corner(12, 16);
    let mut capture = Capture::new(&scene, (12, 16), 60);
    add_noise(&mut capture.light[0], 1e-3);
    let error = |options: &SolveOptions| {
        let (found, report) = capture.solve(options).unwrap();
        assert!(report.convergence.converged);
        closed_loop(&found, &scene, (12, 16))
    };
    let joint = error(&SolveOptions::default());
    let direct = error(&method(Method::Direct));
    let gain_only = {
        let flood = capture.light[0].column(0).map(f64::recip);
        loop_error(&DMatrix::from_diagonal(&flood), &scene, (12, 16))
    };
    assert!(joint < 0.1 * gain_only, "{joint} against {gain_only}");
    assert!(joint < 0.5 * direct, "{joint} against {direct}");
}

#[test]
fn links_from_many_photographs_err_as_little_as_joint() {
    let size = (13, 21);
    let scene = corner(size.0, size.1);
    let mut capture = Capture::new(&scene, size, 200);
    add_noise(&mut capture.light[0], 2e-3);
    let [joint, links] = PHYSICAL.map(|method_name| {
        let (found, report) = capture.solve(&method(method_name)).unwrap();
        assert_eq!(report.method, method_name);
        closed_loop(&found, &scene, size)
    });
    assert!(links < 1.05 * joint, "{links} against {joint}");
}

#[test]
fn channels_get_links_of_their_own_only_where_light_bounces_otherwise_in_them() {
    let size = (12, 16);
    let scene = corner(size.0, size.1);
    let mut capture = Capture::new(&scene, size, 100);
    // The second channel has other texture; in the third no light bounces in the upper half.
    let other = Corner::new(size.0.into(), size.1.into(), |cell| textured(cell + 1));
    let half = {
        let mut inverse = scene.inverse();
        for (row, col) in (0..96).flat_map(|row| (0..192).map(move |col| (row, col))) {
            if row != col {
                inverse[(row, col)] = 0.0;
            }
        }
        inverse
    };
    let transport = half.clone().try_inverse().unwrap();
    let (alike, otherwise) = (
        scene.photograph(&capture.patterns),
        transport * &capture.patterns,
    );
    capture.light.push(other.photograph(&capture.patterns));
    capture.light.push(alike);
    let solved = |capture: &mut Capture| {
        for light in &mut capture.light {
            add_noise(light, 1e-3);
        }
        capture.solve(&method(Method::Links)).unwrap().0
    };
    let found = solved(&mut capture);
    let own = |channel: &ChannelInverse| channel.deviation.is_some();
    assert!(!found.channels.iter().any(own));
    capture.light[2] = otherwise;
    let found = solved(&mut capture);
    assert!(found.channels.iter().all(own));
    let error = relative(&inverse(&found, 2), &half);
    assert!(error < 0.01, "{error}");
}

#[test]
fn links_alone_is_for_many_cells_and_photographs() {
    let default = SolveOptions::default();
    let weighted = SolveOptions {
        lambda: Some(0.01),
        ..default
    };
    for (options, cells, photographs, wanted) in [
        (&default, 2047, 1000, Method::Joint),
        (&default, 2048, 199, Method::Joint),
        (&default, 2048, 200, Method::Links),
        (&default, 6145, 20, Method::Links),
        (&weighted, 6145, 200, Method::Joint),
        (&method(Method::Direct), 6145, 200, Method::Direct),
    ] {
        let chosen = options.method_for(cells, photographs);
        assert_eq!(chosen, wanted, "{cells} {photographs}");
    }
}

#[test]
fn held_out_photographs_choose_between_joint_and_links() {
    let mut chosen = Vec::new();
    for (bernoulli, noise) in [(60, 1e-3), (150, 1e-3), (300, 2e-3), (150, 1e-2)] {
        let scene = Corner::new(12, 16, textured);
        let mut capture = Capture::new(&scene, (12, 16), bernoulli);
        add_noise(&mut capture.light[0], noise);
        let by = |options: &SolveOptions| capture.solve(options).unwrap().1;
        let [joint, links] = PHYSICAL.map(|name| by(&method(name)).prediction.compensated);
        let report = by(&SolveOptions::default());
        println!(
            "{bernoulli} {noise}: joint {joint:.6}, links {links:.6}, {}",
            report.method
        );
        let best = if links < joint {
            Method::Links
        } else {
            Method::Joint
        };
        assert_eq!(report.method, best, "{bernoulli} {noise}");
        assert_eq!(
            report.prediction.compensated.to_bits(),
            joint.min(links).to_bits()
        );
        chosen.push(best);
    }
    // Both are chosen somewhere.
    assert!(
        PHYSICAL.iter().all(|name| chosen.contains(name)),
        "{chosen:?}"
    );
}

#[test]
fn the_operator_is_non_negative_with_a_zero_diagonal_in_every_channel() {
    let mut capture = Capture::new(&corner(6, 8), (6, 8), 40);
    let other = Corner::new(6, 8, |cell| 0.8 - 0.5 * textured(cell));
    capture.light.push(other.photograph(&capture.patterns));
    capture.light.push(capture.light[0].clone() * 0.9);
    for light in &mut capture.light {
        add_noise(light, 1e-2);
    }
    for method_name in PHYSICAL {
        let (found, _) = capture.solve(&method(method_name)).unwrap();
        let shared = found.shared.dense();
        assert!(shared.min() >= 0.0);
        assert!(shared.max() > 0.0);
        assert_eq!(shared.diagonal().amax(), 0.0);
        // Links are of single precision: where a channel takes all of a shared value away, what
        // is left is rounding.
        let nothing = f64::from(f32::EPSILON) * shared.max();
        for channel in 0..3 {
            let inverse = inverse(&found, channel);
            for (index, value) in inverse.iter().enumerate() {
                let diagonal = index % 48 == index / 48;
                assert!(if diagonal {
                    *value > 0.0
                } else {
                    *value <= nothing
                });
            }
        }
    }
}

#[test]
fn a_projectors_gain_in_each_channel_is_found() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 60);
    let light = capture.light[0].clone();
    // Twice the light is the same scene under a projector twice as bright.
    capture.light = [0.5, 1.0, 2.0].map(|gain| &light * gain).to_vec();
    for method_name in PHYSICAL {
        let (found, _) = capture.solve(&method(method_name)).unwrap();
        let scales: Vec<f64> = found.channels.iter().map(|c| c.scale).collect();
        assert!((scales[0] / scales[1] - 2.0).abs() < 0.05, "{scales:?}");
        assert!((scales[1] / scales[2] - 2.0).abs() < 0.05, "{scales:?}");
        for (channel, gain) in [0.5, 1.0, 2.0].into_iter().enumerate() {
            let wanted = scene.inverse() / gain;
            let error = relative(&inverse(&found, channel), &wanted);
            assert!(error < 0.01, "{method_name} {error}");
        }
    }
}

#[test]
fn a_longer_exposure_scales_the_inverse_and_nothing_else() {
    let mut capture = Capture::new(&corner(5, 7), (5, 7), 40);
    add_noise(&mut capture.light[0], 3e-3);
    let mut longer = capture.clone();
    longer.light[0] *= 4.0;
    longer.noise.lit *= 4.0;
    longer.noise.unlit *= 4.0;
    for method_name in PHYSICAL {
        let (once, report) = capture.solve(&method(method_name)).unwrap();
        let (four_times, longer) = longer.solve(&method(method_name)).unwrap();
        assert_eq!(report.lambda, longer.lambda);
        assert!(relative(&(inverse(&four_times, 0) * 4.0), &inverse(&once, 0)) < 1e-6);
    }
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_threads() {
    // Enough for every method, with a fifth held out.
    let mut capture = Capture::new(&corner(9, 11), (9, 11), 160);
    capture.light = vec![capture.light[0].clone(); 3];
    add_noise(&mut capture.light[1], 1e-2);
    capture.noise.unlit = 5e-4;
    for &method_name in Method::VARIANTS {
        let solve = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| capture.solve(&method(method_name)).unwrap().0)
        };
        let one = solve(1);
        for threads in [2, 3, 7] {
            let many = solve(threads);
            for channel in 0..3 {
                assert_eq!(inverse(&one, channel), inverse(&many, channel));
            }
        }
    }
}

#[test]
fn held_out_photographs_predict_the_error_of_new_ones() {
    let scene = corner(8, 10);
    let mut capture = Capture::new(&scene, (8, 10), 200);
    add_noise(&mut capture.light[0], 5e-3);
    // The first 100 to solve from, the rest to compare with.
    let rest = capture.patterns.columns(100, 100).into_owned();
    capture.patterns = capture.patterns.columns(0, 100).into_owned();
    let observed = capture.light[0].columns(100, 100).into_owned();
    capture.light[0] = capture.light[0].columns(0, 100).into_owned();
    capture.roles.truncate(100);
    let (found, report) = capture.solved();
    let predicted = report.prediction;
    let light = inverse(&found, 0).try_inverse().unwrap() * rest;
    let actual = relative(&observed, &light);
    assert!(
        (predicted.compensated / actual - 1.0).abs() < 0.1,
        "{predicted:?} {actual}"
    );
    assert!(predicted.compensated < predicted.gain_only);
    assert!(predicted.gain_only < predicted.uncompensated);
}

#[test]
fn dead_cells_have_no_gain_and_no_part_in_the_operator() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 60);
    // One that the camera never saw, and one that it saw dark.
    capture.live[3] = false;
    capture.light[0].row_mut(20).fill(0.0);
    for &method_name in Method::VARIANTS {
        let (found, report) = capture.solve(&method(method_name)).unwrap();
        assert_eq!(report.live_cells, 46);
        let shared = found.shared.dense();
        for dead in [3, 20] {
            assert!(!found.live[dead]);
            assert_eq!(found.channels[0].gain[dead], 0.0);
            assert_eq!(shared.row(dead).amax(), 0.0);
            assert_eq!(shared.column(dead).amax(), 0.0);
        }
    }
    let (found, _) = capture.solved();
    let gain = found.channels[0].gain[10];
    assert!((gain / scene.gain[10] - 1.0).abs() < 0.02);
}

#[test]
fn patterns_that_repeat_and_contradict_no_one_are_welcome() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 40);
    let inverted = capture.patterns.map(|lit| 1.0 - lit);
    let mut patterns = capture.patterns.clone().resize_horizontally(82, 0.0);
    patterns.columns_mut(41, 41).copy_from(&inverted);
    capture.patterns = patterns;
    capture.light = vec![scene.photograph(&capture.patterns)];
    capture.roles = vec![Role::Bernoulli; 82];
    // As many patterns as say something are not enough for least squares.
    let error = capture.solve(&method(Method::BruteForce)).unwrap_err();
    assert!(matches!(
        error,
        SolveError::Dependent {
            rank: 33,
            cells: 48,
            ..
        }
    ));
    for method_name in [
        Method::Joint,
        Method::Links,
        Method::Direct,
        Method::TwoStage,
    ] {
        let (found, _) = capture.solve(&method(method_name)).unwrap();
        let error = closed_loop(&found, &scene, (6, 8));
        assert!(error < 0.03, "{method_name} {error}");
    }
}

#[test]
fn a_grid_may_be_one_cell_or_one_line() {
    for size in [(1, 1), (1, 5), (5, 1), (1, 40), (33, 1)] {
        let scene = corner(size.0, size.1);
        let capture = Capture::new(&scene, size, 60);
        for &method_name in Method::VARIANTS {
            let (found, _) = capture.solve(&method(method_name)).unwrap();
            let error = relative(&inverse(&found, 0), &scene.inverse());
            assert!(error < 0.02, "{size:?} {method_name}: {error}");
        }
    }
}

#[test]
fn a_flat_scene_has_no_operator() {
    let scene = Corner::new(6, 1, textured);
    let capture = Capture::new(&scene, (6, 1), 40);
    let (links, _) = capture.solve(&method(Method::Links)).unwrap();
    assert!(links.shared.dense().amax() < 1e-5);
    let (found, report) = capture.solved();
    assert!(found.shared.dense().amax() < 1e-5);
    let bounds = (1.0 / 0.8, 1.0 / 0.3);
    assert!(
        found.channels[0]
            .gain
            .iter()
            .all(|g| (bounds.0..bounds.1).contains(g))
    );
    // diag(g) alone: largest over smallest gain.
    let gains = found.channels[0].gain.iter();
    let spread = gains.clone().fold(0.0, |a: f64, g| a.max(*g))
        / gains.fold(f64::INFINITY, |a: f64, g| a.min(*g));
    assert!((report.condition / spread - 1.0).abs() < 0.05);
}

#[test]
fn a_flat_scene_gets_gains_alone_and_they_are_its_own() {
    let scene = Corner::new(6, 1, textured);
    let mut capture = Capture::new(&scene, (6, 1), 40);
    add_noise(&mut capture.light[0], 1e-2);
    let (_, report) = capture.solved();
    assert_eq!(report.compensation, Compensation::GainOnly);
    let found = gain_only(&capture.observed(), &report).unwrap();
    assert!(found.shared.is_none());
    for (found, wanted) in found.channels[0].gain.iter().zip(scene.gain.iter()) {
        // Noise of 1 % in each of 41 photographs.
        assert!((found / wanted - 1.0).abs() < 0.01, "{found} {wanted}");
    }
}

/// White, then pictures: all light of `offset` with the rest of one drawing at random.
fn pictures(scene: &Corner, size: (u16, u16), count: usize, offset: f64) -> Capture {
    let mut capture = Capture::new(scene, size, count);
    for k in 1..=count {
        capture.roles[k] = Role::Image;
    }
    let mut random = super::test_scene::Random(3);
    for lit in capture.patterns.columns_mut(1, count).iter_mut() {
        *lit = offset + (1.0 - offset) * random.uniform();
    }
    capture.light = vec![scene.photograph(&capture.patterns)];
    capture
}

#[test]
fn a_bright_picture_is_not_white() {
    let scene = Corner::new(6, 1, textured);
    let mut capture = pictures(&scene, (6, 1), 40, 0.55);
    add_noise(&mut capture.light[0], 1e-2);
    let (_, report) = capture.solved();
    let found = gain_only(&capture.observed(), &report).unwrap();
    for (found, wanted) in found.channels[0].gain.iter().zip(scene.gain.iter()) {
        // One photograph of white, with noise of 1 %.
        assert!((found / wanted - 1.0).abs() < 0.03, "{found} {wanted}");
    }
}

#[test]
fn pictures_are_all_held_out_in_turn_and_equal_ones_together() {
    let scene = corner(6, 8);
    let mut capture = pictures(&scene, (6, 8), 20, 0.0);
    let (_, report) = capture.solved();
    assert_eq!(report.photographs.held_out, 20);
    let again = capture.patterns.columns(1, 10).into_owned();
    capture.patterns.columns_mut(11, 10).copy_from(&again);
    capture.light = vec![scene.photograph(&capture.patterns)];
    add_noise(&mut capture.light[0], 1e-3);
    let (_, twice) = capture.solved();
    assert_eq!(twice.photographs.held_out, 20);
    // Ten pictures tell less of 48 cells than twenty, and the prediction says so.
    assert!(twice.prediction.compensated > 1.5 * report.prediction.compensated);
}

#[test]
fn a_few_photographs_are_all_held_out_in_turn() {
    let scene = corner(6, 8);
    let capture = Capture::new(&scene, (6, 8), 9);
    let (_, report) = capture.solved();
    assert_eq!(report.photographs.held_out, 9);
    assert_eq!(report.prediction.photographs, 9);
    assert!(report.prediction.compensated < report.prediction.gain_only);
}

#[test]
fn photographs_of_one_pattern_are_held_out_together() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 40);
    // Photographs 1 to 20 again, half of them as complements.
    for k in 21..41 {
        let again = capture.patterns.column(k - 20).into_owned();
        let shown = if k % 2 == 0 {
            again
        } else {
            again.map(|lit| 1.0 - lit)
        };
        capture.patterns.set_column(k, &shown);
    }
    capture.light = vec![scene.photograph(&capture.patterns)];
    let (_, report) = capture.solved();
    // One in five of 20 patterns, two photographs each.
    assert_eq!(report.photographs.held_out, 8);
}

#[test]
fn black_unlit_and_unseen_cells_are_told_apart() {
    let scene = Corner::new(6, 8, |cell| if cell == 30 { 1e-9 } else { textured(cell) });
    let mut capture = Capture::new(&scene, (6, 8), 60);
    // What is shown at cell 11 never gets there.
    let mut landed = capture.patterns.clone();
    landed.row_mut(11).fill(0.0);
    capture.light = vec![scene.photograph(&landed)];
    capture.live[3] = false;
    capture.light[0].row_mut(3).fill(0.0);
    add_noise(&mut capture.light[0], 1e-3);
    let (found, report) = capture.solved();
    let why: Vec<_> = report
        .left_out
        .iter()
        .map(|out| (out.cell, out.why))
        .collect();
    let wanted = [
        (3, WhyLeftOut::Unseen),
        (11, WhyLeftOut::Unlit),
        (30, WhyLeftOut::Black),
    ];
    assert_eq!(why, wanted);
    assert_eq!(found.live.iter().filter(|live| **live).count(), 45);
}

#[test]
fn what_an_unseen_cell_throws_on_others_does_not_disturb_their_inverse() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 100);
    let hidden = [18, 19, 20, 27];
    for cell in hidden {
        capture.live[cell] = false;
        capture.light[0].row_mut(cell).fill(0.0);
    }
    let seen: Vec<usize> = (0..48).filter(|cell| !hidden.contains(cell)).collect();
    // The light between seen cells, bounces over the hidden ones included.
    let forward = scene.inverse().try_inverse().unwrap();
    let between = forward.select_rows(&seen).select_columns(&seen);
    let wanted = between.try_inverse().unwrap();
    for method_name in PHYSICAL {
        let (found, _) = capture.solve(&method(method_name)).unwrap();
        let found = inverse(&found, 0).select_rows(&seen).select_columns(&seen);
        let error = relative(&found, &wanted);
        assert!(error < 5e-3, "{method_name} {error}");
    }
}

#[test]
fn a_blur_is_undone_where_it_is_stated_and_by_another_method_where_not() {
    let grid = Grid::new(6, 8).unwrap();
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 100);
    let blur = blur(grid, 0.5);
    capture.light = vec![scene.photograph(&(&blur * &capture.patterns))];
    let shown = DMatrix::from_fn(48, 3, |cell, image| {
        0.5 + 0.3 * ((image + 1) as f64 * (0.4 * (cell / 8) as f64 + 0.3 * (cell % 8) as f64)).sin()
    });
    let light = |projected: &DMatrix<f64>| scene.photograph(&(&blur * projected));
    let wanted = light(&shown);
    for asked in PHYSICAL {
        let error = |deviation| {
            let observed = Observed {
                blur: deviation,
                ..capture.observed()
            };
            let (found, report) = solve_observed(&observed, &method(asked), &Silent).unwrap();
            let error = relative(&light(&(inverse(&found, 0) * &wanted)), &wanted);
            (error, report.method)
        };
        let (stated, used) = error(0.5);
        assert!(stated < 2e-3 && used == asked, "{stated} {used:?}");
        // It takes from `K` its sign, which is what these methods know.
        let (unstated, used) = error(0.0);
        assert!(
            unstated < 4e-3 && used == Method::TwoStage,
            "{asked}: {unstated} {used:?}"
        );
    }
}

#[test]
fn a_blur_out_of_range_is_refused() {
    let capture = Capture::new(&corner(3, 4), (3, 4), 20);
    for blur in [-0.1, 4.1, f64::NAN, f64::INFINITY] {
        let observed = Observed {
            blur,
            ..capture.observed()
        };
        let error = solve_observed(&observed, &SolveOptions::default(), &Silent).unwrap_err();
        assert!(error.to_string().contains("from 0 to 4 cells"), "{error}");
    }
}

#[test]
fn a_measurement_that_is_not_a_number_is_named() {
    let mut capture = Capture::new(&corner(3, 4), (3, 4), 20);
    capture.light[0][(7, 5)] = f64::NAN;
    let place = SolveError::NotFinite {
        what: "light",
        cell: 7,
        photograph: 5,
        channel: 0,
    };
    assert_eq!(capture.error(), place);
    capture.light[0][(7, 5)] = 0.5;
    capture.patterns[(2, 1)] = f64::INFINITY;
    assert!(matches!(
        capture.error(),
        SolveError::NotFinite {
            what: "pattern",
            cell: 2,
            ..
        }
    ));
}

#[test]
fn too_few_photographs_are_refused_with_the_least_number() {
    let capture = Capture::new(&corner(3, 4), (3, 4), 6);
    let error = capture.error();
    assert_eq!(
        error.to_string().matches("at least 8").count(),
        1,
        "{error}"
    );
    assert!(
        Capture::new(&corner(3, 4), (3, 4), 7)
            .solve(&SolveOptions::default())
            .is_ok()
    );
}

#[test]
fn gray_code_does_not_count_for_the_papers_method() {
    let mut capture = Capture::new(&corner(3, 4), (3, 4), 12);
    for role in &mut capture.roles[1..8] {
        *role = Role::Row {
            bit: 0,
            inverse: false,
        };
    }
    let error = capture.solve(&method(Method::Direct)).unwrap_err();
    assert!(matches!(
        error,
        SolveError::TooFewPhotographs {
            given: 6,
            least: 8,
            ..
        }
    ));
    assert!(capture.solve(&SolveOptions::default()).is_ok());
}

#[test]
fn a_dark_capture_is_refused() {
    let mut capture = Capture::new(&corner(3, 4), (3, 4), 20);
    capture.light[0].fill(0.0);
    assert_eq!(capture.error(), SolveError::NoLiveCells { cells: 12 });
}

#[test]
fn sizes_that_disagree_are_refused() {
    let good = Capture::new(&corner(3, 4), (3, 4), 20);
    let mut capture = good.clone();
    capture.roles.pop();
    assert!(matches!(
        capture.error(),
        SolveError::Size {
            what: "patterns",
            ..
        }
    ));
    let mut capture = good.clone();
    capture.light[0] = capture.light[0].rows(0, 11).into_owned();
    assert!(matches!(
        capture.error(),
        SolveError::Size {
            what: "observations",
            ..
        }
    ));
    let mut capture = good;
    capture.light.push(capture.light[0].clone());
    assert_eq!(capture.error(), SolveError::Channels { given: 2 });
}

#[test]
fn options_that_make_no_sense_are_refused() {
    type Spoil = fn(&mut SolveOptions);
    let capture = Capture::new(&corner(3, 4), (3, 4), 20);
    let wrong: [(&str, Spoil); 4] = [
        ("lambda", |options| options.lambda = Some(f64::NAN)),
        ("lambda", |options| options.lambda = Some(-1.0)),
        ("tolerance", |options| options.tolerance = 0.0),
        ("iterations", |options| options.iterations = 0),
    ];
    for (name, spoil) in wrong {
        let mut options = SolveOptions::default();
        spoil(&mut options);
        let error = capture.solve(&options).unwrap_err();
        assert!(matches!(error, SolveError::Option { option, .. } if option == name));
    }
}

#[test]
fn an_iteration_cut_short_is_no_answer() {
    let capture = Capture::new(&corner(6, 8), (6, 8), 40);
    let options = SolveOptions {
        iterations: 1,
        lambda: Some(0.01),
        ..SolveOptions::default()
    };
    let mut few = capture;
    // Nothing held out, hence nothing to start from.
    few.roles.fill(Role::White);
    let error = few.solve(&options).unwrap_err();
    assert!(
        matches!(error, SolveError::DidNotConverge { iterations: 1, .. }),
        "{error}"
    );
}

#[test]
fn photographs_of_other_patterns_are_not_taken_for_an_inverse() {
    let mut capture = Capture::new(&corner(6, 8), (6, 8), 60);
    // Every photograph is of the pattern before.
    let last = capture.patterns.ncols() - 1;
    for k in (2..=last).rev() {
        let before = capture.patterns.column(k - 1).into_owned();
        capture.patterns.set_column(k, &before);
    }
    let error = capture.error();
    assert!(matches!(
        error,
        SolveError::Unpredictable { .. }
            | SolveError::NoLiveCells { .. }
            | SolveError::NotPhysical { .. }
            | SolveError::DidNotConverge { .. }
    ));
}

#[test]
fn every_method_is_read_back_from_its_name() {
    for &method in Method::VARIANTS {
        assert_eq!(method.to_string().parse(), Ok(method));
    }
    let error = "three-stage".parse::<Method>().unwrap_err().to_string();
    for method in Method::VARIANTS {
        assert!(error.contains(&method.to_string()), "{error}");
    }
}

#[test]
fn least_squares_from_more_patterns_than_cells_is_exact() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 80);
    capture.noise = NO_NOISE;
    let (found, report) = capture.solve(&method(Method::BruteForce)).unwrap();
    let exact = scene.inverse();
    assert!((found.channel(0).dense() - &exact).amax() < 1e-9);
    // Light is followed to 1e-6.
    assert!(report.prediction.compensated < 1e-5);
}

#[test]
fn forward_transport_first_ends_at_the_same_inverse_given_photographs_enough() {
    let scene = corner(6, 8);
    let mut capture = Capture::new(&scene, (6, 8), 80);
    capture.noise = NO_NOISE;
    let options = SolveOptions {
        tolerance: 1e-6,
        iterations: 20_000,
        ..method(Method::TwoStage)
    };
    let (found, report) = capture.solve(&options).unwrap();
    let exact = scene.inverse();
    let error = (found.channel(0).dense() - &exact).norm() / exact.norm();
    assert!(error < 1e-4, "{error}");
    // Gray code is not among what the paper compares from.
    assert_eq!(report.photographs.gray_code, 0);
}
