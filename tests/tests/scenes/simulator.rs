//! Simulator as its users meet it: effects that it leaves out do not show, flat scenes
//! cost nothing, and what it photographs can be solved.

use iltm::capture::pattern_set;
use iltm::progress::Silent;
use iltm::scene::ablation::ablate;
use iltm::scene::description::Scene;
use iltm::scene::{
    Effect, Forced, Photograph, ProjectedFrame, SimulationError, SimulationOptions, VirtualCamera,
    folder,
};
use iltm_runtime::FrameSize;
use iltm_tests::simulated::{learned, scene, simulation};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::Mutex;
use strum::IntoEnumIterator;

/// Panels in random places whose light, blur, colour and so on are drawn over several
/// powers of ten, so that many are too weak to be simulated.
fn random_scene(seed: u64) -> Scene {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut weak = |largest: f64| largest * 10_f64.powf(-5.0 * random.f64());
    let (black, vignetting, blur, ambient) = (weak(0.05), weak(0.5), weak(1.0), weak(0.05));
    let (tint, gloss, mirror) = (weak(0.2), weak(0.2), weak(0.2));
    let mut random = fastrand::Rng::with_seed(seed + 1000);
    let mut text = format!(
        "ambient = {ambient}
        [projector]
        position = [0, 0, 4]
        look_at = [0, 0, 0]
        field_of_view = 30
        rows = 5
        cols = 6
        black = {black}
        vignetting = {vignetting}
        blur = {blur}
        [camera]
        position = [0.4, 0.3, 4]
        look_at = [0, 0, 0]
        field_of_view = 34
        width = 48
        height = 40
        full_well = 20000
        "
    );
    for panel in 0..2 + random.usize(..3) {
        // A square of random size, turned and tilted at random.
        let mut number = |low: f64, high: f64| low + (high - low) * random.f64();
        let (x, y, z) = (number(-0.9, 0.9), number(-0.7, 0.7), number(-0.6, 0.3));
        let (turn, tilt, side) = (number(-1.2, 1.2), number(-0.6, 0.6), number(0.2, 0.8));
        let right = [turn.cos(), 0.0, turn.sin()];
        let up = [
            turn.sin() * tilt.sin(),
            tilt.cos(),
            -turn.cos() * tilt.sin(),
        ];
        let corner = |u: f64, v: f64| {
            let at = |k: usize, from: f64| from + side * (u * right[k] + v * up[k]);
            format!("[{}, {}, {}]", at(0, x), at(1, y), at(2, z))
        };
        let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        let corners = corners.map(|(u, v)| corner(u, v)).join(", ");
        let albedo = number(0.02, 0.6);
        let _ = write!(
            text,
            "\n[[panel]]\ncorners = [{corners}]\nalbedo = [{albedo}, {albedo}, {}]\n",
            albedo + tint
        );
        match panel {
            0 => writeln!(text, "gloss = {{ reflectance = {gloss}, exponent = 8 }}"),
            1 => writeln!(text, "mirror = {mirror}"),
            _ => Ok(()),
        }
        .unwrap();
    }
    Scene::parse(text.as_bytes(), Path::new("random.toml")).unwrap()
}

#[test]
fn an_effect_that_was_left_out_would_have_changed_less_than_the_threshold() {
    let (mut left_out, mut worst) = (0, 0.0_f64);
    for seed in 0..24 {
        let scene = random_scene(seed);
        let options = SimulationOptions::default();
        let simulation = simulation(&scene, Forced::default());
        let threshold = simulation.threshold();
        for ablated in ablate(&scene, &options, &Silent).unwrap() {
            if !ablated.on {
                left_out += 1;
                worst = worst.max(ablated.error / threshold);
                assert!(
                    ablated.error < threshold,
                    "seed {seed}: {ablated:?}, {threshold}"
                );
            }
        }
    }
    println!(
        "{left_out} effects left out; the worst would have changed {worst:.2} of the threshold"
    );
    // The scenes are drawn such that about half of the effects are too weak.
    assert!(left_out > 50, "{left_out}");
}

#[test]
fn an_effect_that_is_on_shows() {
    // Of half as many cells across and down, which exchange light in a tenth of the time.
    for (name, cells) in [
        (
            "m-panels",
            [("rows = 13", "rows = 7"), ("cols = 21", "cols = 11")],
        ),
        (
            "painted-corner",
            [("rows = 18", "rows = 9"), ("cols = 24", "cols = 12")],
        ),
    ] {
        let scene = scene(name, &cells);
        let ablated = ablate(&scene, &SimulationOptions::default(), &Silent).unwrap();
        for effect in [
            Effect::Interreflection,
            Effect::Detail,
            Effect::Ambient,
            Effect::Noise,
        ] {
            let found = ablated.iter().find(|a| a.effect == effect).unwrap();
            assert!(found.on && found.error > 1e-4, "{found:?}");
        }
    }
}

