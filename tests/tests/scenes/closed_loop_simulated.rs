//! Closed loop: from simulated photographs to a projection that is photographed again: the
//! error on the wall, cells that the surface covers only in part among them.

use iltm::compile::reference_white::uniform_white;
use iltm::scene::description::Scene;
use iltm::scene::{Effect, Forced};
use iltm::solve::natural_images;
use iltm_tests::simulated::{cell_means, error, learned, photograph, scene, simulation};
use nalgebra::DMatrix;

/// Live cells, and mean relative error of the light of live cells with gains alone and
/// compensated, at the best scale of each image.
fn errors(scene: &Scene) -> (usize, f64, f64) {
    let place = tempfile::tempdir().unwrap();
    let capture = place.path().join("capture");
    photograph(scene, 150, 3, &capture);
    let learned = learned(&capture);
    let inverse = &learned.inverse;
    let live = &inverse.live;
    let dense = inverse.channel(0).dense();
    let flood = learned.measurements.channels[0]
        .observations
        .column(0)
        .into_owned();
    // Walls that light each other cannot be much darker than their neighbours.
    let white = uniform_white(inverse).unwrap();
    let wanted = natural_images(inverse.grid).map(|light| white * (0.2 + 0.8 * light));
    let keep = |value: f64, cell: usize| {
        if live[cell] {
            value.clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let compensated = &dense * &wanted;
    let compensated = DMatrix::from_fn(wanted.nrows(), wanted.ncols(), |c, k| {
        keep(compensated[(c, k)], c)
    });
    let alone = DMatrix::from_fn(wanted.nrows(), wanted.ncols(), |c, k| {
        keep(wanted[(c, k)] / flood[c], c)
    });
    // Photographed without noise: the error is the table's alone.
    let quiet = Forced::default()
        .with(Effect::Noise, false)
        .with(Effect::Ambient, false);
    let simulation = simulation(scene, quiet);
    let error_of = |projected: &DMatrix<f64>| {
        let exposed = simulation.expose(projected).unwrap();
        let errors = wanted.column_iter().enumerate().map(|(k, wanted)| {
            let plane = &simulation.photograph(&exposed, k)[0];
            let seen = cell_means(&learned.measurements.registration, plane, live.len());
            error(&seen, wanted, live)
        });
        errors.sum::<f64>() / projected.ncols() as f64
    };
    let (alone, compensated) = (error_of(&alone), error_of(&compensated));
    let live = live.iter().filter(|live| **live).count();
    (live, alone, compensated)
}

#[test]
fn cells_that_the_surface_covers_in_part_are_compensated_like_the_others() {
    // Within the panels; and larger than them on all sides.
    for field_of_view in ["23.0", "27.5"] {
        let (live, alone, compensated) = errors(&scene(
            "m-panels",
            &[
                (
                    "field_of_view = 23.0",
                    &format!("field_of_view = {field_of_view}"),
                ),
                ("field_of_view = 27.0", "field_of_view = 31.0"),
            ],
        ));
        println!(
            "{field_of_view} degrees: {live} live cells, gains alone {alone:.4}, compensated {compensated:.4}"
        );
        // A cell has a noise of about a thousandth of white, and the solver alone reaches
        // .0015 at three times that.
        assert!(compensated < 0.003, "{field_of_view}: {compensated}");
        assert!(
            compensated < 0.1 * alone,
            "{field_of_view}: {compensated}, {alone}"
        );
    }
}
