//! Whole captures, read from folders.

use super::*;
use crate::test_capture::{TestCapture, save_pattern};
use iltm_picture::Response;
use iltm_picture::progress::Silent;
use std::fs;
use std::sync::Mutex;
use tempfile::TempDir;

/// A default capture in a folder, changed by `change`.
pub(crate) fn capture(change: impl FnOnce(&Path, &mut Manifest)) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut manifest = TestCapture::default().write(folder.path());
    change(folder.path(), &mut manifest);
    fs::write(folder.path().join(MANIFEST_FILE), manifest.to_csv()).unwrap();
    folder
}

pub(crate) fn read_default(folder: &Path) -> Result<Measurements, CaptureError> {
    read(folder, &CaptureOptions::default(), &Silent)
}

/// The worst of all kept pixels: its part in another cell relative to that in
/// its own, and its part in no cell at all.
fn impurity(scene: &TestCapture, registration: &Registration) -> (f64, f64) {
    let (width, _) = registration.camera;
    let (mut other, mut dark) = (0.0_f64, 0.0_f64);
    for (at, &cell) in registration.cell_of_pixel.iter().enumerate() {
        if cell == NO_CELL {
            continue;
        }
        let part = |cell: usize| {
            let (row, col) = (cell / scene.cols, cell % scene.cols);
            scene.overlap(at % width, col) * scene.overlap(at / width, row)
        };
        let own = part(cell as usize);
        let all: f64 = (0..scene.rows * scene.cols).map(part).sum();
        other = other.max((all - own) / own);
        dark = dark.max(1.0 - all);
    }
    (other, dark)
}

#[test]
fn observations_are_the_light_of_each_cells_pixels_up_to_the_cameras_noise() {
    let scene = TestCapture::default();
    let measured = scene.read();
    let channel = &measured.channels[0];
    assert_eq!(measured.roles[Measurements::WHITE], Role::White);
    assert_eq!(measured.channels[0].patterns.ncols(), 1 + 6 + 6 + 30);
    let mut chi = 0.0;
    let shown: Vec<_> = scene
        .patterns()
        .into_iter()
        .filter(|(role, _)| *role != Role::Black)
        .collect();
    for (view, (role, pattern)) in shown.iter().enumerate() {
        assert_eq!(measured.roles[view], *role);
        let lit: Vec<bool> = channel
            .patterns
            .column(view)
            .iter()
            .map(|&l| l > 0.5)
            .collect();
        assert_eq!(lit, pattern.lit);
        let light = scene.light(pattern);
        for cell in 0..30 {
            let of_cell = measured.registration.cell_of_pixel.iter().zip(&light);
            let seen: Vec<f64> = of_cell
                .filter(|(c, _)| **c == cell as u32)
                .map(|(_, l)| *l)
                .collect();
            assert_eq!(seen.len(), measured.pixels[cell] as usize);
            let truth = seen.iter().sum::<f64>() / seen.len() as f64 - scene.ambient;
            let found = channel.observations[(cell, view)];
            chi += ((found - truth) / channel.noise[cell]).powi(2) / (30.0 * 43.0);
        }
    }
    // 1290 samples, of which those of one cell share the noise of black.
    assert!((0.7..1.3).contains(&chi), "{chi}");
    assert!(
        channel
            .ambient
            .iter()
            .all(|a| (a - scene.ambient).abs() < 0.005)
    );
}

#[test]
fn observations_of_inner_cells_are_the_transport_times_the_pattern() {
    let scene = TestCapture::default();
    let measured = scene.read();
    for view in 0..measured.channels[0].patterns.ncols() {
        let lit = measured.channels[0].patterns.column(view);
        for cell in [7, 8, 9, 10, 13, 14, 15, 16, 19, 20, 21, 22] {
            let truth = scene.bounced * lit.sum() + (scene.direct - scene.bounced) * lit[cell];
            let found = measured.channels[0].observations[(cell, view)];
            // At most 0.15 of the outer pixels of a cell is another cell's.
            assert!(
                (found - truth).abs() < 0.04 * scene.direct,
                "{cell} {view}: {found} {truth}"
            );
        }
    }
}

