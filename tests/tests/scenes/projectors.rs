//! Several projectors in one scene, their frames side by side.

use iltm::capture::{CaptureOptions, GateName, Verdict, listed, read_several};
use iltm::compile::{Provenance, split_table};
use iltm::picture::{FramePart, Picture, Response, Samples, png};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::fill_capture::{FillCaptureError, UnfilledCapture};
use iltm::scene::{Effect, Forced, Pinhole, VirtualCamera};
use iltm_runtime::image::Table;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::overlapping::{
    Screen, compensated, learned_alone, learned_together, learned_with_even_black, photograph_each,
    with_smaller,
};
use iltm_tests::simulated::{
    error_on_the_wall, inputs, inputs_of_each_alone, learned, photograph, scene, showable,
    simulation,
};
use nalgebra::{DMatrix, Vector3};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

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
    let parts = scene.parts();
    assert_eq!(parts, FramePart::side_by_side([[12, 16]; 2]));
    // Each projector as a scene of its own, with its half of the frame.
    let projectors = scene.projectors.iter().zip(&parts);
    let halves: Vec<_> = projectors
        .map(|(projector, part)| {
            let alone = Scene {
                projectors: vec![projector.clone()],
                ..scene.clone()
            };
            let half = DMatrix::from_fn(12 * 16, 1, |cell, _| frame[(part.place(32, cell), 0)]);
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

/// Columns of cells of the second of two projectors, which are fewer than the first one's.
const OF_SECOND: usize = 12;

/// Rows of it.
const ROWS_OF_SECOND: usize = 9;
/// Codes of black and of another slide, of all cells or pixels.
type Codes<'c> = &'c dyn Fn(usize, usize) -> u8;

/// Two walls whose projectors have other numbers of cells and other responses, glow in black and meet a
/// camera without noise.
fn unlike() -> Scene {
    let mut scene = two_walls();
    scene.projectors[1].grid = Grid::new(ROWS_OF_SECOND as u16, OF_SECOND as u16).unwrap();
    scene.projectors[1].response = Response::Gamma(1.5);
    for projector in &mut scene.projectors {
        projector.black = 0.02;
    }
    scene
}

/// Makes a folder that calls for two photographs: of black and of `codes`, by column and row.
fn folder(place: &Path, (width, height): (usize, usize), pixels: bool, codes: Codes<'_>) {
    let size = FrameSize::new(width as u16, height as u16).unwrap();
    fs::create_dir_all(place.join("patterns")).unwrap();
    let mut lines = "index,role,pattern,photo\n".to_owned();
    for (index, role) in ["black", "bernoulli"].into_iter().enumerate() {
        let slide = Picture::of_codes(size, 1, |at, _| match index {
            0 => 0,
            _ => codes(at % width, at / width),
        });
        fs::write(
            place.join(format!("patterns/{index}.png")),
            png::encode(&slide),
        )
        .unwrap();
        let line = format!("{index},{role},patterns/{index}.png,photos/{index}.png\n");
        lines.push_str(&line);
    }
    fs::write(place.join("capture.csv"), lines).unwrap();
    let settings = if pixels {
        format!("[projector]\nsize = [{width}, {height}]\n")
    } else {
        String::new()
    };
    fs::write(place.join("capture.toml"), settings).unwrap();
}

/// The two photographs of a folder, 0 to 1, without noise.
fn taken(scene: &Scene, folder: &Path, projector: Option<usize>) -> [Vec<f64>; 2] {
    let still = [Effect::Noise, Effect::Quantisation];
    let quiet = still.into_iter().fold(Forced::default(), |forced, effect| {
        forced.with(effect, false)
    });
    let simulation = simulation(scene, quiet);
    let camera = VirtualCamera::new(scene, &simulation, 1).unwrap();
    let session = UnfilledCapture::read(folder, scene, projector).unwrap();
    assert_eq!(session.take_missing(&camera, &Silent).unwrap(), 2);
    let mut shots = listed(folder).unwrap().into_iter();
    [0, 1].map(|_| {
        let (_, shot) = shots.next().unwrap();
        let picture = png::read(File::open(folder.join(shot.photo)).unwrap()).unwrap();
        let Samples::Sixteen(values) = picture.samples() else {
            panic!("16 bits");
        };
        let light = values.iter().map(|value| f64::from(*value) / 65_535.0);
        light.collect()
    })
}

#[test]
fn photographs_of_each_projector_while_the_other_shows_black_add_up_to_those_of_both() {
    let scene = unlike();
    // One pixel a cell, and slides of the projectors' own pixels.
    for side in [1, 5] {
        let (first, all) = (16 * side, (16 + OF_SECOND) * side);
        let mut random = fastrand::Rng::with_seed(5);
        let frame: Vec<u8> = (0..all * 12 * side).map(|_| random.u8(..)).collect();
        let code = |col: usize, row: usize| frame[row * all + col];
        let place = tempfile::tempdir().unwrap();
        let take = |name: &str, (width, rows), projector, codes: Codes<'_>| {
            let place = place.path().join(name);
            folder(&place, (width, rows * side), side > 1, codes);
            taken(&scene, &place, projector)
        };
        let [black, both] = take("both", (all, 12), None, &code);
        let [dark, left] = take("left", (first, 12), Some(0), &code);
        let right = (all - first, ROWS_OF_SECOND);
        let [_, right] = take("right", right, Some(1), &|col, row| code(first + col, row));
        // The others are on and show black.
        assert!(black.iter().zip(&dark).all(|(a, b)| (a - b).abs() < 1e-4));
        assert!(black.iter().sum::<f64>() > 0.005 * black.len() as f64);
        let sums = left.iter().zip(&right).zip(&black);
        let off = sums
            .zip(&both)
            .map(|(((left, right), black), both)| (left + right - black - both).abs());
        let off = off.fold(0.0, f64::max);
        println!("{side} pixels a cell: off by {off:.5} at most");
        // Bounces are followed until little is left, and photographs have 16 bits.
        assert!(off < 3e-4, "{side}: {off}");
        let share = |one: &[f64]| one.iter().sum::<f64>() / both.iter().sum::<f64>();
        assert!(share(&left) < 0.8 && share(&right) < 0.8);
    }
}

#[test]
fn slides_that_do_not_fit_the_projector_they_are_for_are_refused() {
    let scene = unlike();
    let place = tempfile::tempdir().unwrap();
    let refused = |name: &str, size: (usize, usize), pixels, projector| {
        let place = place.path().join(name);
        folder(&place, size, pixels, &|_, _| 0);
        let error = UnfilledCapture::read(&place, &scene, projector).unwrap_err();
        assert!(matches!(error, FillCaptureError::Pattern { .. }), "{error}");
        error.to_string()
    };
    // Slides of all for one of them, and of one of them for all.
    let said = refused("a", (28, 12), false, Some(0));
    assert!(said.contains("projector `1` has 12 x 16"), "{said}");
    let said = refused("b", (16, 12), false, None);
    assert!(said.contains("side by side, have 12 x 28"), "{said}");
    // 62 pixels over 16 columns would be 108.5 over all 28.
    let said = refused("c", (62, 48), true, Some(0));
    assert!(
        said.contains("62 x 48 pixels, over 12 x 16 cells"),
        "{said}"
    );
    // 46 pixels over 9 rows would be 61.3 over all 12.
    let said = refused("d", (48, 46), true, Some(1));
    assert!(said.contains("48 x 46 pixels, over 9 x 12 cells"), "{said}");
}

#[test]
fn projectors_are_called_by_name_or_number() {
    let named = [(
        "[[projector]]\nposition = [2.2,",
        "[[projector]]\nname = \"left\"\nposition = [2.2,",
    )];
    let scene = scene("two-walls", &named);
    assert_eq!(scene.projector_names(), ["left", "2"]);
    let called = ["left", "1", "2", "0", "3", "right", ""].map(|name| scene.projector_called(name));
    assert_eq!(called, [Some(0), Some(0), Some(1), None, None, None, None]);
}

#[test]
fn pictures_of_the_folded_screen_overlap_by_a_fifth_of_their_width() {
    let scene = scene("folded-screen", &[]);
    assert_eq!(scene.projector_names(), ["left", "right"]);
    let [left, right] = [0, 1].map(|index| &scene.projectors[index].view);
    // Where the left picture ends on the right half, and where the right one begins on the left.
    let half = scene.panels[1].facets[0].polygon.corners();
    let along = (half[1] - half[0]).normalize();
    let middle = 0.5 * (half[0] + half[3]);
    let across = |metres: f64| left.place(&(middle + metres * along)).unwrap().across;
    let mut reach = (0.0, 1.0);
    for _ in 0..50 {
        let metres = 0.5 * (reach.0 + reach.1);
        if across(metres) < 1.0 {
            reach.0 = metres;
        } else {
            reach.1 = metres;
        }
    }
    let mut begins = middle + reach.0 * along;
    begins.x = -begins.x;
    assert!(right.place(&begins).unwrap().across.abs() < 1e-3);
    let overlap = 1.0 - left.place(&begins).unwrap().across;
    println!("{overlap:.3} of a width, {:.1} cells", 24.0 * overlap);
    assert!((overlap - 0.2).abs() < 0.01, "{overlap}");
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

/// Where the pictures overlap, the wall is twice as bright by the tables of each.
#[test]
fn projectors_that_overlap_share_the_light_and_cancel_what_crosses() {
    let scene = scene("folded-screen", &[]);
    let place = tempfile::tempdir().unwrap();
    let captures = photograph_each(&scene, 40, place.path());
    let together = learned_together(&captures);
    let table = Table::check(&together.compiled.image).unwrap();
    let provenance = Provenance::read(table.provenance());
    assert!(provenance.overlapping);
    // Without it the overlap is lit twice.
    let brightness = provenance.brightness.unwrap();
    assert!(
        brightness.least < 0.6 && brightness.mean < 1.0,
        "{brightness:?}"
    );
    let screen = Screen::new(&scene);
    let seen = screen.seen(&together);
    assert!(seen.whole < 0.006, "{seen:?}");
    let within = |figure: Option<f64>, least: f64, most: f64| {
        figure.is_some_and(|figure| (least..most).contains(&figure))
    };
    assert!(within(seen.overlap, 0.0, 0.016), "{seen:?}");
    assert!(within(seen.step, 0.0, 0.02), "{seen:?}");
    let alone = learned_alone(&captures, together.white.light);
    let alone = screen.seen_of_each(&alone);
    assert!(within(alone.overlap, 0.5, 1.0), "{alone:?}");
    assert!(within(alone.step, 0.2, 1.0), "{alone:?}");
    // The black of both projectors lies over the overlap, unless black is raised to it elsewhere.
    assert!(within(seen.step_of_black, 0.2, 0.6), "{seen:?}");
    let even = screen.seen(&learned_with_even_black(&captures));
    assert!(within(even.step_of_black, 0.0, 0.15), "{even:?}");
    assert!(within(even.step, 0.0, 0.02), "{even:?}");
    assert!(within(even.overlap, 0.0, 0.016), "{even:?}");
}

/// The wide frame has cells of no projector below the lower frame.
#[test]
fn projectors_of_other_sizes_share_the_light_and_cancel_what_crosses() {
    let scene = with_smaller();
    let place = tempfile::tempdir().unwrap();
    let together = learned_together(&photograph_each(&scene, 40, place.path()));
    assert_eq!(together.report.cells, 15 * 24 + 12 * 16);
    assert_eq!(together.report.live_cells, together.report.cells);
    let screen = Screen::new(&scene);
    let seen = screen.seen(&together);
    assert!(seen.whole < 0.006, "{seen:?}");
    assert!(
        seen.overlap.is_some_and(|overlap| overlap < 0.016),
        "{seen:?}"
    );
    assert!(seen.step.is_some_and(|step| step < 0.02), "{seen:?}");
    let three = split_table(&together.compiled.image, Some(3), 4).unwrap_err();
    let words = three.to_string();
    assert_eq!(words, "the table is for 2 projectors, not 3");
    let devices = screen.seen_of_devices(&together, 4, true);
    assert!(devices.whole < 0.007, "{devices:?}");
    let silent = screen.seen_of_devices(&together, 4, false);
    assert!(silent.whole > 0.03, "{silent:?}");
    // What a wide frame has below the lower one is shown by nobody, and changes nothing.
    let size = FrameSize::new(40 * 20, 15 * 20).unwrap();
    let below = scene.parts_of(size).unwrap()[1].rows;
    let shown = |code: u16| {
        let codes = (0..size.pixels()).map(|pixel| match pixel / size.width() {
            row if row >= below && pixel % size.width() >= 24 * 20 => code,
            _ => 40_000,
        });
        let frame = Picture::new(size, Samples::Sixteen(codes.collect())).unwrap();
        let Samples::Sixteen(codes) = compensated(&together, frame).samples().clone() else {
            panic!("16 bits");
        };
        codes
    };
    let (dark, bright) = (shown(0), shown(u16::MAX));
    for part in scene.parts_of(size).unwrap() {
        let off = part
            .places(size.width())
            .map(|pixel| dark[pixel].abs_diff(bright[pixel]));
        assert!(off.max().unwrap() < 257, "a code of 8 bits");
        // Nor do gains fade towards it.
        let last = part
            .places(size.width())
            .map(|pixel| dark[pixel])
            .last()
            .unwrap();
        let above = part.place(size.width(), (part.rows - 8) * part.columns.len() - 1);
        assert!(last > dark[above] - 257 * 4, "{last} below {}", dark[above]);
    }
}

#[test]
fn captures_that_cannot_be_of_one_frame_are_refused_by_name() {
    let scene = two_walls();
    let place = tempfile::tempdir().unwrap();
    let captures = photograph_each(&scene, 10, place.path());
    let options = CaptureOptions::default();
    let refused = |captures: &[PathBuf]| {
        let error = read_several(captures, &options, &Silent).unwrap_err();
        (error.to_string(), error.next_step())
    };
    let (words, next) = refused(&[captures[0].clone(), captures[0].clone()]);
    assert!(words.contains("given twice"), "{words}");
    assert!(next.contains("once"), "{next}");
    // Cells that have other pixels, or pixels that nobody knows.
    let other = place.path().join("other");
    fs::create_dir(&other).unwrap();
    let stated = |capture: &Path, from: &str, to: &str| {
        let file = capture.join("capture.toml");
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(file, text.replace(from, to)).unwrap();
    };
    let others = photograph_each(&single(&scene, 1), 10, &other);
    for (size, expected) in [
        (
            "size = [320, 228]",
            "20 x 19 pixels, those of the first 20 x 20",
        ),
        (
            "size = [336, 240]",
            "21 x 20 pixels, those of the first 20 x 20",
        ),
        ("", "the size is known of some projectors"),
    ] {
        let text = fs::read_to_string(others[0].join("capture.toml")).unwrap();
        stated(&others[0], "size = [320, 240]", size);
        let (words, next) = refused(&[captures[0].clone(), others[0].clone()]);
        assert!(words.contains(expected), "{words}");
        assert!(next.contains("--rows"), "{next}");
        fs::write(others[0].join("capture.toml"), text).unwrap();
    }
    let mut nearer = single(&scene, 1);
    nearer.camera.size = (150, 100);
    let others = photograph_each(&nearer, 10, &place.path().join("other/nearer"));
    let (words, next) = refused(&[captures[0].clone(), others[0].clone()]);
    assert!(words.contains("other photographs than in"), "{words}");
    assert!(next.contains("one camera"), "{next}");
}

/// Every fault is looked for in one capture of the right wall, beside a good one of the left.
#[test]
fn captures_between_which_something_changed_are_refused_or_said_by_name() {
    let mut scene = two_walls();
    for projector in &mut scene.projectors {
        projector.black = 0.003;
    }
    let place = tempfile::tempdir().unwrap();
    let captures = photograph_each(&scene, 10, &place.path().join("good"));
    let right = |name: &str, scene: &Scene| {
        let folder = place.path().join(name);
        photograph_each(scene, 10, &folder)[1].clone()
    };
    let read = |right: &PathBuf, ignore: &[GateName]| {
        let options = CaptureOptions {
            ignore: ignore.to_vec(),
            ..CaptureOptions::default()
        };
        read_several(&[captures[0].clone(), right.clone()], &options, &Silent)
    };
    // Those between captures come last.
    let said = |right: &PathBuf| {
        let several = read(right, &[]).unwrap();
        let gates = several.all.diagnostics.gates;
        let between = gates[gates.len() - 3..].iter();
        let what = between.map(|gate| (gate.name, gate.verdict, gate.what.clone()));
        what.collect::<Vec<_>>()
    };
    let good = said(&captures[1]);
    println!("{good:?}");
    assert!(good.iter().all(|(_, verdict, _)| *verdict == Verdict::Pass));

    let mut bumped = scene.clone();
    // The scene's camera looks six centimetres beside the corner.
    let (position, target) = (scene.camera.view.position(), Vector3::new(0.06, 1.15, 0.0));
    let aspect = 160.0 / 100.0;
    bumped.camera.view = Pinhole::new(position, target, Vector3::y(), 72.0, aspect).unwrap();
    let bumped = right("bumped", &bumped);
    let error = read(&bumped, &[]).unwrap_err().to_string();
    println!("{error}");
    assert!(error.contains("gate movement") && error.contains("the camera moved by at least"));
    assert!(error.contains(&bumped.display().to_string()));
    assert!(read(&bumped, &[GateName::Movement]).is_ok());

    let mut lamp = scene.clone();
    lamp.ambient = [0.002; 3];
    let lamp = said(&right("lamp", &lamp));
    println!("{lamp:?}");
    assert!(lamp[1].0 == GateName::Drift && lamp[1].1 == Verdict::Warn);
    assert!(lamp[1].2.contains("exposure"), "{lamp:?}");

    let mut dark = scene.clone();
    for projector in &mut dark.projectors {
        projector.black = 0.0;
    }
    let dark = said(&right("dark", &dark));
    println!("{dark:?}");
    assert!(dark[0].0 == GateName::Movement && dark[0].1 == Verdict::Warn);
    assert!(dark[0].2.contains("is not known"), "{dark:?}");
    assert!(dark[1].1 == Verdict::Warn, "{dark:?}");

    // The ramps tell it.
    let mut mode = scene.clone();
    for projector in &mut mode.projectors {
        projector.response = Response::Gamma(2.8);
    }
    let error = read(&right("mode", &mode), &[]).unwrap_err();
    println!("{error}");
    assert!(error.to_string().contains("another response"), "{error}");
    assert!(error.next_step().contains("gamma"));

    // The cables were not changed, or both displays show the left one's slides.
    let mut mirrored = scene.clone();
    mirrored.projectors.swap(0, 1);
    let mirrored = right("mirrored", &mirrored);
    let error = read(&mirrored, &[]).unwrap_err();
    println!("{error}");
    assert!(error.to_string().contains("show one picture"), "{error}");
    assert!(error.next_step().contains("cables"));
}

/// One projector of a scene alone.
fn single(scene: &Scene, projector: usize) -> Scene {
    Scene {
        projectors: vec![scene.projectors[projector].clone()],
        ..scene.clone()
    }
}
