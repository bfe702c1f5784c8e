//! Whole captures whose devices are measured: a camera that mixes the projector's
//! colours, ramps, brackets, repeats.

#[path = "../src/test_capture.rs"]
mod test_capture;

use iltm_capture::*;
use iltm_picture::progress::Silent;
use iltm_picture::{DeviceResponse, Response};
use iltm_solve::{SolveOptions, solve};
use image::{ImageBuffer, Rgb};
use nalgebra::DVector;
use std::fmt::Write;
use std::fs;
use test_capture::{Dice, TestCapture};

/// Light that each cell throws on every other one, by channel: the walls are
/// redder than blue.
const BOUNCED: [f64; 3] = [0.012, 0.005, 0.001];

const MIX: [[f64; 3]; 3] = [[1.0, 0.15, 0.02], [0.1, 1.0, 0.12], [0.01, 0.08, 1.0]];

const EVEN: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

const PROJECTOR: [Response; 3] = [Response::Gamma(2.0), Response::Gamma(2.2), Response::Srgb];

fn scene() -> TestCapture {
    TestCapture {
        direct: 0.4,
        noise: 0.001,
        ..TestCapture::default()
    }
}

/// Photographs of a projector's channels by a camera that mixes them.
struct Mixed {
    folder: tempfile::TempDir,
    mix: [[f64; 3]; 3],
    dice: Dice,
}

impl Mixed {
    fn new(mix: [[f64; 3]; 3]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        scene().write(folder.path());
        let mut mixed = Self {
            folder,
            mix,
            dice: Dice::new(9),
        };
        for (index, (_, pattern)) in scene().patterns().iter().enumerate() {
            mixed.photograph(index, pattern, [1.0; 3]);
        }
        mixed
    }

    /// Photographs a pattern whose lit cells have this light in each channel.
    fn photograph(&mut self, index: usize, pattern: &Pattern, lit: [f64; 3]) {
        let of_channel = |bounced: f64| TestCapture { bounced, ..scene() }.light(pattern);
        let primaries = BOUNCED.map(of_channel);
        let ambient = scene().ambient;
        let (width, height) = scene().camera();
        let mut values = Vec::new();
        let [red, green, blue] = &primaries;
        for ((red, green), blue) in red.iter().zip(green).zip(blue) {
            let own = [*red, *green, *blue];
            let light = [0, 1, 2].map(|p| ambient + lit[p] * (own[p] - ambient));
            for row in self.mix {
                let seen: f64 = row.iter().zip(light).map(|(m, l)| m * l).sum();
                let noisy = seen + scene().noise * self.dice.normal();
                values.push((noisy.clamp(0.0, 1.0) * 65_535.0).round() as u16);
            }
        }
        let (width, height) = (width as u32, height as u32);
        ImageBuffer::<Rgb<u16>, _>::from_raw(width, height, values)
            .unwrap()
            .save(self.folder.path().join(format!("photos/{index:03}.png")))
            .unwrap();
    }

    /// Adds ramps of all channels to the folder.
    fn with_ramps(self) -> Self {
        self.with_ramps_of(1.0)
    }

    /// The same of a projector that has only a part of its light for a channel alone.
    fn with_ramps_of(mut self, alone: f64) -> Self {
        let white = scene().patterns().remove(0).1;
        let mut lines = "index,role,pattern,photo\n".to_owned();
        let levels = (0..=15).map(|k| 17 * k);
        let all = RampChannel::ALL
            .into_iter()
            .flat_map(|channel| levels.clone().map(move |level| (channel, level)));
        for (index, (channel, level)) in (100..).zip(all) {
            let role = CalibrationRole::Ramp { channel, level };
            let files = format!("calibration/{index:03}.png,photos/{index:03}.png");
            writeln!(lines, "{index},{role},{files}").unwrap();
            let input = channel.input(level).map(|code| f64::from(code) / 255.0);
            let part = if channel == RampChannel::White {
                1.0
            } else {
                alone
            };
            let lit = [0, 1, 2].map(|p| part * PROJECTOR[p].light(input[p]));
            self.photograph(index, &white, lit);
        }
        fs::write(self.folder.path().join(CALIBRATION_FILE), lines).unwrap();
        self
    }

    fn read(&self) -> Measurements {
        read(self.folder.path(), &CaptureOptions::default(), &Silent).unwrap()
    }
}

