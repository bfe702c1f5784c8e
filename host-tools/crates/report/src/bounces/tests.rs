//! Bounces against scenes whose bounces are known: `(R F)^k R E p`, cell by cell, and
//! at the camera's resolution against the same scene without interreflection.

use super::*;
use crate::test_scene;
use iltm_capture::{Registration, Role, pattern_set};
use iltm_picture::progress::Silent;
use iltm_runtime::Grid;
use iltm_scene::{
    Effect, Forced, Simulation, SimulationOptions, VirtualCamera,
    coaxial::{CoaxialScene, Panels},
    description::Scene,
    folder as simulated,
};
use nalgebra::DVector;

/// A camera with a pixel a cell.
fn registration(grid: Grid) -> Registration {
    let (rows, cols) = (grid.rows(), grid.cols());
    let cells: Vec<u32> = (0..grid.cells() as u32).collect();
    let centre = |cell: usize| Some([(cell % cols) as f64, (cell / cols) as f64]);
    Registration {
        camera: (cols, rows),
        binning: 1,
        cell_of_pixel: cells.clone(),
        seen_cell: cells,
        centre: (0..grid.cells()).map(centre).collect(),
    }
}

/// A wall of which every pixel is a cell of its own, without interreflection.
pub(super) fn known_wall(rows: u16, cols: u16) -> BounceOperator {
    let grid = Grid::new(rows, cols).unwrap();
    let dark = test_scene::inverse(grid, 1, |_, _| 1.0, |_, _| 0.0);
    BounceOperator::new(&registration(grid), &[vec![1.0; grid.cells()]], &dark)
}

/// Standard normal (Box, Muller 1958).
pub(super) fn normal(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}

/// `T^-1 = E^-1 (R^-1 - F)`, exactly.
fn inverse(scene: &CoaxialScene) -> InverseTransport {
    let gain = |cell: usize, _| (scene.albedo[cell] * scene.irradiance[cell]).recip();
    let operator = |i, j| scene.form_factors[(i, j)] / scene.irradiance[i];
    test_scene::inverse(scene.grid, 1, gain, operator)
}

/// `(R F)^(k-1) R E p` for `k` from 1.
fn bounces_of(scene: &CoaxialScene, pattern: &DVector<f64>, count: usize) -> Vec<DVector<f64>> {
    let lit = scene.irradiance.component_mul(pattern);
    let first = scene.albedo.component_mul(&lit);
    let next = |light: &DVector<f64>| {
        let landed = &scene.form_factors * light;
        Some(scene.albedo.component_mul(&landed))
    };
    std::iter::successors(Some(first), next)
        .take(count)
        .collect()
}

fn plane(light: &DVector<f64>) -> Vec<f32> {
    light.iter().map(|light| *light as f32).collect()
}

fn textured_valleys() -> CoaxialScene {
    let grid = Grid::new(9, 14).unwrap();
    CoaxialScene::new(grid, &Panels::m_shape(grid, 60.0), 0.8)
        .textured(0.3, 0.9, 5)
        .vignetted(0.6)
}

#[test]
fn every_bounce_of_a_known_scene_is_found_with_its_exact_inverse() {
    let scene = textured_valleys();
    let cells = scene.grid.cells();
    let pattern = DVector::from_fn(cells, |cell, _| f64::from(cell % 5 == 0));
    let transport = scene.transport();
    let flood = plane(&(&transport * DVector::from_element(cells, 1.0)));
    let wall = BounceOperator::new(&registration(scene.grid), &[flood], &inverse(&scene));
    let photograph = plane(&(&transport * &pattern));
    let separated = Separated::new(&wall, &[photograph], 1e-5).unwrap();
    let (unseparated, layers) = separated.layers.split_last().unwrap();
    let (rest, bounces) = layers.split_last().unwrap();
    assert!(bounces.len() >= 5, "{}", bounces.len());
    let exact = bounces_of(&scene, &pattern, bounces.len());
    for (k, (found, exact)) in bounces.iter().zip(&exact).enumerate() {
        assert_eq!(found.kind, LayerKind::Bounce(k + 1));
        for (found, exact) in found.planes[0].iter().zip(exact.iter()) {
            // Single precision of light up to 1.
            assert!((f64::from(*found) - exact).abs() < 5e-7, "bounce {}", k + 1);
        }
    }
    assert_eq!(rest.kind, LayerKind::Rest);
    assert!(rest.rms < 1e-5);
    assert_eq!(unseparated.kind, LayerKind::Unseparated);
    assert!(unseparated.planes[0].iter().all(|light| *light == 0.0));
}

