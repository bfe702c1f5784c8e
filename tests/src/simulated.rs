//! Simulated photographs: captures of the scenes that come with the tools, tables learned
//! from them, and the errors that are on the wall then.

use iltm::build_table::{BuiltTable, TableOptions, build_table};
use iltm::capture::{
    self, CameraSettings, CaptureOptions, Measurements, NO_CELL, Registration, pattern_set,
};
use iltm::compile::reference_white::uniform_white;
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::fill_capture::UnfilledCapture;
use iltm::scene::{Effect, Forced, Simulation, SimulationOptions, VirtualCamera, folder};
use iltm::session::{self, Layout, OrderOptions, order};
use iltm::solve::{InverseTransport, Method, SolveOptions, natural_images};
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};

/// The folder of the tools, with `scenes` and `samples`.
pub fn host_tools() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-tools")
}

/// The scenes that come with the tools.
pub fn scene_names() -> Vec<String> {
    let files = std::fs::read_dir(host_tools().join("scenes")).expect("part of the repository");
    let paths = files.map(|file| file.expect("readable").path());
    let scenes = paths.filter(|path| path.extension().is_some_and(|it| it == "toml"));
    let names = scenes.filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()));
    let mut names: Vec<_> = names.collect();
    names.sort();
    names
}

/// Whether pictures of projectors overlap in a scene that comes with the tools. Frames side by side
/// cannot be registered there: two cells light one pixel.
pub fn overlaps(name: &str) -> bool {
    ["folded-screen", "dome-of-four"].contains(&name)
}

/// A scene that comes with the tools, with some words replaced.
pub fn scene(name: &str, replaced: &[(&str, &str)]) -> Scene {
    let path = host_tools().join(format!("scenes/{name}.toml"));
    let mut text = std::fs::read_to_string(&path).expect("part of the repository");
    for (from, to) in replaced {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Scene::parse(text.as_bytes(), &path).expect("a scene")
}

/// The light of a scene, with some effects on or off.
pub fn simulation(scene: &Scene, forced: Forced) -> Simulation<'_> {
    let options = SimulationOptions {
        forced,
        threshold: None,
    };
    Simulation::new(scene, &options, &Silent).expect("can be simulated")
}

/// Writes a capture with so many random patterns; patterns and noise follow from the seed.
pub fn photograph(scene: &Scene, bernoulli: usize, seed: u64, capture: &Path) {
    let simulation = simulation(scene, Forced::default());
    let patterns = pattern_set(simulation.grid(), bernoulli, seed);
    let camera = VirtualCamera::new(scene, &simulation, seed).expect("light");
    folder::write(&camera, None, &patterns, capture, &Silent).expect("written");
}

/// A session with fine stripes and so many random patterns, as it is photographed, changed and
/// measured; `change` gets the folder of its photographs.
pub fn measured(
    scene: &Scene,
    layout: &Layout,
    bernoulli: usize,
    change: impl FnOnce(&Path),
) -> Measurements {
    let simulation = simulation(scene, Forced::default());
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path().join("session");
    let options = OrderOptions {
        bernoulli,
        ramp: 0,
        probe: false,
        ..OrderOptions::default()
    };
    let settings = CameraSettings {
        response: scene.camera.response.into(),
        ..CameraSettings::default()
    };
    session::write(
        &order(layout, &options),
        layout,
        &settings,
        &folder,
        &Silent,
    )
    .expect("written");
    let camera = VirtualCamera::new(scene, &simulation, 1).expect("light");
    take(scene, &folder, &camera);
    change(&folder.join("photos"));
    capture::read(&folder, &CaptureOptions::default(), &Silent).expect("a good session")
}

/// Photographs all slides of a folder.
pub fn take(scene: &Scene, folder: &Path, camera: &VirtualCamera<'_>) {
    let slides = UnfilledCapture::read(folder, scene, None).expect("slides of the scene's size");
    slides.take_missing(camera, &Silent).expect("written");
}

/// What is learned from a capture with the usual options.
pub fn learned(capture: &Path) -> BuiltTable {
    learned_by(None, capture)
}

/// What is learned from a capture by a method, or by the usual one.
pub fn learned_by(method: Option<Method>, capture: &Path) -> BuiltTable {
    let photographs = CaptureOptions::default();
    let solve = SolveOptions {
        method,
        ..SolveOptions::default()
    };
    build_table(
        capture,
        &photographs,
        &solve,
        &TableOptions::default(),
        &Silent,
    )
    .expect("a good capture")
}

/// What the projector shows for images that are wanted, by channel: compensated, and with gains alone,
/// those that make white even.
pub fn inputs(learned: &BuiltTable, wanted: &[DMatrix<f64>]) -> [Vec<DMatrix<f64>>; 2] {
    let channels = wanted.iter().enumerate();
    let both = channels.map(|(channel, wanted)| {
        let flood = learned.measurements.channels[channel]
            .observations
            .column(0);
        let mut alone = wanted.clone();
        for mut image in alone.column_iter_mut() {
            image.component_div_assign(&flood);
        }
        (learned.inverse.channel(channel).apply(wanted), alone)
    });
    let (compensated, alone) = both.unzip();
    [compensated, alone]
}

