//! Frames in their place and the brightness of white, against the light of a simulated
//! scene. Which pixels light which cell is taken from the slides that were photographed, not
//! from the rule by which frames are placed.

use iltm::build_table::BuiltTable;
use iltm::capture::SETTINGS_FILE;
use iltm::compile::Provenance;
use iltm::picture::{LightPicture, Picture, Response, Samples};
use iltm::scene::description::Scene;
use iltm::scene::{Effect, Forced, Simulation};
use iltm::session::Layout;
use iltm::video::{CompensateOptions, Compensator};
use iltm_runtime::FrameSize;
use iltm_runtime::image::Table;
use iltm_tests::simulated::{self, cell_means, error, photograph, simulation};
use nalgebra::DMatrix;
use std::path::Path;

const PROJECTOR: (u16, u16) = (320, 200);
const BORDER: u16 = 24;

/// A table of a projector with a border, and what was learned.
fn learned(scene: &Scene, place: &Path) -> BuiltTable {
    let capture = place.join("capture");
    photograph(scene, 100, 3, &capture);
    let file = capture.join(SETTINGS_FILE);
    let text = std::fs::read_to_string(&file).unwrap();
    let (width, height) = PROJECTOR;
    let pixels = format!("[projector]\nsize = [{width}, {height}]\nborder = {BORDER}");
    assert!(text.contains("[projector]"), "{text}");
    std::fs::write(file, text.replace("[projector]", &pixels)).unwrap();
    simulated::learned(&capture)
}

/// The cell that each pixel of a slide lights.
fn cells_of_pixels(layout: &Layout) -> Vec<Option<usize>> {
    let cells = FrameSize::of_grid(layout.grid());
    // One slide has the rows, the other the columns, counted from 1: 0 is the border.
    let codes = |code: fn(usize, usize) -> usize| {
        let slide = layout.slide(&Picture::from_fn(cells, |x, y| [code(x, y) as u8 + 1]));
        match slide.unwrap().samples() {
            Samples::Eight(codes) => codes.clone(),
            Samples::Sixteen(_) => panic!("8 bits"),
        }
    };
    let (rows, cols) = (codes(|_, y| y), codes(|x, _| x));
    let pixel = |(row, col): (&u8, &u8)| {
        let row = usize::from(*row).checked_sub(1)?;
        Some(row * cells.width() + usize::from(*col).checked_sub(1)?)
    };
    rows.iter().zip(&cols).map(pixel).collect()
}

/// Light of every cell while the projector shows these frames, seen by the camera.
fn on_the_wall(
    learned: &BuiltTable,
    simulation: &Simulation<'_>,
    layout: &Layout,
    frames: &[Picture],
) -> Vec<Vec<f64>> {
    let cells = layout.grid().cells();
    let owners = cells_of_pixels(layout);
    let projector = &learned.measurements.devices.projector;
    let mut inputs = DMatrix::zeros(cells, frames.len());
    for (at, frame) in frames.iter().enumerate() {
        let drive = LightPicture::decode(frame, projector.clone());
        let mut counts = vec![0.0; cells];
        for (light, owner) in drive.planes()[0].iter().zip(&owners) {
            if let Some(cell) = *owner {
                inputs[(cell, at)] += f64::from(*light);
                counts[cell] += 1.0;
            }
        }
        for (cell, count) in counts.iter().enumerate() {
            inputs[(cell, at)] /= count;
        }
    }
    let exposed = simulation.expose(&inputs).unwrap();
    let means = (0..frames.len()).map(|at| {
        let plane = &simulation.photograph(&exposed, at)[0];
        cell_means(&learned.measurements.registration, plane, cells)
    });
    means.collect()
}

#[test]
fn a_frame_of_a_projector_with_a_border_is_compensated_where_its_cells_are() {
    let place = tempfile::tempdir().unwrap();
    let scene = simulated::scene("m-panels", &[]);
    let learned = learned(&scene, place.path());
    let table = Table::check(&learned.compiled.image).unwrap();
    let projector = FrameSize::new(PROJECTOR.0, PROJECTOR.1).unwrap();
    let layout = Layout::new(table.grid(), projector, BORDER).unwrap();
    let grid = FrameSize::of_grid(table.grid());
    let wave = |x: usize, y: usize| (x as f64 / 3.0).sin() * (y as f64 / 2.0).cos();
    let cells = Picture::from_fn(grid, |x, y| [(190.0 + 60.0 * wave(x, y)) as u8]);
    let wanted = layout.slide(&cells).unwrap();
    let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
    let (placed, totals) = compensator.frame(wanted.clone()).unwrap();
    assert_eq!(totals.size, projector);
    // What was done before: cells spread over all pixels of the projector.
    let mut spread = wanted.clone();
    compensator.picture(&mut spread).unwrap();
    let simulation = simulation(&scene, Forced::default().with(Effect::Noise, false));
    let seen = on_the_wall(&learned, &simulation, &layout, &[wanted, placed, spread]);
    let light = LightPicture::decode(&cells, Response::Srgb);
    let light: Vec<f64> = light.planes()[0]
        .iter()
        .map(|light| f64::from(*light))
        .collect();
    let live = &learned.measurements.live;
    let [plain, placed, spread] = [0, 1, 2].map(|at| error(&seen[at], &light, live));
    println!("as it is {plain:.4}, placed {placed:.4}, spread over all {spread:.4}");
    assert!(placed < 0.03 && placed < 0.2 * plain, "{placed} {plain}");
    assert!(spread > 3.0 * placed, "{spread} {placed}");
}

#[test]
fn white_is_as_bright_on_the_wall_as_the_table_says() {
    let place = tempfile::tempdir().unwrap();
    let scene = simulated::scene("m-panels", &[]);
    let learned = learned(&scene, place.path());
    let table = Table::check(&learned.compiled.image).unwrap();
    let said = Provenance::read(table.provenance()).brightness.unwrap();
    let projector = FrameSize::new(PROJECTOR.0, PROJECTOR.1).unwrap();
    let layout = Layout::new(table.grid(), projector, BORDER).unwrap();
    let white = layout.slide(&Picture::of_codes(
        FrameSize::of_grid(table.grid()),
        1,
        |_, _| 255,
    ));
    let white = white.unwrap();
    let compensator = Compensator::new(&table, CompensateOptions::default()).unwrap();
    let (made, totals) = compensator.frame(white.clone()).unwrap();
    let simulation = simulation(&scene, Forced::default().with(Effect::Noise, false));
    let seen = on_the_wall(&learned, &simulation, &layout, &[white, made]);
    let cells = || {
        let pairs = seen[0].iter().zip(&seen[1]).zip(&learned.measurements.live);
        pairs.filter(|(_, live)| **live).map(|(pair, _)| pair)
    };
    let sum = |of: fn((&f64, &f64)) -> f64| cells().map(of).sum::<f64>();
    let mean = sum(|(_, after)| *after) / sum(|(before, _)| *before);
    let brightest = cells().max_by(|a, b| a.0.total_cmp(b.0)).unwrap();
    let least = brightest.1 / brightest.0;
    println!("{said:?}, on the wall {mean:.3} and {least:.3}, {totals:?}");
    assert!((said.mean / mean - 1.0).abs() < 0.02, "{said:?} {mean}");
    assert!((said.least / least - 1.0).abs() < 0.04, "{said:?} {least}");
    // A number that says something: bounces make part of this scene's white.
    assert!(said.mean < 0.9 && said.least < 0.9 * said.mean, "{said:?}");
}