#[test]
fn bounces_of_a_known_scene_are_found_from_its_photographs() {
    let scene = textured_valleys();
    let cells = scene.grid.cells();
    let mut patterns = pattern_set(scene.grid, 60, 7);
    patterns.retain(|(role, _)| *role != Role::Black);
    let roles: Vec<Role> = patterns.iter().map(|(role, _)| *role).collect();
    let patterns = DMatrix::from_fn(cells, patterns.len(), |cell, k| {
        f64::from(u8::from(patterns[k].1.lit[cell]))
    });
    let transport = scene.transport();
    let (live, dark) = (vec![true; cells], vec![0.0; cells]);
    let noise = iltm_solve::CellNoise {
        lit: 1e-4,
        unlit: 1e-4,
    };
    let mut light = &transport * &patterns;
    let mut random = fastrand::Rng::with_seed(2);
    light.apply(|light| *light += 1e-4 * normal(&mut random));
    let observed = Observed {
        grid: scene.grid,
        roles: &roles,
        live: &live,
        channels: vec![iltm_solve::ObservedChannel {
            patterns: &patterns,
            light: &light,
            ambient: &dark,
            noise: vec![noise; cells],
        }],
        blur: 0.0,
    };
    let solved = iltm_solve::solve_observed(&observed, &SolveOptions::default(), &Silent);
    let (inverse, _) = solved.unwrap();
    let white = DVector::from_element(cells, 1.0);
    let checkered = DVector::from_fn(cells, |cell, _| f64::from(cell / 14 % 3 == cell % 2));
    let wall = BounceOperator::new(
        &registration(scene.grid),
        &[plane(&(&transport * &white))],
        &inverse,
    );
    for (name, pattern) in [("white", white), ("checkered", checkered)] {
        let photograph = plane(&(&transport * &pattern));
        let separated = Separated::new(&wall, &[photograph], 1e-4).unwrap();
        let exact = bounces_of(&scene, &pattern, 4);
        let error = |k: usize| {
            let found = &separated.layers[k].planes[0];
            let pairs = found.iter().zip(exact[k].iter());
            let off: f64 = pairs.map(|(a, b)| (f64::from(*a) - b).powi(2)).sum();
            off.sqrt() / exact[k].norm()
        };
        let errors = [0, 1, 2, 3].map(error);
        assert!(errors[0] < 0.002, "{name}: {errors:?}");
        assert!(errors[1] < 0.01, "{name}: {errors:?}");
        assert!(errors[3] < 0.01, "{name}: {errors:?}");
    }
}

#[test]
fn layers_add_up_to_the_photograph_even_with_a_wrong_inverse() {
    let scene = textured_valleys();
    let cells = scene.grid.cells();
    let transport = scene.transport();
    let flood = plane(&(&transport * DVector::from_element(cells, 1.0)));
    let mut inverse = inverse(&scene);
    inverse.shared *= 0.5;
    inverse.live[17] = false;
    inverse.channels[0].gain.rotate_left(3);
    let wall = BounceOperator::new(
        &registration(scene.grid),
        std::slice::from_ref(&flood),
        &inverse,
    );
    let separated = Separated::new(&wall, &[flood], 1e-4).unwrap();
    assert!(
        separated.largest_gap() < 1e-6,
        "{}",
        separated.largest_gap()
    );
    let shares: f64 = separated.layers.iter().map(|l| l.light_share).sum();
    assert!((shares - 1.0).abs() < 1e-6, "{shares}");
    // The cell that took no part is in no bounce.
    let (last, others) = separated.layers.split_last().unwrap();
    assert!(last.planes[0][17] > 0.1);
    assert!(others.iter().all(|layer| layer.planes[0][17] == 0.0));
}

