//! Verdicts of `iltm verify` against the truth: a table is learned from simulated photographs,
//! verified with others that have a fault on purpose, and what is really on the wall is known.

use crate::simulated::{self, cell_means, host_tools, simulation};
use iltm::build_table::BuiltTable;
use iltm::capture::{CameraSettings, Settings};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::{
    CaptureFault, Effect, Forced, InjectedFault, Simulation, VirtualCamera, fill_capture,
};
use iltm::session::{self, Layout, OrderOptions};
use iltm::verify::{Cause, Outcome, Readings, Slides, TableVerdict, VerifyError, judge, write};
use iltm_runtime::FrameSize;
use iltm_runtime::image::Table;
use image::codecs::jpeg::JpegEncoder;
use nalgebra::DMatrix;
use std::cell::OnceCell;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Random patterns that tables are learned from.
const BERNOULLI: usize = 80;

/// Projector pixels along a cell's side.
const CELL: u16 = 20;

/// A scene, and a table learned for it from a session with fine stripes.
pub struct VerdictRig {
    /// Kept as long as the program runs, so that simulations of it can be kept beside it.
    scene: &'static Scene,
    /// Its light, with noise and without.
    simulated: [OnceCell<Simulation<'static>>; 2],
    layout: Layout,
    learned: OnceCell<BuiltTable>,
    /// What all images share in the scene as it was, photographed without noise.
    own_fixed: OnceCell<Option<f64>>,
    place: TempDir,
}

/// What is wrong in one session.
#[derive(Clone, Debug)]
pub struct VerdictCase {
    /// For people.
    pub name: String,
    /// The scene as the verification finds it.
    pub scene: Scene,
    /// Whether that is another than the table was learned in.
    pub is_changed: bool,
    /// What goes wrong with the photographs.
    pub faults: Vec<InjectedFault>,
    /// Of the noise.
    pub seed: u64,
    /// Photographs are JPEG of this quality.
    pub jpeg: Option<u8>,
    /// What must come of it; with both, either.
    pub right: Vec<Outcome>,
}

/// One session, judged.
#[derive(Debug)]
pub struct VerdictSession {
    /// What was wrong.
    pub case: VerdictCase,
    /// What `verify` says.
    pub verdict: Result<TableVerdict, VerifyError>,
    /// Error that is on the wall, by cells.
    pub truth: f64,
    /// The same at camera pixels, of what all images share: photographed without noise and faults.
    /// `None` if these do not tell.
    pub fixed: Option<f64>,
}

impl VerdictSession {
    /// Whether the outcome is one that it may be, and a table that passes is as good as the
    /// page says.
    pub fn is_right(&self) -> bool {
        match &self.verdict {
            Ok(verdict) => {
                let passed = verdict.outcome == Outcome::Passed;
                let limit = at_pixels(verdict).map(|(_, limit)| limit);
                let beyond = limit
                    .zip(self.fixed)
                    .is_some_and(|(most, wall)| wall > most);
                self.case.right.contains(&verdict.outcome)
                    && !(passed && (self.truth > verdict.bound.limit || beyond))
            }
            Err(_) => self.case.right.contains(&Outcome::Inconclusive),
        }
    }

    /// A line of a table.
    pub fn line(&self) -> String {
        let percent = |value: f64| format!("{:.2} %", 100.0 * value);
        let known = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), percent);
        let mut line = format!("| {} | {} |", self.case.name, percent(self.truth));
        match &self.verdict {
            Ok(verdict) => {
                let cause = verdict.cause.map_or("", Cause::name);
                let (bound, name) = (&verdict.bound, verdict.outcome.name());
                let pixels = at_pixels(verdict);
                let _ = write!(
                    line,
                    " {} | {} | {} | {} | {} | {} | {name} | {cause} |",
                    percent(verdict.error[1]),
                    percent(bound.limit),
                    percent(bound.added),
                    known(self.fixed),
                    known(pixels.map(|(fixed, _)| fixed)),
                    known(pixels.map(|(_, limit)| limit)),
                );
            }
            Err(error) => {
                let fixed = known(self.fixed);
                let _ = write!(
                    line,
                    " - | - | - | {fixed} | - | - | no verdict | {error} |"
                );
            }
        }
        line
    }
}

