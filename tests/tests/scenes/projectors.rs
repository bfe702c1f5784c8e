//! Several projectors in one scene, their frames side by side.

use iltm::scene::Forced;
use iltm::scene::description::Scene;
use iltm_tests::simulated::{
    error_on_the_wall, inputs, inputs_of_each_alone, learned, photograph, scene, showable,
    simulation,
};
use nalgebra::DMatrix;

/// Two walls, two projectors, a small camera.
fn two_walls() -> Scene {
    let mut scene = scene("two-walls", &[]);
    scene.camera.size = (160, 100);
    scene
}

#[test]
fn light_of_two_projectors_is_the_sum_of_the_light_of_each_and_ambient_light_is_added_once() {
    let mut scene = two_walls();
    scene.ambient = [0.05; 3];
    let all = simulation(&scene, Forced::default());
    let mut random = fastrand::Rng::with_seed(3);
    let frame = DMatrix::from_fn(all.grid().cells(), 1, |_, _| random.f64());
    let light = |scene: &Scene, frame: &DMatrix<f64>| {
        let simulation = simulation(scene, Forced::default());
        simulation.photograph(&simulation.expose(frame).unwrap(), 0)[0].clone()
    };
    let both = light(&scene, &frame);
    let ambient = light(&scene, &(0.0 * &frame));
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
        let sum = halves[0][pixel] + halves[1][pixel] - ambient[pixel];
        // Bounces are followed until little is left, and how little is by the number of cells.
        assert!((both - sum).abs() < 1e-4, "{pixel}: {both} {sum}");
    }
    // Each reaches the other's wall, by a bounce.
    let lit = |half: &Vec<f32>| half.iter().filter(|light| **light > 0.005).count();
    assert!(halves.iter().all(|half| lit(half) > 160 * 100 * 2 / 3));
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
