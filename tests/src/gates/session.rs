//! A random session as somebody may take it who does nothing wrong: scene, cameras, noise, grid,
//! patterns and drift all differ, and all follow from one number.

use crate::simulated::{host_tools, simulation};
use fastrand::Rng;
use iltm::capture::{self, CameraSettings, CaptureError, CaptureOptions, Examined, Gate, listed};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::fill_capture::UnfilledCapture;
use iltm::scene::{CaptureFault, Forced, InjectedFault, Simulation, VirtualCamera};
use iltm::session::{self, Layout, OrderOptions, order};
use iltm_runtime::{FrameSize, Grid};
use std::fmt::Write;
use std::path::Path;

/// Scenes that come with the tools, as often as random ones of each kind.
const KNOWN: [&str; 7] = [
    "flat-screen",
    "installation",
    "m-panels",
    "m-panels-painted",
    "painted-corner",
    "dome",
    "stage",
];

/// Bernoulli patterns, from what a solve needs to what it may use.
const BERNOULLI: [usize; 9] = [10, 12, 15, 20, 25, 30, 40, 60, 100];

/// A session.
pub struct StudiedSession {
    /// What all of it follows from.
    pub seed: u64,
    /// What it is, for people.
    pub words: String,
    scene: Scene,
    order: OrderOptions,
    /// Quality, where the photographs are JPEG.
    jpeg: Option<u8>,
}

impl StudiedSession {
    /// The session of a seed.
    pub fn new(seed: u64) -> Self {
        let mut dice = Rng::with_seed(seed);
        let shape = dice.usize(..KNOWN.len() + 5);
        let name = KNOWN.get(shape).copied();
        let (rows, cols) = (dice.usize(8..=12), dice.usize(8..=16));
        let pixels = 5.0 + 4.0 * dice.f64();
        let camera = camera(&mut dice, (rows, cols), pixels);
        let jpeg = (camera.contains("bits = 8\n") && camera.contains("srgb") && dice.bool())
            .then(|| dice.u8(85..=97));
        let projector = projector(&mut dice, (rows, cols));
        let text = match name {
            Some(name) => known(name, &projector, &camera),
            None => random(&mut dice, &projector, &camera),
        };
        let options = OrderOptions {
            bernoulli: BERNOULLI[dice.usize(..BERNOULLI.len())],
            images: Vec::new(),
            seed,
            ramp: if dice.bool() {
                0
            } else {
                5 + 4 * dice.u16(..3)
            },
            // The gates look at the capture itself.
            stripes: false,
            probe: dice.bool(),
            repeat_every: dice.usize(8..=24),
        };
        let path = host_tools().join("scenes/study.toml");
        let scene = Scene::parse(text.as_bytes(), &path);
        let scene = scene.unwrap_or_else(|error| panic!("{seed}: {error}\n{text}"));
        let (width, height) = scene.camera.size;
        let words = format!(
            "{} {rows} x {cols}, {width} x {height}, {} bits {}{}, full well {:.0}, {} patterns{}, \
             white {:.2}",
            name.unwrap_or("random"),
            scene.camera.bits.unwrap_or(16),
            scene.camera.response,
            jpeg.map_or_else(String::new, |q| format!(" JPEG {q}")),
            scene.camera.full_well.unwrap_or(0.0),
            options.bernoulli,
            if options.ramp > 0 { " and ramp" } else { "" },
            scene.camera.white,
        );
        Self {
            seed,
            words,
            scene,
            order: options,
            jpeg,
        }
    }