/// The error at pixels that all images share, and the most of it that passes.
fn at_pixels(verdict: &TableVerdict) -> Option<(f64, f64)> {
    let pixels = verdict.pixels.as_ref()?;
    Some((pixels.fixed?.error, pixels.bound?.limit))
}

/// The head of a table of [`VerdictSession::line`].
pub const HEAD: &str = "| session | cells: on the wall | measured | most that passes | photographs add | pixels: on the wall | measured | most that passes | outcome | cause |\n|---|---|---|---|---|---|---|---|---|---|";

/// The mural that a scene has, with less contrast of its detail: what a quarter of its height does
/// not show fades by `part`. Its file, in `folder`.
#[must_use]
pub fn faded_mural(folder: &Path, part: f64) -> PathBuf {
    let own = image::open(host_tools().join("scenes/mural.png")).expect("part of the repository");
    let own = own.into_rgb32f();
    let blurred = image::imageops::blur(&own, own.height() as f32 / 32.0);
    let faded = image::Rgb32FImage::from_fn(own.width(), own.height(), |x, y| {
        let mut pixel = *own.get_pixel(x, y);
        for (value, mean) in pixel.0.iter_mut().zip(blurred.get_pixel(x, y).0) {
            *value -= part as f32 * (*value - mean);
        }
        pixel
    });
    let path = folder.join(format!("faded-{part}.png"));
    let faded = image::DynamicImage::ImageRgb32F(faded).into_rgb8();
    faded.save(&path).expect("written");
    path
}

impl VerdictRig {
    /// For this scene.
    pub fn new(scene: Scene) -> Self {
        let grid = scene.grid();
        let [width, height] = [grid.cols(), grid.rows()].map(|side| side as u16 * CELL);
        let size = FrameSize::new(width, height).expect("sides above zero");
        Self {
            scene: Box::leak(Box::new(scene)),
            simulated: [OnceCell::new(), OnceCell::new()],
            layout: Layout::new(grid, size, 0).expect("cells fit"),
            learned: OnceCell::new(),
            own_fixed: OnceCell::new(),
            place: tempfile::tempdir().expect("a folder"),
        }
    }

    /// The table, learned when it is first asked for.
    fn learned(&self) -> &BuiltTable {
        self.learned.get_or_init(|| {
            let capture = self.place.path().join("capture");
            let options = OrderOptions {
                bernoulli: BERNOULLI,
                ..OrderOptions::default()
            };
            let slides = session::order(&self.layout, &options);
            let camera = CameraSettings {
                response: self.scene.camera.response.into(),
                ..CameraSettings::default()
            };
            session::write(&slides, &self.layout, &camera, &capture, &Silent).expect("written");
            fill(self.own(true), self.scene, &capture, (3, &[]));
            simulated::learned(&capture)
        })
    }