#[test]
fn the_noise_of_the_camera_is_what_was_simulated() {
    let measured = TestCapture::default().read();
    let found = measured.channels[0].noise_model.variance(0.5).sqrt();
    assert!((found / 0.004 - 1.0).abs() < 0.15, "{found}");
    assert_eq!(measured.diagnostics.noise, NoiseSource::Pairs { pairs: 6 });
    let pixels = f64::from(measured.pixels[8]);
    let expected = 0.004 * (2.0 / pixels).sqrt();
    assert!((measured.channels[0].noise[8] / expected - 1.0).abs() < 0.2);
}

#[test]
fn kept_pixels_lie_inside_their_cells() {
    let scene = TestCapture::default();
    let measured = scene.read();
    let registration = &measured.registration;
    assert_eq!(registration.camera, scene.camera());
    assert!(measured.live.iter().all(|&live| live));
    assert!(matches!(
        measured.diagnostics.method,
        RegistrationMethod::Regression {
            photographs: 43,
            is_coded: true
        }
    ));
    // The limits are 0.15 and 0.45; the rest is the camera's noise.
    let (other, dark) = impurity(&scene, registration);
    assert!(other < 0.18 && dark < 0.48, "{other} {dark}");
    let kept = measured.diagnostics.pixels.kept as f64;
    // Of 6.3 x 6.3 pixels a cell at least the 5 x 5 that lie wholly inside.
    assert!(kept >= 30.0 * 25.0, "{kept}");
    for (cell, centre) in registration.centre.iter().enumerate() {
        let centre = centre.unwrap();
        for (axis, index) in [(0, cell % 6), (1, cell / 6)] {
            let truth = scene.margin + scene.pitch * (index as f64 + 0.5) - 0.5;
            assert!(
                (centre[axis] - truth).abs() < 0.6,
                "cell {cell}: {centre:?} {truth}"
            );
        }
    }
}

#[test]
fn a_border_blurred_over_many_pixels_is_left_out_like_a_sharp_one() {
    let scene = TestCapture {
        pitch: 24.3,
        blur: 4.0,
        bernoulli: 12,
        ..TestCapture::default()
    };
    let measured = scene.read();
    let (other, dark) = impurity(&scene, &measured.registration);
    // At a corner two borders may take 0.15 each: 1 / 0.85^2 - 1 = 0.38.
    assert!(other < 0.4 && dark < 0.48, "{other} {dark}");
    let kept = measured.diagnostics.pixels.kept;
    assert!(kept >= 30 * 20 * 20, "{kept}");
}

#[test]
fn with_too_few_photographs_the_gray_code_alone_leaves_borders_out() {
    let scene = TestCapture {
        bernoulli: 2,
        ..TestCapture::default()
    };
    let folder = scene.folder();
    let options = CaptureOptions {
        min_bernoulli: 0,
        ..CaptureOptions::default()
    };
    let measured = read(folder.path(), &options, &Silent).unwrap();
    let method = measured.diagnostics.method;
    assert_eq!(method, RegistrationMethod::GrayCode { photographs: 15 });
    assert!(measured.live.iter().all(|&live| live));
    let (other, dark) = impurity(&scene, &measured.registration);
    assert!(other < 0.01 && dark < 0.01, "{other} {dark}");
}

#[test]
fn a_missing_inverse_is_replaced_by_the_middle_of_white_and_black() {
    let folder = capture(|_, manifest| {
        let is_inverse = |role| {
            matches!(
                role,
                Role::Column { inverse: true, .. } | Role::Row { inverse: true, .. }
            )
        };
        manifest.shots.retain(|shot| !is_inverse(shot.role));
    });
    let measured = read_default(folder.path()).unwrap();
    assert!(measured.live.iter().all(|&live| live));
    assert_eq!(measured.diagnostics.superposition, None);
    assert_eq!(measured.diagnostics.noise, NoiseSource::Texture);
    let found = measured.channels[0].noise_model.variance(0.5).sqrt();
    assert!((found / 0.004 - 1.0).abs() < 0.5, "{found}");
}