    /// Its light.
    pub fn simulation(&self) -> Simulation<'_> {
        simulation(&self.scene, Forced::default())
    }

    /// Takes the photographs, with a fault or none, and asks the gates.
    ///
    /// # Errors
    /// What stops the gates: photographs that cannot be told from each other.
    pub fn examined(
        &self,
        simulation: &Simulation<'_>,
        fault: Option<InjectedFault>,
    ) -> Result<Examined, CaptureError> {
        let place = tempfile::tempdir().expect("a folder");
        let folder = place.path().join("capture");
        self.photograph(simulation, fault, &folder);
        capture::examine(&folder, &CaptureOptions::default(), &Silent)
    }

    /// Takes the photographs of a session into a folder.
    pub fn photograph(
        &self,
        simulation: &Simulation<'_>,
        fault: Option<InjectedFault>,
        folder: &Path,
    ) {
        let grid = simulation.grid();
        let layout = layout(grid);
        let settings = CameraSettings {
            response: self.scene.camera.response.into(),
            ..CameraSettings::default()
        };
        let slides = order(&layout, &self.order);
        session::write(&slides, &layout, &settings, folder, &Silent).expect("written");
        let camera = VirtualCamera::new(&self.scene, simulation, self.seed).expect("light");
        let faults: Vec<InjectedFault> = fault.into_iter().collect();
        let camera = camera.with_faults(&faults);
        let unfilled = UnfilledCapture::read(folder, &self.scene, None).expect("slides");
        unfilled.take_missing(&camera, &Silent).expect("taken");
        if let Some(quality) = self.jpeg {
            for (_, shot) in listed(folder).expect("a capture") {
                to_jpeg(&folder.join(&shot.photo), quality);
            }
        }
    }

    /// A fault of a size in the unit that the study gives it.
    pub fn fault(&self, kind: CaptureFault, size: f64, good: &Examined) -> InjectedFault {
        let mut dice = Rng::with_seed(self.seed ^ 0xFA17);
        let size = match kind {
            CaptureFault::Tripod => {
                let measured = good.measurements.as_ref().expect("a good session");
                let registration = &measured.registration;
                size * registration.binning as f64 * registration.cell_side()
            }
            CaptureFault::Swapped | CaptureFault::Dropped => self.scene_place(&mut dice, good),
            CaptureFault::Skipped => dice.f64(),
            CaptureFault::Gamma => size * gamma(&self.scene),
            CaptureFault::Clipped => size * 0.8 / self.scene.camera.white,
            _ => size,
        };
        InjectedFault { kind, size }
    }

    /// A place among the photographs of the scene: exchanging two that measure a device is no
    /// matter of `order`.
    fn scene_place(&self, dice: &mut Rng, good: &Examined) -> f64 {
        let grid = good.measurements.as_ref().expect("a good session").grid;
        let slides = order(&layout(grid), &self.order);
        let of_scene = |slide: &session::Slide| matches!(slide.purpose, session::Purpose::Scene(_));
        let places: Vec<usize> = (4..slides.len() - 2)
            .filter(|&at| of_scene(&slides[at]) && of_scene(&slides[at + 1]))
            .collect();
        let place = places[dice.usize(..places.len())];
        // In its middle, so that no rounding moves it.
        (place as f64 + 0.5) / slides.len() as f64
    }
}

/// Two pixels of the projector along each side of a cell.
fn layout(grid: Grid) -> Layout {
    let size = FrameSize::new(2 * grid.cols() as u16, 2 * grid.rows() as u16);
    Layout::new(grid, size.expect("a size"), 0).expect("a layout")
}

/// Exponent of the camera's response.
fn gamma(scene: &Scene) -> f64 {
    match scene.camera.response {
        iltm::picture::Response::Linear => 1.0,
        iltm::picture::Response::Srgb => 2.2,
        iltm::picture::Response::Gamma(gamma) => gamma,
    }
}

/// The gates that fail.
pub fn failing(gates: &[Gate]) -> Vec<&Gate> {
    gates.iter().filter(|gate| gate.fails()).collect()
}

/// Writes a photograph again as a JPEG in place of the PNG.
fn to_jpeg(png: &Path, quality: u8) {
    let Ok(picture) = image::open(png) else {
        // The camera missed it.
        return;
    };
    let file = std::fs::File::create(png.with_extension("jpg")).expect("a file");
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(file, quality);
    picture.write_with_encoder(encoder).expect("written");
    std::fs::remove_file(png).expect("it is there");
}

/// Lines of the camera that do not depend on where it stands.
fn camera(dice: &mut Rng, (rows, cols): (usize, usize), pixels: f64) -> String {
    let side = |cells: usize| (1.35 * pixels * cells as f64).ceil() as usize;
    let bits = [8, 8, 10, 12, 14, 16][dice.usize(..6)];
    let response = match dice.u8(..4) {
        _ if bits == 8 && dice.u8(..4) > 0 => "\"srgb\"",
        0 => "\"srgb\"",
        _ => "\"linear\"",
    };
    let full_well = 8000.0 * 8.0_f64.powf(dice.f64());
    format!(
        "width = {}\nheight = {}\nwhite = {:.3}\nfull_well = {full_well:.0}\nread_noise = {:.1}\n\
         bits = {bits}\nresponse = {response}\ndistortion = [{:.3}, 0.0]\n",
        side(cols),
        side(rows),
        0.6 + 0.25 * dice.f64(),
        2.0 + 8.0 * dice.f64(),
        0.08 * dice.f64(),
    )
}

/// Lines of the projector that do not depend on where it stands.
fn projector(dice: &mut Rng, (rows, cols): (usize, usize)) -> String {
    let some = |dice: &mut Rng, most: f64| if dice.bool() { most * dice.f64() } else { 0.0 };
    format!(
        "rows = {rows}\ncols = {cols}\nresponse = {}\nvignetting = {:.3}\nblur = {:.2}\n\
         black = {:.4}\ndrift = {:.3}\n",
        ["\"srgb\"", "2.2", "1.8", "\"linear\""][dice.usize(..4)],
        some(dice, 0.3),
        some(dice, 0.5),
        some(dice, 0.004),
        some(dice, 0.08),
    )
}

/// A scene that comes with the tools, with another projector and camera in the same places.
fn known(name: &str, projector: &str, camera: &str) -> String {
    let path = host_tools().join(format!("scenes/{name}.toml"));
    let text = std::fs::read_to_string(&path).expect("part of the repository");
    let (mut made, mut section) = (String::new(), "");
    for line in text.lines() {
        if line.starts_with('[') {
            section = line;
        }
        let key = line.split('=').next().unwrap_or("").trim();
        let stays = ["position", "look_at", "up", "field_of_view", "aspect"].contains(&key);
        let device = ["[projector]", "[camera]"].contains(&section);
        if device && !stays && !line.starts_with('[') {
            continue;
        }
        let _ = writeln!(made, "{line}");
        match line {
            "[projector]" => made += projector,
            "[camera]" => made += camera,
            _ => {}
        }
    }
    made
}