/// How far what the camera sees of a compensated coloured picture is from what was
/// wanted: of the projector's primaries if they were unmixed, else of the camera's
/// channels.
fn error(measured: &Measurements, mix: [[f64; 3]; 3]) -> f64 {
    let solved = solve(measured, &SolveOptions::default(), &Silent);
    let inverse = solved.unwrap().inverse;
    let cells = measured.grid.cells();
    let wanted = [0, 1, 2].map(|channel| {
        DVector::from_fn(cells, |cell, _| {
            let wave = (0.9 * cell as f64 + 2.0 * f64::from(channel)).sin();
            0.1 + 0.06 * wave + if channel == 0 { 0.08 } else { 0.0 }
        })
    });
    let shown = [0, 1, 2].map(|channel| {
        let wanted = &wanted[channel];
        let gain = DVector::from_vec(inverse.channels[channel].gain.clone());
        let input = gain.component_mul(wanted) - &inverse.channel(channel).operator * wanted;
        let scene = scene();
        let bounced = BOUNCED[channel];
        DVector::from_fn(cells, |cell, _| {
            bounced * input.sum() + (scene.direct - bounced) * input[cell]
        })
    });
    let seen = if measured.devices.unmixed {
        shown
    } else {
        mix.map(|row| &shown[0] * row[0] + &shown[1] * row[1] + &shown[2] * row[2])
    };
    let squares = |of: &dyn Fn(usize) -> f64| (0..3).map(of).sum::<f64>();
    let off = squares(&|c| (&seen[c] - &wanted[c]).norm_squared());
    (off / squares(&|c| wanted[c].norm_squared())).sqrt()
}

#[test]
fn a_camera_that_mixes_colours_compensates_coloured_content_as_well_as_one_that_does_not() {
    let mixed = Mixed::new(MIX).with_ramps().read();
    assert!(mixed.devices.unmixed);
    let found = mixed.devices.mixing().unwrap();
    // Light of one channel lands in each photograph with its own bounces, which the
    // ratio of two channels does not know: that is the tolerance.
    for (found, truth) in found.matrix.iter().flatten().zip(MIX.iter().flatten()) {
        assert!((found - truth).abs() < 0.003, "{found} {truth}");
    }
    let even = Mixed::new(EVEN).with_ramps().read();
    assert!(!even.devices.unmixed, "{:?}", even.devices.mixing());
    let naive = Mixed::new(MIX).read();
    assert!(!naive.devices.unmixed);
    let (mixed, even, naive) = (error(&mixed, MIX), error(&even, EVEN), error(&naive, MIX));
    assert!(
        mixed < 1.1 * even && naive > 2.0 * mixed,
        "{mixed} {even} {naive}"
    );
}

#[test]
fn a_white_segment_is_named_and_a_projector_without_one_is_not() {
    for (alone, excess) in [(1.0, None), (0.8, Some("25 % brighter"))] {
        let capture = Mixed::new(EVEN).with_ramps_of(alone);
        let examined = examine(capture.folder.path(), &CaptureOptions::default(), &Silent).unwrap();
        let mut gates = examined.gates.into_iter();
        let response = gates.find(|gate| gate.name == GateName::Response).unwrap();
        assert_eq!(response.fails(), excess.is_some(), "{response:?}");
        let Evidence::Curve { points, .. } = &response.evidence else {
            panic!("{response:?}");
        };
        // The ramp of white alone.
        let levels: Vec<f64> = points.iter().map(|point| point.0).collect();
        let shown: Vec<f64> = (0..=15).map(|k| 17.0 * f64::from(k)).collect();
        assert_eq!(levels, shown);
        if let Some(words) = excess {
            assert!(response.what.contains(words), "{response:?}");
            assert!(
                response.next_step.contains("brilliant colour"),
                "{response:?}"
            );
        }
    }
}

#[test]
fn the_projectors_response_is_taken_from_its_ramp_unless_it_is_declared() {
    let capture = Mixed::new(MIX).with_ramps();
    let measured = capture.read();
    for (channel, truth) in PROJECTOR.into_iter().enumerate() {
        let found = measured.devices.projector.channel(channel);
        let steps = DeviceResponse::from(truth).steps_from(found);
        assert!(steps < 1.0, "{truth}: {steps}");
    }
    assert_eq!(measured.devices.projector_steps(), None);
    assert_eq!(measured.devices.calibration, (64, 64));
    let toml = "[projector]\nresponse = 1.8\n";
    fs::write(capture.folder.path().join(SETTINGS_FILE), toml).unwrap();
    let gates = examine(capture.folder.path(), &CaptureOptions::default(), &Silent).unwrap();
    let devices = &gates.measurements.unwrap().devices;
    assert_eq!(devices.projector, Response::Gamma(1.8).into());
    assert!(devices.projector_steps().unwrap() > 12.0);
    let response = gates
        .gates
        .iter()
        .find(|gate| gate.name == GateName::Response);
    assert!(response.unwrap().fails());
}

