//! Verification: verdicts of `iltm verify` against the truth: the same pictures projected
//! onto the simulated scene and measured without a camera's noise, in the cells that the
//! table was learned in.

use iltm::build_table::BuiltTable;
use iltm::capture::Settings;
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::{CaptureFault, Effect, Forced, VirtualCamera};
use iltm::session::Layout;
use iltm::verify::{
    Cause, Outcome, Readings, Slides, TableVerdict, VerifyError, WhiteChange, judge, write,
};
use iltm_runtime::FrameSize;
use iltm_runtime::image::Table;
use iltm_tests::simulated::{self, cell_means, error, photograph, simulation};
use iltm_tests::verdicts::VerdictRig;
use nalgebra::DMatrix;
use std::path::Path;

/// The M-shaped panels as they come with the tools, with some words replaced.
fn scene(replaced: &[(&str, &str)]) -> Scene {
    simulated::scene("m-panels", replaced)
}

/// How white differs from what the table expects.
fn white_of(verdict: &TableVerdict) -> &WhiteChange {
    verdict.drift.white.as_ref().unwrap()
}

/// A table learned from simulated photographs, and what was learned.
fn learned(scene: &Scene, place: &Path) -> BuiltTable {
    let capture = place.join("capture");
    photograph(scene, 100, 3, &capture);
    simulated::learned(&capture)
}

/// A folder to verify `learned` with, photographed in `scene`.
fn photographed(learned: &BuiltTable, scene: &Scene, folder: &Path) {
    let table = Table::check(&learned.compiled.image).unwrap();
    let projector = FrameSize::new(320, 200).unwrap();
    let layout = Layout::new(table.grid(), projector, 4).unwrap();
    let settings = Settings {
        camera: learned.measurements.settings.camera.clone(),
        ..Settings::default()
    };
    write(
        &table,
        &layout,
        (&settings, Slides::Both { fine: false }),
        folder,
        &Silent,
    )
    .unwrap();
    let simulation = simulation(scene, Forced::default());
    let camera = VirtualCamera::new(scene, &simulation, 11).unwrap();
    simulated::take(scene, folder, &camera);
}

fn verdict(learned: &BuiltTable, folder: &Path) -> Result<TableVerdict, VerifyError> {
    let table = Table::check(&learned.compiled.image).unwrap();
    let session = Readings::read(folder, &table, &Silent)?;
    judge(folder, &table, &session, None)
}

/// Mean errors of plain and compensated pictures on the wall, without noise.
fn truth(learned: &BuiltTable, scene: &Scene, folder: &Path) -> [f64; 2] {
    let table = Table::check(&learned.compiled.image).unwrap();
    let session = Readings::read(folder, &table, &Silent).unwrap();
    let simulation = simulation(scene, Forced::default().with(Effect::Noise, false));
    [0, 1].map(|half| {
        let inputs: Vec<&Vec<f64>> = session.shown.iter().map(|s| &s.input[half][0]).collect();
        let inputs = DMatrix::from_fn(inputs[0].len(), inputs.len(), |cell, k| inputs[k][cell]);
        let exposed = simulation.expose(&inputs).unwrap();
        let errors = session.shown.iter().enumerate().map(|(k, shown)| {
            let plane = &simulation.photograph(&exposed, k)[0];
            let seen = cell_means(&learned.measurements.registration, plane, inputs.nrows());
            error(&seen, &shown.wanted[0], &session.live)
        });
        errors.sum::<f64>() / session.shown.len() as f64
    })
}

#[test]
fn a_good_table_passes_with_the_errors_that_are_really_there_wherever_the_camera_stands() {
    let place = tempfile::tempdir().unwrap();
    let original = scene(&[]);
    let learned = learned(&original, place.path());
    let at = |position: &str, view: &str| {
        scene(&[
            ("position = [0.6, 0.3, 9.0]", position),
            ("field_of_view = 27.0", view),
        ])
    };
    let near = at("position = [0.5, 0.35, 8.9]", "field_of_view = 28.0");
    let far = at("position = [-0.2, 0.6, 8.6]", "field_of_view = 29.0");
    for (name, scene) in [("same", &original), ("near", &near), ("far", &far)] {
        let folder = place.path().join(name);
        photographed(&learned, scene, &folder);
        let verdict = verdict(&learned, &folder).unwrap();
        let truth = truth(&learned, &original, &folder);
        println!(
            "{name}: {:?} {:?}, truth {truth:?}, bound {:?}, drift {:?} {:.4} alone {:.4}",
            verdict.outcome,
            verdict.error,
            verdict.bound,
            white_of(&verdict).level,
            white_of(&verdict).shape,
            white_of(&verdict).alone
        );
        let said = (verdict.outcome, verdict.cause);
        assert_eq!(said, (Outcome::Passed, None), "{name}");
        assert!(
            verdict.cells.0 * 100 >= verdict.cells.1 * 95,
            "{:?}",
            verdict.cells
        );
        assert!((verdict.error[0] / truth[0] - 1.0).abs() < 0.05, "{name}");
        // The photographs' noise comes on top of the compensated pictures' small error, and
        // what a camera elsewhere sees of other parts of the cells.
        let noise = verdict.bound.noise.unwrap();
        let both = truth[1].hypot(noise).hypot(verdict.bound.viewpoint);
        assert!(
            (verdict.error[1] / both - 1.0).abs() < 0.35,
            "{name}: {both}"
        );
        assert!(verdict.error[1] < 0.15 * verdict.error[0], "{name}");
        // What the table makes of its own pictures without compensation is no guess.
        let modelled: f64 = verdict
            .images
            .iter()
            .map(|image| image.modelled.unwrap()[0])
            .sum();
        let modelled = modelled / verdict.images.len() as f64;
        assert!(
            (modelled / verdict.error[0] - 1.0).abs() < 0.05,
            "{modelled}"
        );
        let shape = white_of(&verdict).shape;
        assert!(shape < 0.02, "{shape}");
    }
}