/// Natural images that a scene can show, by channel, cells x images.
pub fn showable(inverse: &InverseTransport) -> Vec<DMatrix<f64>> {
    // Walls that light each other cannot be much darker than their neighbours.
    let white = uniform_white(inverse).expect("lit");
    let images = natural_images(inverse.grid).map(|light| white * (0.2 + 0.8 * light));
    vec![images; inverse.channels.len()]
}

/// Mean relative error of the light of live cells while the projector shows `inputs` for images that
/// are `wanted`, both by channel, at the best scale of each image. A camera without noise sees it.
pub fn error_on_the_wall(
    scene: &Scene,
    learned: &BuiltTable,
    wanted: &[DMatrix<f64>],
    inputs: &[DMatrix<f64>],
) -> f64 {
    let live = &learned.inverse.live;
    let shown: Vec<_> = inputs
        .iter()
        .map(|inputs| {
            DMatrix::from_fn(inputs.nrows(), inputs.ncols(), |cell, image| {
                let on = if live[cell] { 1.0 } else { 0.0 };
                on * inputs[(cell, image)].clamp(0.0, 1.0)
            })
        })
        .collect();
    let quiet = Forced::default()
        .with(Effect::Noise, false)
        .with(Effect::Ambient, false);
    let simulation = simulation(scene, quiet);
    let images = shown[0].ncols();
    let lamp = vec![1.0; images];
    let exposed = simulation
        .expose_projected(&shown, &[lamp])
        .expect("bounces end");
    let of_image = |image| {
        let planes = simulation.photograph(&exposed, image);
        let errors = planes.iter().zip(wanted).map(|(plane, wanted)| {
            let seen = cell_means(&learned.measurements.registration, plane, live.len());
            error(&seen, wanted.column(image), live)
        });
        errors.sum::<f64>() / wanted.len() as f64
    };
    (0..images).map(of_image).sum::<f64>() / images as f64
}

/// What the projectors of a scene show for images that are wanted, by channel, where each was
/// photographed, solved and compensated without the others: their frames side by side. `wanted` is in
/// the units of photographs of all.
pub fn inputs_of_each_alone(
    scene: &Scene,
    bernoulli: usize,
    wanted: &[DMatrix<f64>],
) -> Vec<DMatrix<f64>> {
    let exposure = |scene: &Scene| {
        let simulation = simulation(scene, Forced::default());
        let white = DMatrix::from_element(simulation.grid().cells(), 1, 1.0);
        let white = simulation.expose(&white).expect("bounces end");
        simulation
            .sensor(&simulation.photograph(&white, 0))
            .exposure()
    };
    let of_all = exposure(scene);
    let cols = scene.grid().cols();
    let mut shown: Vec<_> = wanted.iter().map(|all| 0.0 * all).collect();
    for (index, part) in scene.parts().into_iter().enumerate() {
        let alone = Scene {
            projectors: vec![scene.projectors[index].clone()],
            ..scene.clone()
        };
        let folder = tempfile::tempdir().expect("a folder");
        photograph(&alone, bernoulli, 1, &folder.path().join("capture"));
        let learned = learned(&folder.path().join("capture"));
        let units = exposure(&alone) / of_all;
        // Of a cell of its own, the cell of all.
        let place = |cell: usize| part.place(cols, cell);
        for (channel, shown) in shown.iter_mut().enumerate() {
            let own = DMatrix::from_fn(alone.grid().cells(), shown.ncols(), |cell, image| {
                units * wanted[channel][(place(cell), image)]
            });
            let inputs = learned.inverse.channel(channel).apply(&own);
            for (cell, of_cell) in inputs.row_iter().enumerate() {
                shown.set_row(place(cell), &of_cell);
            }
        }
    }
    shown
}

/// Mean light of the pixels of each cell.
pub fn cell_means(registration: &Registration, plane: &[f32], cells: usize) -> Vec<f64> {
    let (mut sums, mut counts) = (vec![0.0; cells], vec![0.0; cells]);
    let pixels = registration.cell_of_pixel.iter().enumerate();
    for (pixel, cell) in pixels.filter(|(_, cell)| **cell != NO_CELL) {
        sums[*cell as usize] += f64::from(plane[pixel]);
        counts[*cell as usize] += 1.0;
    }
    let mean = |(sum, count): (f64, &f64)| sum / f64::max(*count, 1.0);
    sums.into_iter().zip(&counts).map(mean).collect()
}

/// `min_t |t seen - wanted| / |wanted|` over the live cells.
pub fn error<'w>(seen: &[f64], wanted: impl IntoIterator<Item = &'w f64>, live: &[bool]) -> f64 {
    let pairs = seen.iter().zip(wanted).zip(live);
    let pairs: Vec<_> = pairs
        .filter(|(_, live)| **live)
        .map(|(pair, _)| pair)
        .collect();
    let dot = |f: fn(f64, f64) -> f64| pairs.iter().map(|(s, w)| f(**s, **w)).sum::<f64>();
    let scale = dot(|s, w| s * w) / dot(|s, _| s * s);
    let off: f64 = pairs.iter().map(|(s, w)| (scale * *s - *w).powi(2)).sum();
    (off / dot(|_, w| w * w)).sqrt()
}
