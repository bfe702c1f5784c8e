//! Gains for an even light: what a viewer sees of a wall with a fold between two paints, by a table
//! whose photographs of patterns were added up to an even light, and by one without.

use iltm::build_table::{TableOptions, build_table_from};
use iltm::capture::{Measurements, Settings};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::{Effect, Forced, VirtualCamera};
use iltm::session::Layout;
use iltm::solve::SolveOptions;
use iltm::verify::{Readings, Slides, judge, write};
use iltm_runtime::FrameSize;
use iltm_runtime::image::Table;
use iltm_tests::simulated::{self, scene, simulation};
use std::path::Path;

/// Error of images of the projector's own pixels on the wall, by a camera without noise: all of it,
/// and the part that all images share.
fn seen(measurements: Measurements, scene: &Scene, layout: &Layout) -> [f64; 2] {
    let settings = Settings {
        camera: measurements.settings.camera.clone(),
        ..Settings::default()
    };
    let learned = build_table_from(
        measurements.into(),
        Path::new("session"),
        &SolveOptions::default(),
        &TableOptions::default(),
        &Silent,
    )
    .unwrap();
    let table = Table::check(&learned.compiled.image).unwrap();
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("verify");
    let slides = (&settings, Slides::Both { fine: true });
    write(&table, layout, slides, &folder, &Silent).unwrap();
    let simulation = simulation(scene, Forced::default().with(Effect::Noise, false));
    let camera = VirtualCamera::new(scene, &simulation, 1).unwrap();
    simulated::take(scene, &folder, &camera);
    let readings = Readings::read(&folder, &table, &Silent).unwrap();
    let verdict = judge(&folder, &table, &readings, None).unwrap();
    let seen = verdict.pixels.unwrap();
    [seen.error[1], seen.fixed.unwrap().error]
}

#[test]
fn a_fold_between_two_paints_has_less_of_a_line_where_patterns_tell_an_even_light() {
    let scene = scene(
        "painted-corner",
        &[
            ("rows = 18\ncols = 24", "rows = 9\ncols = 12"),
            ("width = 240\nheight = 180", "width = 160\nheight = 120"),
            ("bits = 8", "bits = 12"),
        ],
    );
    let size = FrameSize::new(120, 90).unwrap();
    let layout = Layout::new(scene.grid(), size, 0).unwrap();
    let mut measurements = simulated::measured(&scene, &layout, 20, |_| ());
    assert!(measurements.even.is_some());
    let [with, fixed] = seen(measurements.clone(), &scene, &layout);
    measurements.even = None;
    let [without, fixed_without] = seen(measurements, &scene, &layout);
    let words = format!("{without:.4} {fixed_without:.4}, by patterns {with:.4} {fixed:.4}");
    println!("{words}");
    assert!(
        with < 0.9 * without && fixed < 0.8 * fixed_without,
        "{words}"
    );
}