    /// The light of the scene as it was, with noise or without.
    fn own(&self, noisy: bool) -> &Simulation<'static> {
        let known = &self.simulated[usize::from(noisy)];
        known.get_or_init(|| simulation(self.scene, forced(noisy)))
    }

    /// A session without fault that must pass.
    pub fn good(&self, name: &str, seed: u64) -> VerdictCase {
        VerdictCase {
            name: name.to_owned(),
            scene: self.scene.clone(),
            is_changed: false,
            faults: Vec::new(),
            seed,
            jpeg: None,
            right: vec![Outcome::Passed],
        }
    }

    /// A session with a fault of which something must come.
    pub fn faulty(&self, kind: CaptureFault, size: f64, right: &[Outcome]) -> VerdictCase {
        let fault = InjectedFault { kind, size };
        VerdictCase {
            faults: vec![fault],
            right: right.to_vec(),
            ..self.good(&fault.to_string(), 11)
        }
    }

    /// A session in another scene.
    pub fn changed(&self, name: &str, scene: Scene, right: &[Outcome]) -> VerdictCase {
        VerdictCase {
            scene,
            is_changed: true,
            right: right.to_vec(),
            ..self.good(name, 11)
        }
    }

    /// Takes the photographs of a session and judges them.
    pub fn judge(&self, case: VerdictCase) -> VerdictSession {
        let table = Table::check(&self.learned().compiled.image).expect("a table");
        let folder = self.place.path().join("verify");
        let _ = fs::remove_dir_all(&folder);
        let settings = Settings {
            camera: self.learned().measurements.settings.camera.clone(),
            ..Settings::default()
        };
        let slides = (&settings, Slides::Both { fine: true });
        write(&table, &self.layout, slides, &folder, &Silent).expect("written");
        let photograph = |noisy: bool, faults: &[InjectedFault]| {
            let photographs = (case.seed, faults);
            if case.is_changed {
                let simulation = simulation(&case.scene, forced(noisy));
                fill(&simulation, &case.scene, &folder, photographs);
            } else {
                fill(self.own(noisy), self.scene, &folder, photographs);
            }
        };
        photograph(true, &case.faults);
        if let Some(quality) = case.jpeg {
            as_jpeg(&folder.join("photos"), quality);
        }
        let judged = || {
            judge(
                &folder,
                &table,
                &Readings::read(&folder, &table, &Silent)?,
                None,
            )
        };
        let verdict = judged();
        let truth = self.truth(&case, &folder);
        let quiet = || {
            fs::remove_dir_all(folder.join("photos")).expect("removed");
            fs::create_dir(folder.join("photos")).expect("made");
            photograph(false, &[]);
            Some(judged().ok()?.pixels?.fixed?.error)
        };
        let fixed = if case.is_changed {
            quiet()
        } else {
            *self.own_fixed.get_or_init(quiet)
        };
        VerdictSession {
            case,
            verdict,
            truth,
            fixed,
        }
    }

    /// Mean error of the compensated images on the wall, without noise and faults of the
    /// camera, in the cells where they were when the table was learned.
    fn truth(&self, case: &VerdictCase, folder: &Path) -> f64 {
        let table = Table::check(&self.learned().compiled.image).expect("a table");
        let images = iltm::verify::test_images(&table).expect("images");
        let curves = iltm::verify::ProjectorCurves::new(&table);
        // The wall as it is now, from where the camera stood then.
        let mut wall = case.scene.clone();
        wall.camera = self.scene.camera.clone();
        let changed = case.is_changed.then(|| simulation(&wall, forced(false)));
        let simulation = changed.as_ref().unwrap_or_else(|| self.own(false));
        let (cells, channels) = (table.grid().cells(), usize::from(table.channels()));
        let light = |picture: &iltm::picture::Picture, of: &dyn Fn(usize, u8) -> f64| {
            let iltm::picture::Samples::Eight(codes) = picture.samples() else {
                panic!("8 bits in {}", folder.display());
            };
            let plane = |channel: usize| -> Vec<f64> {
                let own = codes.iter().skip(channel).step_by(channels);
                own.map(|code| of(channel, *code)).collect()
            };
            (0..channels).map(plane).collect::<Vec<_>>()
        };
        let drive = |channel, code| curves.drive(channel, code);
        let inputs: Vec<_> = images
            .iter()
            .map(|i| light(&i.compensated, &drive))
            .collect();
        let projected: Vec<DMatrix<f64>> = (0..channels)
            .map(|c| DMatrix::from_fn(cells, inputs.len(), |cell, k| inputs[k][c][cell]))
            .collect();
        let projected = if channels == 1 {
            projected
        } else {
            [0, 1, 2].map(|c| projected[c].clone()).to_vec()
        };
        let lamp = vec![1.0; inputs.len()];
        let exposed = simulation
            .expose_projected(&projected, &[lamp])
            .expect("light");
        let live: Vec<bool> = self.learned().measurements.live.repeat(channels);
        let srgb = |_, code: u8| iltm::picture::Response::Srgb.light(f64::from(code) / 255.0);
        let registration = &self.learned().measurements.registration;
        let errors = images.iter().enumerate().map(|(k, image)| {
            let planes = simulation.photograph(&exposed, k);
            let seen: Vec<f64> = (planes.iter())
                .flat_map(|plane| cell_means(registration, plane, cells))
                .collect();
            let wanted: Vec<f64> = light(&image.wanted, &srgb).concat();
            simulated::error(&seen, &wanted, &live)
        });
        errors.sum::<f64>() / images.len() as f64
    }
}

