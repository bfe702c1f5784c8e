//! Gates before a solve: good sessions pass, and faults are found by the gate that is meant to.

use iltm::capture::{self, CaptureOptions, Gate, GateName, SETTINGS_FILE, Verdict};
use iltm::progress::Silent;
use iltm::scene::fill_capture::UnfilledCapture;
use iltm::scene::{CaptureFault, Forced, VirtualCamera};
use iltm::session::{self, Layout, OrderOptions, order};
use iltm_runtime::FrameSize;
use iltm_tests::gates::{FaultCount, StudiedFault, Study};
use iltm_tests::simulated::{scene, simulation};
use std::path::Path;

/// The short form of the study that docs/gates.md shows.
#[test]
fn random_good_sessions_pass_and_every_fault_is_found() {
    let study = Study {
        first: 5_000,
        good: 8,
        faulty: 1,
        faults: StudiedFault::ALL.to_vec(),
        threads: 2,
    };
    let result = study.run(&|_| {});
    assert!(result.refused.is_empty(), "{:#?}", result.refused);
    for (fault, count) in study.faults.iter().zip(&result.faults) {
        assert!(count.all == count.found, "{}: {count:#?}", fault.kind);
    }
}

/// Sessions of the study in which these faults are hardest to tell: a bump before the first
/// patterns, bands nearly as short as cells, curves, and brightness that looks like curves.
#[test]
fn faults_that_look_like_others_are_found() {
    for (seed, kind) in [
        (52, CaptureFault::Tripod),
        (30, CaptureFault::Flicker),
        (14, CaptureFault::Gamma),
        (52, CaptureFault::Gamma),
        (59, CaptureFault::Gamma),
        (10_005, CaptureFault::Gamma),
        (10_035, CaptureFault::Gamma),
        (62, CaptureFault::Vivid),
        (112, CaptureFault::AutoExposure),
        (103, CaptureFault::Skipped),
        (19, CaptureFault::Swapped),
    ] {
        let count = studied(seed, kind);
        assert_eq!((count.all, count.found), (1, 1), "{count:#?}");
    }
}

/// A scene in which light hardly bounces: patterns add up whatever the camera's curve.
#[test]
fn a_curve_that_pixels_hardly_tell_is_left_open() {
    let count = studied(10_023, CaptureFault::Gamma);
    assert_eq!((count.found, count.left_open), (0, 1), "{count:#?}");
}

/// One session of the study, good and with one fault.
fn studied(seed: u64, kind: CaptureFault) -> FaultCount {
    let is_that = |fault: &&StudiedFault| fault.kind == kind;
    let study = Study {
        first: seed,
        good: 1,
        faulty: 1,
        faults: StudiedFault::ALL.iter().filter(is_that).copied().collect(),
        threads: 1,
    };
    let mut result = study.run(&|_| {});
    assert!(result.refused.is_empty(), "{:#?}", result.refused);
    result.faults.remove(0)
}

fn gates(folder: &Path, bernoulli: Option<usize>) -> Vec<Gate> {
    let options = CaptureOptions {
        bernoulli,
        ..CaptureOptions::default()
    };
    capture::examine(folder, &options, &Silent).unwrap().gates
}

/// The guide's foyer. With few random patterns the Gray code looks much like itself two
/// photographs later, and declared linear the camera's curve makes colours not add up.
#[test]
fn few_patterns_accuse_no_photograph_and_a_curved_camera_no_projector() {
    let scene = scene("installation", &[]);
    let simulation = simulation(&scene, Forced::default());
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("foyer");
    let options = OrderOptions {
        bernoulli: 60,
        ..OrderOptions::default()
    };
    let size = FrameSize::new(32, 24).unwrap();
    let layout = Layout::new(simulation.grid(), size, 0).unwrap();
    let slides = order(&layout, &options);
    let camera = capture::CameraSettings {
        response: scene.camera.response.into(),
        ..capture::CameraSettings::default()
    };
    session::write(&slides, &layout, &camera, &folder, &Silent).unwrap();
    let camera = VirtualCamera::new(&scene, &simulation, 1).unwrap();
    let unfilled = UnfilledCapture::read(&folder, &scene, None).unwrap();
    unfilled.take_missing(&camera, &Silent).unwrap();
    for bernoulli in [10, 15, 20] {
        let gates = gates(&folder, Some(bernoulli));
        let failed: Vec<&Gate> = gates.iter().filter(|gate| gate.fails()).collect();
        assert!(failed.is_empty(), "{bernoulli}: {failed:#?}");
    }
    let settings = folder.join(SETTINGS_FILE);
    let text = std::fs::read_to_string(&settings).unwrap();
    let linear = text.replacen("response = \"srgb\"", "response = \"linear\"", 1);
    assert_ne!(text, linear);
    std::fs::write(&settings, linear).unwrap();
    let gates = gates(&folder, Some(20));
    let gate = |name: GateName| gates.iter().find(|gate| gate.name == name).unwrap();
    assert!(
        gate(GateName::Superposition)
            .next_step
            .contains("[camera] response")
    );
    assert_eq!(gate(GateName::Response).verdict, Verdict::NotJudged);
}