#[test]
fn a_flat_scene_costs_as_little_as_a_diagonal() {
    let scene = scene("flat-screen", &[]);
    let simulation = simulation(&scene, Forced::default());
    // One patch a cell, one entry a patch, no form factor, no bounce.
    assert_eq!(simulation.patches(), simulation.grid().cells());
    assert_eq!(simulation.work().lit, simulation.grid().cells());
    assert_eq!(simulation.work().exchanged, 0);
    for effect in Effect::iter() {
        let on = simulation
            .decisions()
            .iter()
            .any(|d| d.effect == effect && d.on);
        assert_eq!(
            on,
            matches!(effect, Effect::Noise | Effect::Quantisation),
            "{effect}"
        );
    }
}

#[test]
fn a_simulated_capture_is_solved_as_well_as_a_photographed_one() {
    let scene = scene("m-panels", &[]);
    let simulation = simulation(&scene, Forced::default());
    let place = tempfile::tempdir().unwrap();
    let capture = place.path().join("capture");
    let patterns = pattern_set(simulation.grid(), 60, 1);
    let camera = VirtualCamera::new(&scene, &simulation, 1).unwrap();
    let written = folder::write(&camera, None, &patterns, &capture, &Silent).unwrap();
    assert_eq!(written.photographs, patterns.len());
    let learned = learned(&capture);
    let prediction = learned.report.prediction;
    // The sample that the path tracer photographed is predicted at .03, with noise six
    // times as large.
    assert!(prediction.compensated < 0.02, "{prediction:?}");
    assert!(
        prediction.compensated < 0.25 * prediction.gain_only,
        "{prediction:?}"
    );
    assert!(
        learned.report.live_cells > 250,
        "{}",
        learned.report.live_cells
    );
    // The same seed gives the same bytes.
    let again = place.path().join("again");
    folder::write(&camera, None, &patterns, &again, &Silent).unwrap();
    for name in ["photos/000.png", "photos/050.png", "capture.csv"] {
        let read = |folder: &Path| std::fs::read(folder.join(name)).unwrap();
        assert_eq!(read(&capture), read(&again), "{name}");
    }
}

#[test]
fn effects_that_are_asked_for_are_simulated_and_said_to_be() {
    let scene = scene("m-panels", &[]);
    let forced = Forced::default()
        .with(Effect::Interreflection, false)
        .with(Effect::Noise, false);
    let simulation = simulation(&scene, forced);
    for effect in [Effect::Interreflection, Effect::Noise] {
        let decision = simulation
            .decisions()
            .into_iter()
            .find(|d| d.effect == effect)
            .unwrap();
        assert!(!decision.on && decision.forced, "{decision:?}");
    }
    assert_eq!(simulation.work().exchanged, 0);
}

/// Frames finer than the cells go another way than cells do; where each cell is even, both are one
/// picture, through a blur of .4 cells and with vignetting.
#[test]
fn a_slide_of_even_cells_is_photographed_as_the_cells_are() {
    for name in ["dome", "installation", "two-walls"] {
        let scene = scene(name, &[]);
        let still = [Effect::Noise, Effect::Quantisation, Effect::Drift];
        let forced = still.into_iter().fold(Forced::default(), |forced, effect| {
            forced.with(effect, false)
        });
        let simulation = simulation(&scene, forced);
        let grid = simulation.grid();
        let code = |cell: usize| [[255, 40, 0], [90, 255, 255], [0, 0, 0]][cell % 3];
        let frame = |side: usize| {
            let (width, height) = (side * grid.cols(), side * grid.rows());
            let cell = |at: usize| at / width / side * grid.cols() + at % width / side;
            ProjectedFrame {
                size: FrameSize::new(width as u16, height as u16).unwrap(),
                codes: (0..width * height).map(|at| code(cell(at))).collect(),
                exposure: 1.0,
            }
        };
        let camera = VirtualCamera::new(&scene, &simulation, 1).unwrap();
        let taken = Mutex::new(BTreeMap::new());
        let keep = |place, photograph: Option<Photograph>| {
            taken.lock().unwrap().insert(place, photograph.unwrap());
            Ok::<(), SimulationError>(())
        };
        let frames = [frame(1), frame(24)];
        camera.take(&frames, &[0, 1], keep).unwrap();
        let taken = taken.into_inner().unwrap();
        let values = |place: usize| {
            let planes = taken[&place].values.iter().flatten();
            planes.map(|value| f64::from(*value))
        };
        let off = values(0).zip(values(1)).map(|(a, b)| (a - b).powi(2));
        let off = (off.sum::<f64>() / values(0).map(|v| v * v).sum::<f64>()).sqrt();
        println!("{name}: {off:.5}");
        assert!(off < 0.005, "{name}: {off}");
    }
}