#[test]
fn a_table_of_another_scene_fails_and_white_says_that_the_scene_is_another() {
    let place = tempfile::tempdir().unwrap();
    let learned = learned(&scene(&[]), place.path());
    // The inner panels were painted, and the outer ones are not.
    let painted = scene(&[(
        "name = \"left inner\"\ncorners = [[-1, 1.25, -1], [0, 1.25, 0], [0, -1.25, 0], [-1, -1.25, -1]]\nalbedo = 0.8",
        "name = \"left inner\"\ncorners = [[-1, 1.25, -1], [0, 1.25, 0], [0, -1.25, 0], [-1, -1.25, -1]]\nalbedo = 0.5",
    )]);
    let folder = place.path().join("other");
    photographed(&learned, &painted, &folder);
    let verdict = verdict(&learned, &folder).unwrap();
    let said = (verdict.outcome, verdict.cause);
    assert_eq!(
        said,
        (Outcome::Failed, Some(Cause::Scene)),
        "{:?}",
        verdict.bound
    );
    assert!(white_of(&verdict).shape > 0.1, "{:?}", verdict.drift);
    // The worst cells are on the panel that was painted, or on the one that it lights:
    // columns 5 to 15 of 21 are the inner two.
    assert!(
        (4..=16).contains(&verdict.worst[0].col),
        "{:?}",
        verdict.worst
    );
}

#[test]
fn exchanged_photographs_are_named_and_missing_ones_listed() {
    let place = tempfile::tempdir().unwrap();
    let original = scene(&[]);
    let learned = learned(&original, place.path());
    let folder = place.path().join("folder");
    photographed(&learned, &original, &folder);
    let listed = std::fs::read_to_string(folder.join("verify.csv")).unwrap();
    let name_of = |role: &str| {
        let line = listed.lines().find(|line| line.contains(role)).unwrap();
        line.rsplit(',').next().unwrap().to_owned()
    };
    let [own, other] = ["plain-0", "plain-1"].map(|role| folder.join(name_of(role)));
    let aside = folder.join("aside");
    std::fs::rename(&own, &aside).unwrap();
    std::fs::rename(&other, &own).unwrap();
    std::fs::rename(&aside, &other).unwrap();
    let error = verdict(&learned, &folder).unwrap_err();
    assert!(matches!(error, VerifyError::Order { .. }), "{error}");
    assert!(error.to_string().contains("plain-0"), "{error}");
    std::fs::remove_file(folder.join("photos/003.png")).unwrap();
    std::fs::remove_file(&own).unwrap();
    let error = verdict(&learned, &folder).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("003.png") && text.contains(&name_of("plain-0")),
        "{text}"
    );
}

/// A short form of the study on `docs/verify.md`.
#[test]
fn what_passes_is_on_the_wall_and_no_fault_of_photographs_or_wall_passes() {
    use CaptureFault as F;
    use Outcome::{Failed, Inconclusive};
    let rig = VerdictRig::new(simulated::scene("installation", &[]));
    let wall = "[2.4, 0, 0], [0, 0, 0]]\nalbedo = 0.7";
    let painted = wall.replace("0.7", "0.6");
    let painted = simulated::scene("installation", &[(wall, &painted)]);
    let cases = [
        rig.good("no fault", 1),
        rig.faulty(F::Tripod, 0.5, &[Inconclusive]),
        rig.faulty(F::Flicker, 0.01, &[Inconclusive]),
        rig.faulty(F::Gamma, 2.2, &[Inconclusive]),
        rig.faulty(F::Vivid, 0.15, &[Failed]),
        rig.changed("painted", painted, &[Failed]),
    ];
    for case in cases {
        let session = rig.judge(case);
        println!("{}", session.line());
        assert!(session.is_right(), "{session:?}");
    }
}

/// What happens within cells, which their mean light does not tell.
#[test]
fn a_picture_beside_its_place_does_not_pass_and_is_named() {
    let painted = |right: f64| {
        let pixel = 2.0 * 0.4_f64.hypot(9.5) * 11.5_f64.to_radians().tan() / 480.0;
        let to = format!(
            "look_at = [{}, 0.0, -0.5]\nfield_of_view = 23.0",
            right * pixel
        );
        let projector = "look_at = [0.0, 0.0, -0.5]\nfield_of_view = 23.0";
        let camera = ("width = 216\nheight = 150", "width = 432\nheight = 300");
        simulated::scene("m-panels-painted", &[camera, (projector, &to)])
    };
    let rig = VerdictRig::new(painted(0.0));
    let good = rig.judge(rig.good("no fault", 1));
    assert!(good.is_right(), "{good:?}");
    let nudged = rig.judge(rig.changed("nudged", painted(1.0), &[Outcome::Failed]));
    assert!(nudged.is_right(), "{}", nudged.line());
    let verdict = nudged.verdict.unwrap();
    assert_eq!(verdict.cause, Some(Cause::Nudged));
    let [right, down] = verdict.pixels.unwrap().fixed.unwrap().shift.unwrap();
    assert!(
        (right - 1.0).abs() < 0.3 && down.abs() < 0.3,
        "{right} {down}"
    );
}