#[test]
fn repeated_white_and_black_are_averaged() {
    let scene = TestCapture {
        repeats: 4,
        ..TestCapture::default()
    };
    let measured = scene.read();
    assert_eq!(measured.repeats[Measurements::WHITE], 4);
    assert_eq!(measured.channels[0].patterns.ncols(), 43);
    let ratio = measured.channels[0].noise[8] / TestCapture::default().read().channels[0].noise[8];
    assert!((ratio - 0.5).abs() < 0.1, "{ratio}");
}

#[test]
fn an_eight_bit_colour_capture_has_three_channels_in_proportion() {
    let scene = TestCapture {
        gains: vec![1.0, 0.5, 0.8],
        full_scale: 255,
        encode: |light| Response::Srgb.value(light),
        ..TestCapture::default()
    };
    let folder = scene.folder();
    fs::write(
        folder.path().join(SETTINGS_FILE),
        "[camera]\nresponse = \"srgb\"\n",
    )
    .unwrap();
    let measured = read_default(folder.path()).unwrap();
    assert_eq!(measured.channels.len(), 3);
    assert_eq!(measured.flood.len(), 3);
    let white = |channel: usize| measured.channels[channel].observations.column(0).sum();
    assert!((white(1) / white(0) - 0.5).abs() < 0.01);
    assert!((white(2) / white(0) - 0.8).abs() < 0.01);
    assert!(measured.diagnostics.superposition.unwrap().abs() < 0.01);
}

#[test]
fn the_first_bernoulli_photographs_are_used_and_no_more_than_there_are() {
    let folder = capture(|_, _| {});
    let with = |bernoulli| {
        let options = CaptureOptions {
            bernoulli: Some(bernoulli),
            ..CaptureOptions::default()
        };
        read(folder.path(), &options, &Silent)
    };
    let all = read_default(folder.path()).unwrap();
    let some = with(12).unwrap();
    assert_eq!(
        (some.diagnostics.bernoulli, some.diagnostics.bernoulli_taken),
        (12, 30)
    );
    assert_eq!(
        some.channels[0].patterns,
        all.channels[0].patterns.columns(0, 13 + 12).clone_owned()
    );
    let error = with(31).unwrap_err().to_string();
    assert!(
        error.contains("31 Bernoulli photographs asked for; the capture has 30"),
        "{error}"
    );
    let error = with(9).unwrap_err().to_string();
    assert!(
        error.contains("9 Bernoulli photographs and images used, a solve needs at least 10"),
        "{error}"
    );
}

#[test]
fn a_single_cell_with_a_highlight_is_left_out_and_reported() {
    let scene = TestCapture {
        albedo: |row, col| {
            if (2.0..3.0).contains(&row) && (1.0..2.0).contains(&col) {
                2.0
            } else {
                1.0
            }
        },
        ..TestCapture::default()
    };
    let measured = scene.read();
    let [out] = measured.diagnostics.left_out[..] else {
        panic!("{:?}", measured.diagnostics.left_out);
    };
    assert_eq!(out.cell, 2 * 6 + 1);
    assert!(matches!(out.why, Why::Saturated { saturated, pixels } if saturated * 2 > pixels));
    assert!(!measured.live[out.cell]);
    assert_eq!(measured.pixels[out.cell], 0);
    assert!(
        measured.channels[0]
            .observations
            .row(out.cell)
            .iter()
            .all(|&c| c == 0.0)
    );
}

#[test]
fn cells_that_the_camera_does_not_see_are_left_out_and_reported() {
    let scene = TestCapture {
        albedo: |_, col| if col >= 5.0 { 0.0 } else { 1.0 },
        ..TestCapture::default()
    };
    let measured = scene.read();
    let left_out: Vec<usize> = measured
        .diagnostics
        .left_out
        .iter()
        .map(|out| out.cell)
        .collect();
    assert_eq!(left_out, [5, 11, 17, 23, 29]);
    assert!(
        measured
            .live
            .iter()
            .enumerate()
            .all(|(cell, live)| *live == (cell % 6 != 5))
    );
}

