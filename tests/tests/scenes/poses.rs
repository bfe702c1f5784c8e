//! Poses of the camera: photographs from several places, joined as one capture.

use iltm::capture::{
    CaptureError, CaptureOptions, GateName, JoinedPoses, PoseError, PosePhotographs, Verdict,
    join_poses, read_several,
};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm_tests::overlapping::{Screen, joined, learned_together, photograph_from_poses};
use iltm_tests::simulated::scene;
use std::path::{Path, PathBuf};

/// The folded screen with fewer cells and a coarser camera.
fn small() -> Scene {
    let mut scene = scene(
        "folded-screen",
        &[("rows = 15", "rows = 5"), ("cols = 24", "cols = 8")],
    );
    scene.camera.size = (200, 125);
    scene
}

fn join(
    poses: &[PosePhotographs],
    ignore: &[GateName],
    out: &Path,
) -> Result<JoinedPoses, PoseError> {
    std::fs::create_dir_all(out).unwrap();
    let out: Vec<PathBuf> = (0..2).map(|index| out.join(index.to_string())).collect();
    join_poses(poses, ignore, &out, &Silent)
}

/// The poses of two sessions: the first of one, the second of another.
fn of_both(first: &[PosePhotographs], second: &[PosePhotographs]) -> [PosePhotographs; 2] {
    [first[0].clone(), second[1].clone()]
}

#[test]
fn what_no_place_sees_whole_is_learned_from_two() {
    let mut scene = scene("folded-screen", &[]);
    // Nearer to the screen, a coarser camera sees as much.
    scene.camera.size = (400, 250);
    let place = tempfile::tempdir().unwrap();
    let poses = photograph_from_poses(&scene, 24, place.path());
    let captures = joined(&poses, &place.path().join("joined"));
    let seen = Screen::new(&scene).seen(&learned_together(&captures));
    println!("{seen:?}");
    assert!(seen.whole < 0.006, "{seen:?}");
    assert!(seen.overlap.is_some_and(|error| error < 0.016), "{seen:?}");
    assert!(seen.step.is_some_and(|step| step < 0.02), "{seen:?}");
}

#[test]
fn poses_that_do_not_belong_together_are_refused_by_name() {
    let scene = small();
    let place = tempfile::tempdir().unwrap();
    let poses =
        |name: &str, scene: &Scene| photograph_from_poses(scene, 10, &place.path().join(name));
    let good = poses("good", &scene);
    let out = |name: &str| place.path().join("out").join(name);
    let together = join(&good, &[], &out("good")).unwrap();
    assert_eq!(together.cells, [40, 40]);
    assert_eq!(together.together, [40, 40]);
    assert!(
        together.seen[0][1] < 30 && together.seen[1][0] < 30,
        "{:?}",
        together.seen
    );
    let verdicts = |joined: &JoinedPoses| -> Vec<_> {
        joined
            .gates
            .iter()
            .map(|gate| (gate.name, gate.verdict))
            .collect()
    };
    let passed = [
        (GateName::Drift, Verdict::Pass),
        (GateName::Movement, Verdict::Pass),
    ];
    assert_eq!(verdicts(&together), passed);
    let options = CaptureOptions {
        min_bernoulli: 10,
        ..CaptureOptions::default()
    };
    let captures = [out("good").join("0"), out("good").join("1")];
    let read = read_several(&captures, &options, &Silent).unwrap();
    assert!(read.is_overlapping());
    assert!(read.all.live.iter().all(|live| *live));

    let gates = |result: Result<JoinedPoses, PoseError>| match result.unwrap_err() {
        PoseError::Capture(CaptureError::Refused { gates, .. }) => gates,
        other => panic!("{other}"),
    };
    // The exposure changed by 8 % from place to place, and by 3 %.
    let mut darker = scene.clone();
    darker.camera.white *= 0.92;
    let other = of_both(&good, &poses("darker", &darker));
    let failed = gates(join(&other, &[], &out("darker")));
    assert_eq!(failed[0].name, GateName::Drift);
    assert!(
        failed[0].what.contains("before right") && failed[0].what.contains("92."),
        "{}",
        failed[0].what
    );
    assert!(join(&other, &[GateName::Drift], &out("darker")).is_ok());
    darker.camera.white = 0.97 * scene.camera.white;
    let other = of_both(&good, &poses("a-little", &darker));
    let joined = join(&other, &[], &out("a-little")).unwrap();
    assert_eq!(joined.gates[0].verdict, Verdict::Warn);
    // A projector was nudged in between.
    let nudged = (
        "look_at = [0.937, 0.8, 0.656]",
        "look_at = [0.967, 0.82, 0.656]",
    );
    let small = [("rows = 15", "rows = 5"), ("cols = 24", "cols = 8"), nudged];
    let mut nudged = iltm_tests::simulated::scene("folded-screen", &small);
    nudged.camera.size = scene.camera.size;
    let other = of_both(&good, &poses("nudged", &nudged));
    let failed = gates(join(&other, &[], &out("nudged")));
    assert_eq!(failed[0].name, GateName::Movement, "{failed:?}");
    // Other slides, and one place twice.
    let more = photograph_from_poses(&scene, 11, &place.path().join("more"));
    let error = join(&of_both(&good, &more), &[], &out("more"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("other slides than"), "{error}");
    let twice = [good[0].clone(), good[0].clone()];
    let error = join(&twice, &[], &out("twice")).unwrap_err().to_string();
    assert!(error.contains("given twice"), "{error}");
}

#[test]
fn a_pose_may_see_nothing_of_a_projector_but_its_light_on_other_walls() {
    let mut scene = small();
    let far = scene_with_far_pose();
    let place = tempfile::tempdir().unwrap();
    let mut poses = photograph_from_poses(&scene, 10, place.path());
    scene.poses = far.poses[2..].to_vec();
    poses.extend(photograph_from_poses(&scene, 10, place.path()));
    let out = place.path().join("out");
    let joined = join(&poses, &[], &out).unwrap();
    assert_eq!(joined.seen[2][1], 0, "{:?}", joined.seen);
    assert!(joined.seen[2][0] > 5, "{:?}", joined.seen);
    let unseen = joined
        .gates
        .iter()
        .find(|gate| gate.name == GateName::Coverage)
        .unwrap();
    assert_eq!(unseen.verdict, Verdict::Warn);
    assert!(unseen.what.contains("far left"), "{}", unseen.what);
    // By itself such a capture is refused, with a next step that names the cause.
    let options = CaptureOptions::default();
    let alone = iltm::capture::examine(&poses[2].captures[1], &options, &Silent).unwrap();
    assert!(alone.measurements.is_none());
    let failed: Vec<_> = alone.gates.iter().filter(|gate| gate.fails()).collect();
    assert!(!failed.is_empty());
    for gate in failed {
        let next = gate.next_step;
        assert!(next.contains("camera sees"), "{}: {next}", gate.name);
    }
}

fn scene_with_far_pose() -> Scene {
    let last = "look_at = [0.75, 0.78, 0.7]";
    let far = format!(
        "{last}\n\n[[pose]]\nname = \"far left\"\nposition = [0.0, 0.8, 3.6]\n\
         look_at = [-1.3, 0.8, 1.0]\nfield_of_view = 24.0\n"
    );
    scene("folded-screen", &[(last, &far)])
}