#[test]
fn light_that_does_not_fade_is_refused() {
    let scene = textured_valleys();
    let cells = scene.grid.cells();
    let flood = plane(&(scene.transport() * DVector::from_element(cells, 1.0)));
    let mut inverse = inverse(&scene);
    inverse.shared *= 10.0;
    let wall = BounceOperator::new(
        &registration(scene.grid),
        std::slice::from_ref(&flood),
        &inverse,
    );
    let error = Separated::new(&wall, &[flood], 1e-4).unwrap_err();
    assert!(matches!(error, BouncesError::DoesNotFade { .. }), "{error}");
}

/// The M-shaped panels as they come with the tools, and what a camera without noise
/// sees straight from the projector under a pattern, of full scale.
fn direct_light(scene: &Scene, pattern: usize, patterns: &DMatrix<f64>) -> Vec<f32> {
    let quiet = Forced::default()
        .with(Effect::Noise, false)
        .with(Effect::Ambient, false);
    let options = |forced| SimulationOptions {
        forced,
        threshold: None,
    };
    let white = DMatrix::from_element(patterns.nrows(), 1, 1.0);
    let with_all = options(Forced::default());
    let with_all = Simulation::new(scene, &with_all, &Silent).unwrap();
    let flood = with_all.photograph(&with_all.expose(&white).unwrap(), 0);
    let exposure = with_all.sensor(&flood).exposure();
    let direct = options(quiet.with(Effect::Interreflection, false));
    let direct = Simulation::new(scene, &direct, &Silent).unwrap();
    let light = direct.photograph(&direct.expose(patterns).unwrap(), pattern);
    let scaled = light[0]
        .iter()
        .map(|light| (f64::from(*light) * exposure) as f32);
    scaled.collect()
}

#[test]
fn direct_light_is_what_the_camera_sees_without_interreflection() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/m-panels.toml");
    let scene = Scene::read(Path::new(path)).unwrap();
    let simulation = Simulation::new(&scene, &SimulationOptions::default(), &Silent).unwrap();
    let patterns = pattern_set(simulation.grid(), 60, 3);
    let place = tempfile::tempdir().unwrap();
    let capture = place.path().join("capture");
    let camera = VirtualCamera::new(&scene, &simulation, 3).unwrap();
    simulated::write(&camera, None, &patterns, &capture, &Silent).unwrap();
    let light = DMatrix::from_fn(simulation.grid().cells(), patterns.len(), |cell, k| {
        f64::from(u8::from(patterns[k].1.lit[cell]))
    });
    let bernoulli = patterns
        .iter()
        .position(|(role, _)| *role == Role::Bernoulli);
    for index in [0, bernoulli.unwrap()] {
        let options = BouncesOptions {
            photograph: Some(index as u32),
            ..BouncesOptions::default()
        };
        let found = bounces(&capture, &options, &Silent).unwrap();
        let truth = direct_light(&scene, index, &light);
        let separated = &found.separated;
        let outside = &separated.layers.last().unwrap().planes[0];
        let on_wall = |pixel: &usize| outside[*pixel] == 0.0;
        // Half of the pixels: bounces within a cell, which the folds have, are not told
        // from direct light.
        let distance = |plane: &[f32]| {
            let pixels = (0..truth.len()).filter(on_wall);
            let mut all: Vec<f32> = pixels.map(|p| (plane[p] - truth[p]).abs()).collect();
            all.sort_by(f32::total_cmp);
            f64::from(all[all.len() / 2])
        };
        let (before, after) = (
            distance(&separated.photograph[0]),
            distance(&separated.layers[0].planes[0]),
        );
        assert!(before > 0.05, "photograph {index}: {before}");
        assert!(after < 0.1 * before, "photograph {index}: {before} {after}");
        assert!(
            after < 1.5 * found.noise.pixel,
            "photograph {index}: {after}"
        );
    }
}
