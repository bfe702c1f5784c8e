//! Verdicts of `iltm verify`: sessions with every fault at several sizes, and what is really on
//! the wall: `cargo run --release -p iltm-tests --bin verdicts`.
//!
//! Words choose the sessions whose scene and name together contain one of them.

use iltm::scene::description::Scene;
use iltm::verify::Outcome;
use iltm_tests::simulated::scene;
use iltm_tests::verdicts::{HEAD, VerdictRig, faded_mural, study};
use std::path::Path;

/// The installation, with some words of it replaced.
fn foyer(pairs: &[(&str, String)]) -> Scene {
    let pairs: Vec<(&str, &str)> = pairs.iter().map(|(a, b)| (*a, b.as_str())).collect();
    scene("installation", &pairs)
}

/// The installation as it was changed since, or seen from another place, and what must come of it.
fn changed_foyers() -> [(&'static str, Scene, &'static [Outcome]); 6] {
    let wall = "name = \"right wall\"\ncorners = [[0, 2.4, 0], [2.4, 2.4, 0], [2.4, 0, 0], [0, 0, 0]]\nalbedo = 0.7";
    let painted = |to: &str| foyer(&[(wall, wall.replace("0.7", to))]);
    let seen = |from: &str, to: &str| {
        foyer(&[
            ("position = [2.2, 2.1, 2.9]", format!("position = [{from}]")),
            ("look_at = [0.0, 0.75, 0.0]", format!("look_at = [{to}]")),
        ])
    };
    [
        (
            "good, camera put down 3 cm away",
            seen("2.23, 2.1, 2.9", "0.01, 0.75, 0.0"),
            &[Outcome::Passed][..],
        ),
        (
            "good, camera put down 10 cm away",
            seen("2.12, 2.15, 2.95", "0.0, 0.77, 0.0"),
            &[Outcome::Passed][..],
        ),
        (
            "good, camera put down 40 cm away",
            seen("1.9, 2.3, 3.1", "0.05, 0.75, 0.0"),
            &[Outcome::Passed][..],
        ),
        (
            "right wall of albedo 0.68 instead of 0.7",
            painted("0.68"),
            &[Outcome::Failed, Outcome::Inconclusive][..],
        ),
        (
            "right wall of albedo 0.6 instead of 0.7",
            painted("0.6"),
            &[Outcome::Failed][..],
        ),
        (
            "right wall of albedo 0.4 instead of 0.7",
            painted("0.4"),
            &[Outcome::Failed][..],
        ),
    ]
}

/// The painted panels with a camera of many pixels, and the projector nudged to the right by so many
/// of its own pixels, 20 along a cell's side.
fn panels(nudge: f64) -> Scene {
    let projector = "look_at = [0.0, 0.0, -0.5]\nfield_of_view = 23.0";
    let distance = 0.4_f64.hypot(9.5);
    let pixel = 2.0 * distance * 11.5_f64.to_radians().tan() / 480.0;
    let nudged = projector.replace("[0.0", &format!("[{}", nudge * pixel));
    let camera = "width = 216\nheight = 150";
    let pairs = [(camera, "width = 648\nheight = 450"), (projector, &nudged)];
    scene("m-panels-painted", &pairs)
}

/// The painted corner with a camera of many pixels and 12 bits, and the mural's detail faded by a
/// part; its file in `place`.
fn corner(place: &Path, faded: f64) -> Scene {
    let mural = faded_mural(place, faded);
    let mural = mural.to_str().expect("letters");
    let pairs = [
        ("width = 240\nheight = 180", "width = 640\nheight = 480"),
        ("full_well = 12000.0", "full_well = 60000.0"),
        ("bits = 8\nresponse = \"srgb\"", "bits = 12"),
        ("mural.png", mural),
    ];
    scene("painted-corner", &pairs)
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let others = changed_foyers();
    let place = tempfile::tempdir().expect("a folder");
    let corner = |faded| corner(place.path(), faded);
    let sixteen = [
        ("bits = 8\n", "bits = 16\n".to_owned()),
        ("response = \"srgb\"", "response = \"linear\"".to_owned()),
    ];
    let noisy = [("full_well = 15000.0", "full_well = 4000.0".to_owned())];
    let rigs = [
        (
            "installation",
            foyer(&[]),
            vec![2.2, 2.3, 2.0, 1.8, 1.4, 1.0],
        ),
        (
            "installation, 16 bits, linear",
            foyer(&sixteen),
            vec![1.02, 1.05, 1.1, 1.2, 1.4, 2.2],
        ),
        ("installation, noisy camera", foyer(&noisy), vec![2.0, 1.8]),
        (
            "m-panels",
            scene("m-panels", &[]),
            vec![1.02, 1.05, 1.1, 1.2, 1.4, 2.2],
        ),
    ];
    let sharper = [("width = 220\nheight = 160", "width = 440\nheight = 320")];
    let rigs = rigs.into_iter().chain([
        ("painted panels", panels(0.0), Vec::new()),
        ("painted corner", corner(0.0), Vec::new()),
        ("stage", scene("stage", &sharper), Vec::new()),
    ]);
    let mut wrong = 0;
    for (name, scene, gammas) in rigs {
        let chosen = |case: &str| {
            let all = format!("{name}: {case}");
            words.is_empty() || words.iter().any(|word| all.contains(word.as_str()))
        };
        let rig = VerdictRig::new(scene);
        let others = if name == "installation" {
            &others[..]
        } else {
            &[]
        };
        let any = &[Outcome::Passed, Outcome::Inconclusive, Outcome::Failed];
        let mut cases = match name {
            "painted panels" | "painted corner" | "stage" => {
                let good = |seed: u64| rig.good(&format!("good, seed {seed}"), seed);
                (1..=6).map(good).collect()
            }
            _ => study(&rig, &gammas, others),
        };
        if name == "painted panels" {
            for pixels in [0.1, 0.25, 0.5, 1.0, 2.0, 5.0] {
                let right = if pixels < 1.0 { &any[..] } else { &any[2..] };
                let what = format!("projector nudged by {pixels} pixels");
                cases.push(rig.changed(&what, panels(pixels), right));
            }
        }
        if name == "painted corner" {
            for part in [0.05, 0.1, 0.15, 0.2, 0.3] {
                let right = if part < 0.3 { &any[..] } else { &any[1..] };
                let what = format!("detail of the mural faded by {:.0} %", 100.0 * part);
                cases.push(rig.changed(&what, corner(part), right));
            }
        }
        if name == "installation" {
            for quality in [100, 95, 90, 80, 60] {
                let mut case = rig.good(&format!("good, JPEG of quality {quality}"), 4);
                case.jpeg = Some(quality);
                cases.push(case);
            }
        }
        println!("\n{name}\n\n{HEAD}");
        for case in cases.into_iter().filter(|case| chosen(&case.name)) {
            let session = rig.judge(case);
            let mark = if session.is_right() { "" } else { " WRONG" };
            wrong += usize::from(!session.is_right());
            println!("{}{mark}", session.line());
        }
    }
    println!("\n{wrong} sessions with an outcome that they must not have");
}
