//! Captures with what goes wrong at real installations, and good ones: which gates
//! say so.

use super::*;
use crate::test_capture::{Dice, TestCapture};
use iltm_picture::progress::Silent;
use image::{ImageBuffer, Luma};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// A capture large enough to tell patterns apart.
fn scene() -> TestCapture {
    TestCapture {
        rows: 9,
        cols: 12,
        pitch: 8.3,
        bounced: 0.001,
        noise: 0.003,
        bernoulli: 40,
        ..TestCapture::default()
    }
}

/// One photograph in light, and its size.
struct Shown {
    path: PathBuf,
    role: Role,
    /// Lit share of its pattern.
    share: f64,
    width: u32,
    light: Vec<f64>,
}

impl Shown {
    fn save(&self) {
        let value = |light: &f64| (light.clamp(0.0, 1.0) * 65535.0).round() as u16;
        let values = self.light.iter().map(value).collect();
        let height = self.light.len() as u32 / self.width;
        let picture = ImageBuffer::<Luma<u16>, Vec<u16>>::from_raw(self.width, height, values);
        picture.unwrap().save(&self.path).unwrap();
    }

    /// Shifted right by part of a pixel.
    fn shifted(&self, right: f64) -> Vec<f64> {
        let width = self.width as usize;
        let (whole, part) = (right.floor() as usize, right.fract());
        let at = |at: usize, back: usize| {
            let row = at / width * width;
            self.light[row + (at % width).saturating_sub(back)]
        };
        (0..self.light.len())
            .map(|k| (1.0 - part) * at(k, whole) + part * at(k, whole + 1))
            .collect()
    }
}

/// A capture whose photographs were changed by `fault`, which gets all of them in the
/// order of showing.
fn with(scene: &TestCapture, fault: impl FnOnce(&mut Vec<Shown>)) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let manifest = scene.write(folder.path());
    let patterns = scene.patterns();
    let mut all: Vec<Shown> = (manifest.shots.iter().zip(&patterns))
        .map(|(shot, (role, pattern))| {
            let path = folder.path().join(&shot.photo);
            let picture = image::open(&path).unwrap().into_luma16();
            let lit = pattern.lit.iter().filter(|lit| **lit).count();
            Shown {
                path,
                role: *role,
                share: lit as f64 / pattern.lit.len() as f64,
                width: picture.width(),
                light: picture.iter().map(|v| f64::from(*v) / 65535.0).collect(),
            }
        })
        .collect();
    fault(&mut all);
    for shown in &all {
        shown.save();
    }
    folder
}

fn gates(folder: &TempDir) -> Vec<Gate> {
    let examined = examine(folder.path(), &CaptureOptions::default(), &Silent).unwrap();
    examined.gates
}

/// The gates that fail, and what they say.
fn failed(folder: &TempDir) -> Vec<(GateName, String)> {
    let failed = gates(folder).into_iter().filter(Gate::fails);
    failed.map(|gate| (gate.name, gate.what)).collect()
}

/// Asserts that only `name` fails and that it uses `word`.
fn assert_named(folder: &TempDir, name: GateName, word: &str) {
    let failed = failed(folder);
    let names: Vec<GateName> = failed.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, [name], "{failed:?}");
    assert!(failed[0].1.contains(word), "{failed:?}");
}

/// The gate of a name.
fn gate(folder: &TempDir, name: GateName) -> Gate {
    let mut gates = gates(folder).into_iter();
    gates.find(|gate| gate.name == name).unwrap()
}

fn verdict(folder: &TempDir, name: GateName) -> Verdict {
    gate(folder, name).verdict
}

/// What a gate's page shows of each photograph: index and number, the limit, and the first
/// photograph of a change.
fn shown_of_photographs(gate: &Gate) -> (Vec<(u32, f64)>, Option<f64>, Option<u32>) {
    match &gate.evidence {
        Evidence::Photographs {
            values,
            limit,
            from,
            ..
        } => (values.clone(), *limit, *from),
        other => panic!("{other:?}"),
    }
}