/// Effects as the scene has them, with noise or without.
fn forced(noisy: bool) -> Forced {
    if noisy {
        Forced::default()
    } else {
        Forced::default().with(Effect::Noise, false)
    }
}

/// Takes the photographs of a folder, with noise of this seed and faults.
fn fill(
    simulation: &Simulation<'_>,
    scene: &Scene,
    folder: &Path,
    (seed, faults): (u64, &[InjectedFault]),
) {
    let camera = VirtualCamera::new(scene, simulation, seed).expect("light");
    let camera = camera.with_faults(faults);
    let session = fill_capture::UnfilledCapture::read(folder, scene, None);
    let session = session.expect("a folder to fill");
    session.take_missing(&camera, &Silent).expect("taken");
}

/// Turns the photographs of a folder into JPEG files.
pub fn as_jpeg(photos: &Path, quality: u8) {
    let files: Vec<PathBuf> = (fs::read_dir(photos).expect("photographs"))
        .map(|entry| entry.expect("a file").path())
        .collect();
    for path in files {
        let picture = image::open(&path).expect("a photograph");
        let out = fs::File::create(path.with_extension("jpg")).expect("a file");
        JpegEncoder::new_with_quality(out, quality)
            .encode_image(&picture.into_luma8())
            .expect("encoded");
        fs::remove_file(path).expect("removed");
    }
}

/// The sessions of the study in one scene: many good ones, and every fault from its smallest
/// size up. `gammas` are those that the camera has and nobody declared; `others` the scene as it
/// was changed since, or seen from another place.
pub fn study(
    rig: &VerdictRig,
    gammas: &[f64],
    others: &[(&str, Scene, &[Outcome])],
) -> Vec<VerdictCase> {
    use CaptureFault as F;
    use Outcome::{Failed, Inconclusive, Passed};
    let mut cases: Vec<VerdictCase> = (1..=6)
        .map(|seed| rig.good(&format!("good, seed {seed}"), seed))
        .collect();
    // Tiny faults may pass, as long as the wall is what the page says.
    let any = &[Passed, Inconclusive];
    for size in [0.05, 0.1, 0.2, 0.3, 0.5, 0.7] {
        cases.push(rig.faulty(F::Tripod, size, any));
    }
    for size in [1.0, 2.0, 3.0, 4.0] {
        cases.push(rig.faulty(F::Tripod, size, &[Inconclusive]));
    }
    for size in [0.002, 0.005, 0.01] {
        cases.push(rig.faulty(F::Flicker, size, any));
    }
    for size in [0.02, 0.03, 0.06] {
        cases.push(rig.faulty(F::Flicker, size, &[Inconclusive]));
    }
    for gamma in gammas {
        cases.push(rig.faulty(F::Gamma, *gamma, any));
    }
    for size in [0.01, 0.02, 0.05, 0.1] {
        cases.push(rig.faulty(F::AutoExposure, size, any));
    }
    for size in [0.3, 1.0] {
        cases.push(rig.faulty(F::AutoExposure, size, &[Inconclusive]));
    }
    for size in [0.0, 0.01, 0.05, 0.15, 0.3] {
        cases.push(rig.faulty(F::Vivid, size, &[Failed]));
    }
    for size in [1.1, 1.2, 1.3] {
        cases.push(rig.faulty(F::Clipped, size, any));
    }
    for size in [1.6, 2.5] {
        cases.push(rig.faulty(F::Clipped, size, &[Inconclusive]));
    }
    for kind in [F::Skipped, F::Swapped, F::Dropped] {
        for size in [0.3, 0.6, 0.9] {
            cases.push(rig.faulty(kind, size, &[Inconclusive]));
        }
    }
    for (name, scene, right) in others {
        cases.push(rig.changed(name, scene.clone(), right));
    }
    cases
}