#[test]
fn the_fine_flood_follows_the_albedo_inside_a_cell_and_keeps_each_cells_mean() {
    let scene = TestCapture {
        pitch: 12.3,
        noise: 0.001,
        albedo: |_, col| 0.6 + 0.1 * col,
        ..TestCapture::default()
    };
    let measured = scene.read();
    let fine = FineFlood::new(&measured, None);
    let factor = fine.factor[0];
    assert_eq!(fine.factor, [factor; 2]);
    assert_eq!((fine.rows, fine.cols), (5 * factor, 6 * factor));
    assert!((4..=6).contains(&factor), "{factor}");
    let plane = &fine.channels[0];
    for cell in 0..30 {
        let (row, col) = (cell / 6 * factor, cell % 6 * factor);
        let inside = |k: usize| plane[(row + k / factor) * fine.cols + col + k % factor];
        let samples = factor * factor;
        let mean = (0..samples).map(|k| f64::from(inside(k))).sum::<f64>() / samples as f64;
        let observed = measured.channels[0].observations[(cell, 0)];
        assert!(
            (mean / observed - 1.0).abs() < 1e-5,
            "cell {cell}: {mean} {observed}"
        );
    }
    let light = scene.direct + 29.0 * scene.bounced;
    for (at, &sample) in plane.iter().enumerate() {
        let place = ((at % fine.cols) as f64 + 0.5) / factor as f64;
        let truth = light * (0.6 + 0.1 * place);
        let (row, col) = (at / fine.cols / factor, at % fine.cols / factor);
        // Cells at the border are measured with pixels that are up to 0.45 dark.
        let border = row == 0 || row == 4 || col == 0 || col == 5;
        let limit = if border { 0.09 } else { 0.02 };
        let error = f64::from(sample) / truth - 1.0;
        assert!(error.abs() < limit, "{at}: {sample} {truth}");
    }
}

#[test]
fn patterns_with_their_inverses_show_white_too() {
    // Noise is as large in the dark, so that black counts: there are as many photographs of it.
    let scene = |repeats: usize| TestCapture {
        pitch: 12.3,
        noise: 0.01,
        repeats,
        ..TestCapture::default()
    };
    let scatter = |measured: &Measurements| {
        let cells = &measured.registration.cell_of_pixel;
        let light: Vec<f32> = (cells.iter().zip(&measured.flood[0]))
            .filter(|(cell, _)| **cell == 14)
            .map(|(_, light)| *light)
            .collect();
        let mean = light.iter().sum::<f32>() / light.len() as f32;
        let square = light.iter().map(|light| (light - mean).powi(2));
        f64::from((square.sum::<f32>() / light.len() as f32).sqrt())
    };
    let alone = scene(1).read();
    // White and black, of one photograph each.
    assert!(scatter(&alone) < 1.2 * 0.01 * 2.0_f64.sqrt());
    let two = scene(2).read();
    assert!(two.flood_photographs >= 2);
    assert!(scatter(&two) < 1.2 * 0.01, "{}", scatter(&two));
}

#[test]
fn a_subdivision_of_one_is_the_flood_observation_itself() {
    let measured = TestCapture::default().read();
    let fine = FineFlood::with_factor(&measured, [0, 0]);
    assert_eq!((fine.rows, fine.cols, fine.factor), (5, 6, [1, 1]));
    for (fine, observed) in fine.channels[0]
        .iter()
        .zip(&measured.channels[0].observations.column(0))
    {
        assert!((f64::from(*fine) - observed).abs() < 1e-6);
    }
}

#[test]
fn every_step_that_begins_also_ends_and_reaches_its_total() {
    #[derive(Default)]
    struct Log(Mutex<Vec<(String, u64, u64)>>);
    impl Progress for Log {
        fn begin(&self, what: &str, total: u64) {
            self.0.lock().unwrap().push((what.to_owned(), total, 0));
        }
        fn advance(&self, parts: u64) {
            self.0.lock().unwrap().last_mut().unwrap().2 += parts;
        }
        fn end(&self) {
            let steps = self.0.lock().unwrap();
            let (what, total, done) = steps.last().unwrap();
            assert!(*total == 0 || done == total, "{what}: {done} of {total}");
        }
    }
    let log = Log::default();
    read(capture(|_, _| {}).path(), &CaptureOptions::default(), &log).unwrap();
    assert_eq!(log.0.into_inner().unwrap().len(), 6);
}