/// A scene of panels: a flat screen, a wedge, a folded screen, a corner or the inside of a box.
fn random(dice: &mut Rng, projector: &str, camera: &str) -> String {
    let shape = dice.usize(..5);
    let half = 0.8 + 0.6 * dice.f64();
    let tall = 0.8 + 0.6 * dice.f64();
    let deep = 0.4 + dice.f64();
    let (mut panels, (from, to)) = match shape {
        0 => (
            vec![quad([-half, tall, 0.0], [half, -tall, 0.0])],
            ([0.0, 0.0, 3.5], [0.0, 0.0, 0.0]),
        ),
        1 => (
            vec![
                wall([-half, 0.0], [0.0, -deep], tall),
                wall([0.0, -deep], [half, 0.0], tall),
            ],
            ([0.0, 0.0, 3.5], [0.0, 0.0, -0.4]),
        ),
        2 => {
            let folds = dice.usize(3..=5);
            let x = |k: usize| half * (2.0 * k as f64 / folds as f64 - 1.0);
            let z = |k: usize| {
                if k.is_multiple_of(2) {
                    0.0
                } else {
                    -0.5 * deep
                }
            };
            let panels = (0..folds)
                .map(|k| wall([x(k), z(k)], [x(k + 1), z(k + 1)], tall))
                .collect();
            (panels, ([0.1, 0.1, 4.0], [0.0, 0.0, -0.2]))
        }
        3 => {
            let s = 1.4 + half;
            let panels = vec![
                [[0.0, s, s], [0.0, s, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, s]],
                [[0.0, s, 0.0], [s, s, 0.0], [s, 0.0, 0.0], [0.0, 0.0, 0.0]],
                [[0.0, 0.0, 0.0], [s, 0.0, 0.0], [s, 0.0, s], [0.0, 0.0, s]],
            ];
            (panels, ([2.6, 1.7, 2.4], [0.0, 0.7, 0.0]))
        }
        _ => {
            let (w, h) = (half, tall);
            let panels = vec![
                quad([-w, h, 0.0], [w, -h, 0.0]),
                [[-w, h, deep], [-w, h, 0.0], [-w, -h, 0.0], [-w, -h, deep]],
                [[w, h, 0.0], [w, h, deep], [w, -h, deep], [w, -h, 0.0]],
                [[-w, -h, 0.0], [w, -h, 0.0], [w, -h, deep], [-w, -h, deep]],
                [[-w, h, deep], [w, h, deep], [w, h, 0.0], [-w, h, 0.0]],
            ];
            (panels, ([0.1, 0.1, deep + 3.5], [0.0, 0.0, 0.0]))
        }
    };
    let colour = dice.u8(..4) == 0;
    let mut jitter = |most: f64| most * (2.0 * dice.f64() - 1.0);
    let from = [from[0] + jitter(0.2), from[1] + jitter(0.2), from[2]];
    let beside = [
        from[0] + 0.3 + jitter(0.15),
        from[1] + 0.25 + jitter(0.15),
        from[2] + 0.3,
    ];
    let view = 24.0 + 10.0 * dice.f64();
    let ambient = if dice.bool() {
        0.1 * dice.f64().powi(2)
    } else {
        0.0
    };
    let mut text = format!(
        "name = \"study\"\nambient = {ambient:.4}\n[projector]\nposition = {from:?}\n\
         look_at = {to:?}\nfield_of_view = {view:.1}\n{projector}[camera]\nposition = {beside:?}\n\
         look_at = {to:?}\nfield_of_view = {:.1}\n{camera}",
        1.25 * view,
    );
    for corners in panels.drain(..) {
        let albedo = |dice: &mut Rng| 0.08 + 0.82 * dice.f64();
        let albedo = if colour {
            let [r, g, b] = [albedo(dice), albedo(dice), albedo(dice)];
            format!("[{r:.2}, {g:.2}, {b:.2}]")
        } else {
            format!("{:.2}", albedo(dice))
        };
        let _ = write!(
            text,
            "[[panel]]\ncorners = {corners:?}\nalbedo = {albedo}\n"
        );
    }
    text
}

type Corners = [[f64; 3]; 4];

/// A rectangle across the view from its top left to its bottom right corner.
fn quad([left, top, z]: [f64; 3], [right, bottom, _]: [f64; 3]) -> Corners {
    [
        [left, top, z],
        [right, top, z],
        [right, bottom, z],
        [left, bottom, z],
    ]
}

/// An upright rectangle from one place of the floor plan to another.
fn wall([x0, z0]: [f64; 2], [x1, z1]: [f64; 2], tall: f64) -> Corners {
    [
        [x0, tall, z0],
        [x1, tall, z1],
        [x1, -tall, z1],
        [x0, -tall, z0],
    ]
}