#[test]
fn a_response_that_shall_be_measured_and_cannot_be_is_an_error() {
    for (device, toml) in [
        ("projector", "[projector]\nresponse = \"measure\"\n"),
        ("camera", "[camera]\nresponse = \"measure\"\n"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let scene = TestCapture {
            // No pixel sees two cells or any other light than its own cell's.
            blur: 1e-6,
            pitch: 6.0,
            margin: 4.0,
            bounced: 0.0,
            ambient: 0.0,
            ..TestCapture::default()
        };
        scene.write(folder.path());
        fs::write(folder.path().join(SETTINGS_FILE), toml).unwrap();
        let error = read(folder.path(), &CaptureOptions::default(), &Silent).unwrap_err();
        let found =
            matches!(&error, CaptureError::ResponseUnknown { device: d, .. } if *d == device);
        assert!(found, "{error}");
    }
}

#[test]
fn an_eight_bit_gamma_camera_that_measures_itself_is_as_good_as_one_declared() {
    let scene = TestCapture {
        encode: |light| Response::Gamma(2.2).value(light),
        full_scale: 255,
        ..TestCapture::default()
    };
    let read_as = |response: &str| {
        let folder = scene.folder();
        let toml = format!("[camera]\nresponse = {response}\n");
        fs::write(folder.path().join(SETTINGS_FILE), toml).unwrap();
        examine(folder.path(), &CaptureOptions::default(), &Silent).unwrap()
    };
    let (measured, declared) = (read_as("\"measure\""), read_as("2.2"));
    let (measured, declared) = (
        measured.measurements.unwrap(),
        declared.measurements.unwrap(),
    );
    let fit = measured.devices.camera_fit.as_ref().unwrap();
    assert!(fit.best_misfit < 0.01 && !fit.contradicts(), "{fit:?}");
    let (a, b) = (
        &measured.channels[0].observations,
        &declared.channels[0].observations,
    );
    // A response is known up to a factor.
    let scale = a.dot(b) / a.norm_squared();
    let off = (a * scale - b).norm() / b.norm();
    assert!(off < 0.01, "{off}");
    let wrong = read_as("\"linear\"");
    let found = wrong.gates.iter().find(|gate| gate.fails()).unwrap();
    let accused = "the camera's gamma is not the declared one";
    assert!(found.what.contains(accused), "{found}");
    assert!(found.what.contains("raised to the power 2."), "{found}");
}

/// A default capture with every photograph taken at each of `times`.
fn bracketed(times: &[f64]) -> tempfile::TempDir {
    let times = times.to_vec();
    let scene = TestCapture {
        times,
        ..TestCapture::default()
    };
    scene.folder()
}

#[test]
fn a_bracket_sees_what_its_longest_exposure_clips() {
    // Light is .5 + .13 under white at most: at four times the exposure it clips.
    let folder = bracketed(&[1.0, 4.0]);
    let measured = read(folder.path(), &CaptureOptions::default(), &Silent).unwrap();
    assert!(measured.live.iter().all(|&live| live));
    assert_eq!(measured.diagnostics.photographs, 2 * 44);
    assert_eq!(measured.channels[0].patterns.ncols(), 43);
    assert!(measured.repeats.iter().all(|&repeats| repeats == 1));
    let single = TestCapture::default().read();
    let (a, b) = (
        &measured.channels[0].observations,
        &single.channels[0].observations,
    );
    // In units of the full scale at the longest exposure: four times as much.
    let off = (a * 0.25 - b).norm() / b.norm();
    assert!(off < 0.01, "{off}");
    let long_alone = read(
        bracketed(&[4.0]).path(),
        &CaptureOptions::default(),
        &Silent,
    );
    assert!(long_alone.is_err());
}

#[test]
fn a_bernoulli_pattern_shown_twice_is_one_view_with_less_noise() {
    let folder = tempfile::tempdir().unwrap();
    let mut manifest = TestCapture::default().write(folder.path());
    let last = manifest.shots.last().unwrap().clone();
    manifest.shots.push(Shot {
        index: last.index + 1,
        ..last
    });
    // The copy of a photograph is no second one: its noise is added anew.
    let path = folder.path().join(&manifest.shots[43].photo);
    let mut picture = image::open(&path).unwrap().into_luma16();
    let mut dice = Dice::new(77);
    for value in picture.pixels_mut() {
        value.0[0] = (f64::from(value.0[0]) + 200.0 * dice.normal()).clamp(0.0, 65_535.0) as u16;
    }
    picture.save(folder.path().join("photos/044.png")).unwrap();
    manifest.shots[44].photo = "photos/044.png".into();
    fs::write(folder.path().join(MANIFEST_FILE), manifest.to_csv()).unwrap();
    let measured = read(folder.path(), &CaptureOptions::default(), &Silent).unwrap();
    assert_eq!(measured.channels[0].patterns.ncols(), 43);
    assert_eq!(measured.repeats[42], 2);
    assert_eq!(measured.diagnostics.bernoulli, 30);
}