/// The share of registered pixels that lie in another cell than `cell_of` says for the
/// cell that really lights them most.
fn misplaced(
    capture: &TestCapture,
    measured: &Measurements,
    cell_of: impl Fn(usize, usize) -> usize,
) -> f64 {
    let (width, _) = capture.camera();
    let index = |at: usize, cells: usize| {
        (0..cells).max_by(|a, b| capture.overlap(at, *a).total_cmp(&capture.overlap(at, *b)))
    };
    let found = || {
        let cells = measured.registration.cell_of_pixel.iter().enumerate();
        cells.filter(|(_, cell)| **cell != NO_CELL)
    };
    let wrong = |(pixel, cell): &(usize, &u32)| {
        let row = index(pixel / width, capture.rows).unwrap();
        let col = index(pixel % width, capture.cols).unwrap();
        **cell as usize != cell_of(row, col)
    };
    found().filter(wrong).count() as f64 / found().count() as f64
}

#[test]
fn a_gray_code_that_others_centred_is_registered() {
    let capture = TestCapture {
        offset: [1, 2],
        ..TestCapture::default()
    };
    let measured = capture.read();
    assert!(measured.live.iter().all(|live| *live));
    assert!(misplaced(&capture, &measured, |row, col| row * 6 + col) < 1e-9);
}

#[test]
fn stripes_without_the_finest_bits_tell_blocks_of_cells() {
    let capture = TestCapture {
        rows: 8,
        cols: 12,
        bounced: 0.002,
        bernoulli: 0,
        ..TestCapture::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let mut manifest = capture.write(folder.path());
    let finest =
        |role: Role| matches!(role, Role::Column { bit: 3, .. } | Role::Row { bit: 2, .. });
    manifest.shots.retain(|shot| !finest(shot.role));
    std::fs::write(folder.path().join(MANIFEST_FILE), manifest.to_csv()).unwrap();
    let options = CaptureOptions {
        min_bernoulli: 0,
        ..CaptureOptions::default()
    };
    let refused = examine(folder.path(), &options, &Silent).unwrap_err();
    assert!(
        matches!(refused, CaptureError::GrayCode { .. }),
        "{refused}"
    );
    let options = CaptureOptions {
        coarsen: true,
        ..options
    };
    let examined = examine(folder.path(), &options, &Silent).unwrap();
    let coverage = examined
        .gates
        .iter()
        .find(|gate| gate.name == GateName::Coverage);
    let what = &coverage.unwrap().what;
    assert!(what.contains("4 x 6 blocks of 2 x 2 pixels"), "{what}");
    let measured = examined.measurements.unwrap();
    assert!(measured.live.iter().all(|live| *live));
    assert!(misplaced(&capture, &measured, |row, col| row / 2 * 6 + col / 2) < 1e-9);
}

#[test]
fn patterns_of_more_cells_than_a_table_has_are_looked_at_in_blocks() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, cols) = (192, 256);
    assert!(rows * cols > iltm_runtime::Grid::MAX_CELLS);
    fs::create_dir(folder.path().join("patterns")).unwrap();
    let mut roles = vec![Role::White, Role::Black];
    let stripes = |bit| [CodeAxis::Column, CodeAxis::Row].map(|axis| axis.stripe(bit, false));
    roles.extend((0..8).flat_map(stripes));
    let codes = [Code { bits: 8, offset: 0 }; 2];
    let shots = Manifest::numbered("patterns", (0..).zip(roles)).shots;
    for shot in &shots {
        let pattern = Pattern::of_codes((rows, cols), shot.role, codes).unwrap();
        save_pattern(&pattern, &folder.path().join(&shot.pattern));
    }
    let read = |coarsen| {
        let options = CaptureOptions {
            min_bernoulli: 0,
            coarsen,
            ..CaptureOptions::default()
        };
        Sequence::read(
            folder.path(),
            Selection::new(folder.path(), &shots, &options)?,
        )
    };
    assert!(matches!(read(false), Err(CaptureError::TooLarge { .. })));
    let sequence = read(true).unwrap();
    assert_eq!((sequence.grid.rows(), sequence.grid.cols()), (96, 128));
    assert_eq!(sequence.coarser, 1);
    // White, and seven bits of either axis.
    assert_eq!(sequence.views.len(), 15);
}
