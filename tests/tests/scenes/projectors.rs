//! Several projectors in one scene, their frames side by side.

use iltm::scene::description::Scene;
use iltm::scene::{Forced, ProjectedFrame, VirtualCamera};
use iltm_runtime::FrameSize;
use iltm_tests::simulated::{
    error_on_the_wall, inputs, inputs_of_each_alone, learned, photograph, scene, showable,
    simulation,
};
use nalgebra::DMatrix;
use std::sync::Mutex;

/// Two walls, two projectors, a small camera without noise.
fn two_walls() -> Scene {
    let mut scene = scene("two-walls", &[]);
    scene.camera.size = (160, 100);
    scene
}

/// Light of photographs of frames, in the file's numbers.
fn taken(scene: &Scene, frames: &[ProjectedFrame]) -> Vec<Vec<u16>> {
    let simulation = simulation(scene, Forced::default());
    let camera = VirtualCamera::new(scene, &simulation, 1).unwrap();
    let photographs = Mutex::new(vec![Vec::new(); frames.len()]);
    let places: Vec<_> = (0..frames.len()).collect();
    let keep = |place: usize, photograph: Option<iltm::scene::Photograph>| {
        let photograph = photograph.expect("no fault");
        photographs.lock().unwrap()[place] = photograph.values.concat();
        Ok::<(), iltm::scene::SimulationError>(())
    };
    camera.take(frames, &places, keep).unwrap();
    photographs.into_inner().unwrap()
}

#[test]
fn light_of_two_projectors_is_the_sum_of_the_light_of_each() {
    let scene = two_walls();
    let all = simulation(&scene, Forced::default());
    let mut random = fastrand::Rng::with_seed(3);
    let frame = DMatrix::from_fn(all.grid().cells(), 1, |_, _| random.f64());
    let light = |scene: &Scene, frame: &DMatrix<f64>| {
        let simulation = simulation(scene, Forced::default());
        simulation.photograph(&simulation.expose(frame).unwrap(), 0)[0].clone()
    };
    let both = light(&scene, &frame);
    let columns = scene.columns();
    assert_eq!(columns, [0..16, 16..32]);
    // Each projector as a scene of its own, with its half of the frame.
    let projectors = scene.projectors.iter().zip(&columns);
    let halves: Vec<_> = projectors
        .map(|(projector, columns)| {
            let alone = Scene {
                projectors: vec![projector.clone()],
                ..scene.clone()
            };
            let half = DMatrix::from_fn(12 * 16, 1, |cell, _| {
                frame[(cell / 16 * 32 + columns.start + cell % 16, 0)]
            });
            light(&alone, &half)
        })
        .collect();
    for (pixel, both) in both.iter().enumerate() {
        let sum = halves[0][pixel] + halves[1][pixel];
        // Bounces are followed until little is left, and how little is by the number of cells.
        assert!((both - sum).abs() < 1e-4, "{pixel}: {both} {sum}");
    }
    // Each reaches the other's wall, by a bounce.
    let lit = |half: &Vec<f32>| half.iter().filter(|light| **light > 0.005).count();
    assert!(halves.iter().all(|half| lit(half) > 160 * 100 * 2 / 3));
}

#[test]
fn frames_finer_than_the_cells_are_divided_among_the_projectors() {
    let mut scene = two_walls();
    (scene.camera.full_well, scene.camera.read_noise) = (None, 0.0);
    let cells = FrameSize::of_grid(scene.grid());
    let fine = FrameSize::new(128, 48).unwrap();
    let code = |x: usize, width: usize| [if x < width / 2 { 200 } else { 90 }; 3];
    let frames = [cells, fine].map(|size| ProjectedFrame {
        size,
        codes: (0..size.pixels())
            .map(|at| code(at % size.width(), size.width()))
            .collect(),
        exposure: 1.0,
    });
    let photographs = taken(&scene, &frames);
    let sum = |k: usize| {
        photographs[k]
            .iter()
            .map(|value| f64::from(*value))
            .sum::<f64>()
    };
    assert!(
        (sum(0) / sum(1) - 1.0).abs() < 1e-3,
        "{} {}",
        sum(0),
        sum(1)
    );
    let largest = (photographs[0].iter().zip(&photographs[1])).map(|(a, b)| a.abs_diff(*b));
    // But for the frames' edges, where rays are drawn anew.
    assert!(largest.filter(|difference| *difference > 600).count() < 160 * 100 / 50);
}

#[test]
fn one_solve_cancels_the_light_that_goes_from_one_projectors_wall_to_the_others() {
    let scene = two_walls();
    let place = tempfile::tempdir().unwrap();
    let capture = place.path().join("capture");
    photograph(&scene, 60, 1, &capture);
    let learned = learned(&capture);
    let wanted = showable(&learned.inverse);
    let [together, gains] = inputs(&learned, &wanted);
    let alone = inputs_of_each_alone(&scene, 60, &wanted);
    let [together, alone, gains] = [together, alone, gains]
        .map(|inputs| error_on_the_wall(&scene, &learned, &wanted, &inputs));
    println!("together {together:.4}, each alone {alone:.4}, gains alone {gains:.4}");
    assert!(together < 0.010);
    assert!(alone > 2.0 * together);
}