/// What a gate's page shows of each cell.
fn shown_of_cells(gate: &Gate) -> Vec<f64> {
    match &gate.evidence {
        Evidence::Cells { values, .. } => values.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn good_captures_pass_at_every_noise() {
    for noise in [0.0, 0.002, 0.01, 0.03] {
        let scene = TestCapture { noise, ..scene() };
        let folder = with(&scene, |_| {});
        let gates = gates(&folder);
        assert!(gates.iter().all(|gate| !gate.fails()), "{noise}: {gates:?}");
        let warned: Vec<GateName> = (gates.iter())
            .filter(|gate| gate.verdict == Verdict::Warn)
            .map(|gate| gate.name)
            .collect();
        assert!(
            warned.iter().all(|name| *name == GateName::Noise),
            "{gates:?}"
        );
        assert_eq!(gates.len(), GateName::ALL.len());
        let passes = gates.iter().filter(|gate| gate.verdict == Verdict::Pass);
        for gate in passes {
            assert!(gate.number <= gate.limit, "{gate:?}");
        }
    }
}

#[test]
fn a_slow_drift_is_measured_and_divided_out() {
    let scene = TestCapture {
        noise: 0.001,
        ..scene()
    };
    let truth = scene.read();
    let folder = with(&scene, |shown| {
        let last = shown.len() as f64 - 1.0;
        for (at, shown) in shown.iter_mut().enumerate() {
            let gain = 1.0 - 0.06 * at as f64 / last;
            for light in &mut shown.light {
                // The ambient light is not the projector's and stays.
                *light = 0.02 + (*light - 0.02) * gain;
            }
        }
    });
    assert_eq!(failed(&folder), []);
    let drift = gate(&folder, GateName::Drift);
    assert!((drift.number - 6.0).abs() < 0.5, "{drift:?}");
    assert!(drift.what.contains("corrected"));
    let (values, limit, _) = shown_of_photographs(&drift);
    let last = f64::from(values[values.len() - 1].0);
    for (index, value) in &values {
        // White, the first photograph, is what all are compared with.
        let shown = -6.0 * f64::from(*index) / last;
        assert!((value - shown).abs() < 0.4, "{index}: {value}, not {shown}");
    }
    let limit = limit.unwrap();
    assert!((limit - (30.0 - 6.0)).abs() < 0.4, "{limit}");
    let drifted = read(folder.path(), &CaptureOptions::default(), &Silent).unwrap();
    let (a, b) = (
        &truth.channels[0].observations,
        &drifted.channels[0].observations,
    );
    let all = a.norm();
    let scale = a.dot(b) / b.norm_squared();
    let off = (b * scale - a).norm() / all;
    assert!(off < 0.004, "{off}");
}

#[test]
fn a_steady_session_is_left_as_it_is() {
    let scene = scene();
    let folder = with(&scene, |_| {});
    let drift = gate(&folder, GateName::Drift);
    assert!(
        drift.number < 0.5 && drift.what.contains("steady"),
        "{drift:?}"
    );
}

#[test]
fn an_undeclared_gamma_is_told_from_an_exposure_that_follows_the_picture() {
    for gamma in [1.4, 2.2] {
        let folder = with(&scene(), |shown| {
            for light in shown.iter_mut().flat_map(|shown| &mut shown.light) {
                *light = light.powf(1.0 / gamma);
            }
        });
        let failed = failed(&folder);
        let superposition = failed.iter().find(|f| f.0 == GateName::Superposition);
        let what = &superposition.unwrap_or_else(|| panic!("{failed:?}")).1;
        assert!(what.contains("gamma is not the declared one"), "{what}");
        assert!(
            failed
                .iter()
                .all(|(name, _)| { matches!(name, GateName::Superposition | GateName::Response) }),
            "{failed:?}"
        );
    }
}

#[test]
fn automatic_exposure_is_named() {
    for part in [0.2, 1.0] {
        let folder = with(&scene(), |shown| {
            for shown in shown {
                let gain = (1.0 / shown.share.max(0.3)).powf(part) * 0.5_f64.powf(part);
                shown.light.iter_mut().for_each(|light| *light *= gain);
            }
        });
        assert_named(&folder, GateName::Superposition, "automatic exposure");
    }
}

#[test]
fn a_projector_that_dims_dark_pictures_is_named() {
    for size in [0.1, 0.4] {
        let folder = with(&scene(), |shown| {
            for shown in shown {
                let gain = 1.0 - size * (1.0 - shown.share);
                for light in &mut shown.light {
                    *light = 0.02 + (*light - 0.02) * gain;
                }
            }
        });
        assert_named(&folder, GateName::Superposition, "vivid");
    }
}

#[test]
fn a_bumped_tripod_is_named_with_the_photographs_around_it() {
    for right in [0.8, 3.0] {
        let folder = with(&scene(), |shown| {
            for shown in &mut shown[38..] {
                shown.light = shown.shifted(right);
            }
        });
        assert_named(&folder, GateName::Movement, "moved by");
        let what = &failed(&folder)[0].1;
        assert!(
            what.contains("037.png") && what.contains("038.png"),
            "{what}"
        );
        let movement = gate(&folder, GateName::Movement);
        let (values, limit, from) = shown_of_photographs(&movement);
        assert_eq!((limit, from), (Some(movement.limit), Some(38)));
        for (index, value) in values {
            if index < 38 {
                assert!(value < 0.4 * right, "{index}: {value}");
            } else {
                // A shift of several pixels looks smaller than it is.
                assert!(
                    (0.4 * right..1.1 * right).contains(&value),
                    "{index}: {value}"
                );
            }
        }
    }
}

#[test]
fn a_bump_between_white_and_the_patterns_is_named() {
    let folder = with(&scene(), |shown| shown[0].light = shown[0].shifted(3.0));
    let movement = gate(&folder, GateName::Movement);
    assert!(movement.fails(), "{movement:?}");
    let what = &movement.what;
    assert!(what.contains("between white, photos/000.png"), "{what}");
    let (values, limit, _) = shown_of_photographs(&movement);
    assert_eq!(values, [(0, movement.number)]);
    assert_eq!(limit, Some(movement.limit));
    // Half the limit is worth a remark.
    let folder = with(&scene(), |shown| shown[0].light = shown[0].shifted(0.9));
    let movement = gate(&folder, GateName::Movement);
    assert_eq!(movement.verdict, Verdict::Warn, "{movement:?}");
}

#[test]
fn a_bump_between_two_photographs_of_white_is_named_whatever_lies_around_it() {
    let scene = TestCapture {
        repeats: 3,
        bernoulli: 10,
        ..scene()
    };
    assert_eq!(
        verdict(&with(&scene, |_| {}), GateName::Movement),
        Verdict::Pass
    );
    for (right, size) in [(0.8, 0.75..0.85), (3.0, 2.8..3.2), (6.0, 5.6..6.4)] {
        // White is first, third and fifth.
        let folder = with(&scene, |shown| {
            let moved = shown[4].shifted(right);
            shown[4].light = moved;
        });
        let movement = gate(&folder, GateName::Movement);
        assert!(movement.fails(), "{movement:?}");
        let what = &movement.what;
        let between = "between photos/002.png and photos/004.png, both of white";
        assert!(what.contains(between), "{what}");
        let (values, limit, from) = shown_of_photographs(&movement);
        assert_eq!((limit, from), (Some(movement.limit), Some(4)));
        assert_eq!(values.iter().map(|v| v.0).collect::<Vec<_>>(), [0, 2, 4]);
        assert!(size.contains(&movement.number), "{right}: {movement:?}");
    }
}

#[test]
fn photographs_that_changed_places_at_random_are_no_shift_of_all() {
    let folder = with(&scene(), |shown| {
        let places = [30, 37, 50];
        let lights = places.map(|at| shown[at].light.clone());
        for (k, light) in lights.into_iter().enumerate() {
            shown[places[(k + 1) % 3]].light = light;
        }
    });
    let order = gate(&folder, GateName::Order);
    assert_eq!((order.fails(), order.number), (true, 3.0), "{order:?}");
    assert!(
        !order.what.contains("moved up") && !order.what.contains("earlier"),
        "{order:?}"
    );
}

#[test]
fn a_photograph_of_the_next_pattern_and_one_of_a_later_one_are_not_exchanged() {
    let folder = with(&scene(), |shown| {
        let mut dice = Dice::new(9);
        for (at, other) in [(30, 37), (37, 50)] {
            shown[at].light = shown[other].light.clone();
            for light in &mut shown[at].light {
                *light += 0.003 * dice.normal();
            }
        }
    });
    let order = gate(&folder, GateName::Order);
    assert_eq!((order.fails(), order.number), (true, 2.0), "{order:?}");
    let words = [
        "030.png shows that of photos/037.png",
        "037.png shows that of photos/050.png",
    ];
    assert!(
        words.iter().all(|words| order.what.contains(words)),
        "{order:?}"
    );
    assert!(!order.what.contains("are exchanged: each"), "{order:?}");
}

#[test]
fn a_photograph_that_shows_no_pattern_is_named_and_white_that_is_a_little_dark_is_not() {
    // As many cells as ever, every other one of a checkerboard.
    let scene = scene();
    let (rows, cols) = (scene.rows, scene.cols);
    let lit = (0..rows * cols).map(|cell| (cell / cols + cell % cols) % 2 == 0);
    let board = Pattern {
        rows,
        cols,
        lit: lit.collect(),
    };
    let folder = with(&scene, |shown| {
        shown[40].light = scene.light(&board);
        for light in &mut shown[0].light {
            *light *= 0.95;
        }
    });
    let order = gate(&folder, GateName::Order);
    assert_eq!((order.fails(), order.number), (true, 1.0), "{order:?}");
    assert!(order.what.contains("040.png shows none"), "{order:?}");
    let (values, limit, _) = shown_of_photographs(&order);
    // Half of the cells are not as they should be.
    let (own, limit) = (values[40].1, limit.unwrap());
    assert!(
        (own - 0.5).abs() < 0.15 && (limit - 0.35).abs() < 1e-9,
        "{own} {limit}"
    );
}

#[test]
fn photographs_after_one_that_was_taken_twice_are_named_as_earlier() {
    let folder = with(&scene(), |shown| {
        for at in (31..shown.len()).rev() {
            shown[at].light = shown[at - 1].light.clone();
        }
        let mut dice = Dice::new(9);
        for light in &mut shown[31].light {
            *light += 0.003 * dice.normal();
        }
    });
    let order = gate(&folder, GateName::Order);
    assert!(
        order.what.contains("from photos/031.png on") && order.what.contains("1 earlier"),
        "{order:?}"
    );
}

#[test]
fn exchanged_photographs_are_named() {
    for (a, b) in [(30, 44), (2, 7), (3, 33), (0, 21)] {
        let folder = with(&scene(), |shown| {
            let (one, other) = (shown[a].light.clone(), shown[b].light.clone());
            (shown[a].light, shown[b].light) = (other, one);
        });
        let failed = failed(&folder);
        assert_eq!(failed[0].0, GateName::Order, "{failed:?}");
        let what = &failed[0].1;
        let names = [a, b].map(|at| format!("{at:03}.png"));
        assert!(names.iter().all(|name| what.contains(name)), "{what}");
        assert!(what.contains("are exchanged: each"), "{what}");
    }
}

#[test]
fn a_photograph_that_was_never_taken_is_found_where_the_others_moved_up() {
    for missing in [6, 30, 50] {
        let folder = with(&scene(), |shown| {
            for at in missing..shown.len() - 1 {
                shown[at].light = shown[at + 1].light.clone();
            }
            // The camera went on: the last is a new photograph of the last pattern.
            let mut dice = Dice::new(9);
            let last = shown.len() - 1;
            for light in &mut shown[last].light {
                *light += 0.003 * dice.normal();
            }
        });
        let failed = failed(&folder);
        assert_eq!(failed[0].0, GateName::Order, "{failed:?}");
        let what = &failed[0].1;
        assert!(what.contains(&format!("{missing:03}.png")), "{what}");
        assert!(what.contains("missing"), "{what}");
    }
}

#[test]
fn a_missing_photograph_is_named_and_the_others_are_still_judged() {
    let folder = with(&scene(), |_| {});
    fs::remove_file(folder.path().join("photos/033.png")).unwrap();
    assert_named(&folder, GateName::Complete, "photos/033.png");
    assert_eq!(verdict(&folder, GateName::Superposition), Verdict::Pass);
}

#[test]
fn a_file_that_is_there_twice_is_named() {
    let folder = with(&scene(), |_| {});
    let photos = folder.path().join("photos");
    fs::copy(photos.join("031.png"), photos.join("032.png")).unwrap();
    let failed = failed(&folder);
    assert_eq!(failed[0].0, GateName::Complete, "{failed:?}");
    assert!(
        failed[0].1.contains("032.png is photos/031.png"),
        "{failed:?}"
    );
}

#[test]
fn clipped_white_is_named_also_below_full_scale() {
    for (gain, ceiling) in [(2.2, 1.0), (1.0, 0.47)] {
        let scene = TestCapture {
            albedo: |row, col| 0.7 + 0.02 * row + 0.02 * col,
            ..scene()
        };
        let folder = with(&scene, |shown| {
            for light in shown.iter_mut().flat_map(|shown| &mut shown.light) {
                *light = (*light * gain).min(ceiling);
            }
        });
        let failed = failed(&folder);
        assert_eq!(failed[0].0, GateName::Saturation, "{failed:?}");
        assert!(failed[0].1.contains("clipped"), "{failed:?}");
    }
}

#[test]
fn flicker_is_named_as_jumps_and_as_bands() {
    let mut gains = Vec::new();
    let folder = with(&scene(), |shown| {
        let mut dice = Dice::new(4);
        for shown in shown {
            let gain = 1.0 + 0.04 * (std::f64::consts::TAU * dice.uniform()).sin();
            shown.light.iter_mut().for_each(|light| *light *= gain);
            gains.push(gain);
        }
    });
    assert_named(&folder, GateName::Flicker, "jumps");
    let flicker = gate(&folder, GateName::Flicker);
    // Half of all sines are above .707.
    let spread = 100.0 * 1.4826 * 0.707 * 0.04;
    assert!((flicker.number / spread - 1.0).abs() < 0.25, "{flicker:?}");
    let (values, limit, _) = shown_of_photographs(&flicker);
    assert_eq!(limit, Some(1.5));
    // Slow changes are taken off, so that neighbours are compared; white is judged apart.
    for two in values[1..].windows(2) {
        let jump = 100.0 * (gains[two[1].0 as usize] - gains[two[0].0 as usize]);
        let shown = two[1].1 - two[0].1;
        assert!((shown - jump).abs() < 1.2, "{two:?}: {shown}, not {jump}");
    }
    let folder = with(&scene(), |shown| {
        let mut dice = Dice::new(4);
        for shown in shown {
            let (phase, width) = (dice.uniform(), shown.width as usize);
            let height = shown.light.len() / width;
            for (at, light) in shown.light.iter_mut().enumerate() {
                let wave = 2.3 * (at / width) as f64 / height as f64 + phase;
                *light *= 1.0 + 0.04 * (std::f64::consts::TAU * wave).sin();
            }
        }
    });
    assert_named(&folder, GateName::Flicker, "bands");
    let flicker = gate(&folder, GateName::Flicker);
    assert!(
        (flicker.number - 4.0 / 2.0_f64.sqrt()).abs() < 0.5,
        "{flicker:?}"
    );
    let Evidence::Curve { points, .. } = &flicker.evidence else {
        panic!("{flicker:?}");
    };
    let highest = points.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    assert!(
        (highest.0 - 2.3).abs() < 0.3 && (highest.1 - 4.0).abs() < 0.7,
        "{highest:?}"
    );
}

#[test]
fn noise_is_shown_for_each_cell_as_it_is() {
    let scene = TestCapture {
        noise: 0.02,
        ..scene()
    };
    let folder = with(&scene, |_| {});
    let judged = gate(&folder, GateName::Noise);
    let noise = shown_of_cells(&judged);
    // All cells are about as bright.
    let squares: f64 = noise.iter().map(|noise| noise * noise).sum();
    let number = (squares / noise.len() as f64).sqrt();
    assert!(
        (judged.number / number - 1.0).abs() < 0.05,
        "{number}: {judged:?}"
    );
    let pixels = shown_of_cells(&gate(&folder, GateName::Coverage));
    for (cell, (noise, pixels)) in noise.iter().zip(&pixels).enumerate() {
        let white = scene.direct + 107.0 * scene.bounced;
        let wanted = 100.0 * (1.0 / pixels).sqrt() * scene.noise / white;
        assert!(
            (noise / wanted - 1.0).abs() < 0.25,
            "{cell}: {noise}, not {wanted}"
        );
    }
}

#[test]
fn cells_that_the_camera_does_not_see_are_counted_by_where_they_lie() {
    let folder = with(&scene(), |shown| {
        for shown in shown {
            let width = shown.width as usize;
            for (at, light) in shown.light.iter_mut().enumerate() {
                if at % width < 38 && at / width < 30 {
                    *light = 0.02;
                }
            }
        }
    });
    let coverage = gate(&folder, GateName::Coverage);
    // 9 x 12 cells of 8.3 pixels beside a margin of 4.4: three rows of four.
    assert!(coverage.what.contains("12 top left"), "{coverage:?}");
    assert!((coverage.number - 100.0 * 12.0 / 108.0).abs() < 1e-9);
    let hidden = |cell: usize| cell / 12 < 3 && cell % 12 < 4;
    for (cell, pixels) in shown_of_cells(&coverage).iter().enumerate() {
        assert_eq!(pixels.is_nan(), hidden(cell), "{cell}: {pixels}");
    }
}

#[test]
fn a_gate_that_is_ignored_is_named_in_the_measurements() {
    let folder = with(&scene(), |shown| {
        for shown in &mut shown[38..] {
            shown.light = shown.shifted(0.8);
        }
    });
    let ignoring = |ignore: Vec<GateName>| {
        let options = CaptureOptions {
            ignore,
            ..CaptureOptions::default()
        };
        read(folder.path(), &options, &Silent)
    };
    let error = ignoring(vec![GateName::Drift]).unwrap_err();
    assert!(error.to_string().contains("gate movement: "), "{error}");
    let measured = ignoring(vec![GateName::Movement]).unwrap();
    let failing = measured.diagnostics.gates.into_iter().filter(Gate::fails);
    let names: Vec<GateName> = failing.map(|gate| gate.name).collect();
    assert_eq!(names, [GateName::Movement]);
}

#[test]
fn stripes_alone_are_judged_by_what_they_show() {
    let scene = TestCapture {
        bernoulli: 0,
        ..scene()
    };
    let folder = with(&scene, |shown| {
        assert!(shown.iter().all(|shown| shown.role != Role::Bernoulli));
    });
    let options = CaptureOptions {
        min_bernoulli: 0,
        ..CaptureOptions::default()
    };
    let examined = examine(folder.path(), &options, &Silent).unwrap();
    let of = |name| examined.gates.iter().find(|g| g.name == name).unwrap();
    assert_eq!(of(GateName::Superposition).verdict, Verdict::Pass);
    assert_eq!(of(GateName::Coverage).verdict, Verdict::Pass);
    // One photograph of white says nothing of how the light changed.
    assert_eq!(of(GateName::Drift).verdict, Verdict::NotJudged);
    let flicker = of(GateName::Flicker);
    assert_eq!(flicker.verdict, Verdict::Pass);
    assert!(flicker.what.contains("too few were taken"), "{flicker:?}");
    assert!(examined.gates.iter().all(|gate| !gate.fails()));
}
