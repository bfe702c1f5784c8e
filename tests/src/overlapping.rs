//! Projectors that overlap: each photographed while the others are dark, all solved together, and
//! what a camera sees of compensated pictures that lie on the screen itself.
//!
//! Where a place of the screen lies in frames and photographs comes from the scene's geometry, not
//! from the photographs that a table was learned from.

use crate::neighbours::runtime_frame;
use crate::simulated::{scene, simulation};
use iltm::build_table::{BuiltTable, TableOptions, build_table, build_table_from};
use iltm::capture::{
    CameraSettings, CaptureOptions, PosePhotographs, camera_places, join_poses, read_several,
};
use iltm::compile::reference_white::WhiteRequest;
use iltm::compile::{Provenance, split_table};
use iltm::picture::{ContactSheet, Picture, Response, Samples, Tile};
use iltm::progress::Silent;
use iltm::scene::description::{Projector, Scene};
use iltm::scene::fill_capture::UnfilledCapture;
use iltm::scene::{Forced, Photograph, Pinhole, ProjectedFrame, SimulationError, VirtualCamera};
use iltm::session::{self, Layout, OrderOptions};
use iltm::solve::{SolveOptions, natural_images};
use iltm::verify::{self, Readings, Slides, TableVerdict};
use iltm::video::{CompensateOptions, Compensator, FrameSplitter};
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::{FrameSize, Grid};
use nalgebra::{DMatrix, Vector3};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Side of a cell in pixels of a projector.
const CELL: usize = 20;

/// Details of the pictures on the screen, across and down: finer than the cells.
const DETAILS: (u16, u16) = (40, 64);

/// Light of the darkest part of a picture, of white.
const DARKEST: f64 = 0.2;

/// Light that is drawn as white in [`Screen::before_and_after`], of white: without a table some
/// places are brighter than wanted.
const BRIGHTEST: f64 = 1.8;

/// Pixels on both sides of a border over which its step is looked at, and the side of the square
/// that is averaged on each side.
const BESIDE: usize = 4;

/// The folded screen with another right projector: its picture is smaller, and has fewer rows.
pub fn with_smaller() -> Scene {
    let right = "[0.937, 0.8, 0.656]\nfield_of_view = 43.9\nrows = 15\ncols = 24";
    let smaller = "[0.8, 0.8, 0.56]\nfield_of_view = 36\nrows = 12\ncols = 16";
    scene("folded-screen", &[(right, smaller)])
}

/// Takes the photographs of a session for each projector while the others are dark; their folders.
pub fn photograph_each(scene: &Scene, bernoulli: usize, place: &Path) -> Vec<PathBuf> {
    let simulation = simulation(scene, Forced::default());
    let camera = VirtualCamera::new(scene, &simulation, 1).expect("light");
    each_by(&camera, scene, bernoulli, place)
}

fn each_by(
    camera: &VirtualCamera<'_>,
    scene: &Scene,
    bernoulli: usize,
    place: &Path,
) -> Vec<PathBuf> {
    std::fs::create_dir_all(place).expect("a folder");
    let of_projector = |(index, projector): (usize, &Projector)| {
        let folder = place.join(index.to_string());
        photograph_session(
            camera,
            scene,
            (Some(index), projector.grid),
            bernoulli,
            &folder,
        );
        folder
    };
    scene
        .projectors
        .iter()
        .enumerate()
        .map(of_projector)
        .collect()
}

/// Takes the photographs of a session for each projector from each of the scene's further places of the
/// camera, with one exposure, in a folder of each place.
pub fn photograph_from_poses(
    scene: &Scene,
    bernoulli: usize,
    place: &Path,
) -> Vec<PosePhotographs> {
    let at_first = simulation(scene, Forced::default());
    let exposed = VirtualCamera::new(scene, &at_first, 1).expect("light");
    let of_pose = |(index, name): (usize, String)| {
        let scene = scene.from_pose(index);
        let simulation = simulation(&scene, Forced::default());
        let camera = VirtualCamera::new(&scene, &simulation, 2 + index as u64).expect("light");
        let camera = camera.exposed_as(&exposed);
        let place = place.join(&name);
        PosePhotographs {
            captures: each_by(&camera, &scene, bernoulli, &place),
            name,
        }
    };
    scene
        .pose_names()
        .into_iter()
        .enumerate()
        .map(of_pose)
        .collect()
}

/// One capture of each projector of the photographs from all poses.
pub fn joined(poses: &[PosePhotographs], place: &Path) -> Vec<PathBuf> {
    std::fs::create_dir_all(place).expect("a folder");
    let projectors = 0..poses[0].captures.len();
    let out: Vec<PathBuf> = projectors
        .map(|index| place.join(index.to_string()))
        .collect();
    join_poses(poses, &[], &out, &Silent).expect("poses that belong together");
    out
}

/// Takes the photographs of one session of wide frames.
pub fn photograph_together(scene: &Scene, bernoulli: usize, folder: &Path) {
    let simulation = simulation(scene, Forced::default());
    let camera = VirtualCamera::new(scene, &simulation, 1).expect("light");
    std::fs::create_dir_all(folder.parent().unwrap_or(folder)).expect("a folder");
    photograph_session(&camera, scene, (None, scene.grid()), bernoulli, folder);
}

fn photograph_session(
    camera: &VirtualCamera<'_>,
    scene: &Scene,
    (projector, grid): (Option<usize>, Grid),
    bernoulli: usize,
    folder: &Path,
) {
    let layout = Layout::new(grid, pixels(grid), 0).expect("whole cells");
    let options = OrderOptions {
        bernoulli,
        ..OrderOptions::default()
    };
    let slides = session::order(&layout, &options);
    let settings = CameraSettings::default();
    session::write(&slides, &layout, &settings, folder, &Silent).expect("written");
    let unfilled = UnfilledCapture::read(folder, scene, projector).expect("slides");
    unfilled.take_missing(camera, &Silent).expect("taken");
}

fn pixels(grid: Grid) -> FrameSize {
    let side = |cells: usize| u16::try_from(CELL * cells).expect("a frame");
    FrameSize::new(side(grid.cols()), side(grid.rows())).expect("a frame")
}

/// Light that the table makes of black.
fn black(image: &[u8]) -> f64 {
    Table::check(image).expect("a table").black().to_num()
}

/// The table of all projectors.
pub fn learned_together(captures: &[PathBuf]) -> BuiltTable {
    learned_with(captures, &TableOptions::default())
}

/// The table of all projectors that makes black even.
pub fn learned_with_even_black(captures: &[PathBuf]) -> BuiltTable {
    let options = TableOptions {
        match_black: true,
        ..TableOptions::default()
    };
    learned_with(captures, &options)
}

fn learned_with(captures: &[PathBuf], table: &TableOptions<'_>) -> BuiltTable {
    let options = CaptureOptions::default();
    let several = read_several(captures, &options, &Silent).expect("good captures");
    let (first, solve) = (&captures[0], SolveOptions::default());
    build_table_from(several.into(), first, &solve, table, &Silent).expect("a table")
}

/// A table for each projector, learned from its own photographs alone, for this light of white.
pub fn learned_alone(captures: &[PathBuf], white: f64) -> Vec<BuiltTable> {
    let table = TableOptions {
        white: Some(WhiteRequest::Light(white)),
        ..TableOptions::default()
    };
    let (photographs, solve) = (CaptureOptions::default(), SolveOptions::default());
    let learned = |capture| build_table(capture, &photographs, &solve, &table, &Silent);
    let tables = captures
        .iter()
        .map(|capture| learned(capture).expect("a table"));
    tables.collect()
}

/// Verifies the table of all projectors in the scene as it is `now`, from photographs in the new folder
/// `proof`.
pub fn verified(captures: &[PathBuf], image: &[u8], now: &Scene, proof: &Path) -> TableVerdict {
    let table = Table::check(image).expect("a table");
    let places = camera_places(captures, &Silent).expect("captures with stripes");
    let layout = Layout::new(table.grid(), places.frame, 0).expect("whole cells");
    let settings = Provenance::read(table.provenance()).capture;
    let slides = (&settings.expect("settings"), Slides::Several(&places));
    verify::write(&table, &layout, slides, proof, &Silent).expect("written");
    let simulation = simulation(now, Forced::default());
    // Other noise than that of the captures.
    let camera = VirtualCamera::new(now, &simulation, 2).expect("light");
    let unfilled = UnfilledCapture::read(proof, now, None).expect("slides");
    unfilled.take_missing(&camera, &Silent).expect("taken");
    let readings = Readings::read(proof, &table, &Silent).expect("photographs");
    verify::judge(proof, &table, &readings, None).expect("a verdict")
}

/// The table with the photographs of a verification fed back.
pub fn refined(image: &[u8], proof: &Path) -> Vec<u8> {
    let table = Table::check(image).expect("a table");
    let readings = Readings::read(proof, &table, &Silent).expect("photographs");
    verify::refine(proof, image, &table, &readings)
        .expect("a step")
        .image
}

/// What a camera sees of compensated pictures, by pixels.
#[derive(Clone, Copy, Debug)]
pub struct SeenOnScreen {
    /// Relative error over all that the projectors light, mean over the pictures.
    pub whole: f64,
    /// The same over what more than one of them lights.
    pub overlap: Option<f64>,
    /// The largest step of an even white across a border of the overlap, of its light.
    pub step: Option<f64>,
    /// The same of black; `None` where it is dark.
    pub step_of_black: Option<f64>,
}

/// The screen as a camera and the projectors see it.
pub struct Screen<'s> {
    scene: &'s Scene,
}

impl<'s> Screen<'s> {
    /// That of a scene.
    pub const fn new(scene: &'s Scene) -> Self {
        Self { scene }
    }

    /// The place of the screen that a ray meets first.
    fn met(&self, from: Vector3<f64>, ray: Vector3<f64>) -> Option<Vector3<f64>> {
        let facets = self.scene.panels.iter().flat_map(|panel| &panel.facets);
        let met = facets.filter_map(|facet| {
            let plane = facet.polygon.plane();
            let way = -plane.distance(&from) / plane.normal().dot(&ray);
            let place = from + way * ray;
            (way > 0.0 && facet.polygon.contains(&place)).then_some((way, place))
        });
        let first = met.min_by(|(a, _), (b, _)| a.total_cmp(b));
        first.map(|(_, place)| place)
    }

    /// Light of one picture on the screen, 0 to 1, each column of `pictures` being one. It fills the
    /// camera's frame.
    fn wanted(&self, pictures: &DMatrix<f64>, number: usize, place: Vector3<f64>) -> f64 {
        let (rows, cols) = (usize::from(DETAILS.0), usize::from(DETAILS.1));
        let along = |at: f64, count: usize| {
            let at = at.clamp(0.0, 1.0) * (count - 1) as f64;
            let before = (at as usize).min(count - 2);
            (before, at - before as f64)
        };
        let seen = self.scene.camera.view.place(&place);
        let seen = seen.map_or([0.0; 2], |at| [at.across, at.down]);
        let ((col, right), (row, down)) = (along(seen[0], cols), along(seen[1], rows));
        let at = |row: usize, col: usize| pictures[(row * cols + col, number)];
        let across = |row: usize| (1.0 - right) * at(row, col) + right * at(row, col + 1);
        let light = (1.0 - down) * across(row) + down * across(row + 1);
        DARKEST + (1.0 - DARKEST) * light
    }

    /// The place of the screen that each pixel of the frame of all projectors lights.
    fn lit_places(&self) -> Vec<Option<Vector3<f64>>> {
        let size = pixels(self.scene.grid());
        let mut places = vec![None; size.pixels()];
        for (part, projector) in self
            .scene
            .parts_of(size)
            .expect("whole")
            .iter()
            .zip(&self.scene.projectors)
        {
            let (own, view) = (pixels(projector.grid), &projector.view);
            for pixel in 0..own.pixels() {
                let (x, y) = (pixel % own.width(), pixel / own.width());
                let across = (x as f64 + 0.5) / own.width() as f64;
                let down = (y as f64 + 0.5) / own.height() as f64;
                places[part.place(size.width(), pixel)] =
                    self.met(view.position(), view.ray(across, down));
            }
        }
        places
    }

    /// Where each pixel of the camera looks, and how many projectors light it there, half a cell
    /// within their borders; `None` beside the light of all.
    fn looks(&self) -> Vec<Option<(Vector3<f64>, usize)>> {
        let camera = &self.scene.camera;
        let (width, height) = (camera.size.0 as usize, camera.size.1 as usize);
        let look = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width);
            let (across, down) = (
                (x as f64 + 0.5) / width as f64,
                (y as f64 + 0.5) / height as f64,
            );
            let ray = camera.view.ray(across, down);
            let place = self.met(camera.view.position(), ray)?;
            let lit = self.scene.projectors.iter();
            let lit = lit.filter(|projector| is_lit(&projector.view, projector.grid, &place));
            let lit = lit.count();
            (lit > 0).then_some((place, lit))
        };
        let all: Vec<_> = (0..width * height).map(look).collect();
        // A pixel at the border of the light, or of the screen, sees something else as well.
        let whole = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width);
            let inside = (1..width - 1).contains(&x) && (1..height - 1).contains(&y);
            let mut around = (0..9).map(|at| (y + at / 3 - 1) * width + x + at % 3 - 1);
            let lit = inside && around.all(|other| all[other].is_some());
            all[pixel].filter(|_| lit)
        };
        (0..width * height).map(whole).collect()
    }

    /// What a camera without noise sees of pictures that the table of all projectors compensates.
    pub fn seen(&self, built: &BuiltTable) -> SeenOnScreen {
        self.seen_of(black(&built.compiled.image), &|frame| {
            compensated(built, frame)
        })
    }

    /// The same where each projector has a table of its own, learned from its own photographs and
    /// for the same light of white.
    pub fn seen_of_each(&self, tables: &[BuiltTable]) -> SeenOnScreen {
        self.seen_of(0.0, &|frame| {
            let width = frame.size().width();
            let Samples::Sixteen(wanted) = frame.samples() else {
                unreachable!("frames of 16 bits");
            };
            let mut shown = vec![0; wanted.len()];
            let parts = self.scene.parts_of(frame.size()).expect("whole pixels");
            for (part, built) in parts.iter().zip(tables) {
                let own = part.places(width).map(|pixel| wanted[pixel]).collect();
                let size = part.frame().expect("a frame");
                let own = Picture::new(size, Samples::Sixteen(own)).expect("one code a pixel");
                let own = compensated(built, own);
                let Samples::Sixteen(codes) = own.samples() else {
                    unreachable!("frames of 16 bits");
                };
                for (pixel, code) in part.places(width).zip(codes) {
                    shown[pixel] = *code;
                }
            }
            Picture::new(frame.size(), Samples::Sixteen(shown)).expect("one code a pixel")
        })
    }

    /// The same where a device drives each projector, with frames of 8 bits and its part of the table
    /// of all, with one cell for `factor` of its neighbours' along each side; `heard` says whether it gets
    /// their light.
    pub fn seen_of_devices(&self, built: &BuiltTable, factor: u16, heard: bool) -> SeenOnScreen {
        let count = self.scene.projectors.len();
        let tables = split_table(&built.compiled.image, Some(count), factor);
        let tables = tables.expect("a table of so many");
        let table = Table::check(&built.compiled.image).expect("compile checked it");
        let frames = Provenance::read(table.provenance()).frames;
        let frames = frames.unwrap_or_default();
        self.seen_of(black(&built.compiled.image), &|frame| {
            let wide = frame.size();
            let Samples::Sixteen(codes) = frame.samples() else {
                unreachable!("frames of 16 bits");
            };
            let codes: Vec<u8> = codes.iter().map(|code| of_eight_bits(*code)).collect();
            let mut shown = vec![0; codes.len()];
            let parts = self.scene.parts_of(wide).expect("whole pixels");
            for (part, table) in parts.iter().zip(&tables) {
                let table = Table::check(&table.image).expect("split checked it");
                let splitter = FrameSplitter::new((&table, &frames), wide, Encoding::Display);
                let splitter = splitter.expect("a wide frame");
                let own = splitter.of_frame(&codes);
                let format =
                    Format::new(splitter.own(), table.channels(), Encoding::Display, 40_000);
                let format = format.expect("a frame");
                let light = heard.then_some(&*own.light);
                let made = runtime_frame(&table, (table.top_tier(), format), &own.pixels, light);
                for (pixel, code) in part.places(wide.width()).zip(made) {
                    shown[pixel] = code;
                }
            }
            Picture::new(wide, Samples::Eight(shown)).expect("a code a sample")
        })
    }

    /// What a camera without noise sees of an even white and of a picture: wanted, without a table,
    /// and with the table of all projectors.
    ///
    /// A viewer sets the brightness: each photograph is scaled to the light that is wanted of it.
    pub fn before_and_after(&self, heading: &str, built: &BuiltTable) -> Picture {
        let (rows, cols) = DETAILS;
        let pictures = natural_images(Grid::new(rows, cols).expect("a grid"));
        let camera = &self.scene.camera.size;
        let side = |pixels: u32| u16::try_from(pixels).expect("a photograph");
        let camera = FrameSize::new(side(camera.0), side(camera.1)).expect("a photograph");
        let (size, places, looks) = (pixels(self.scene.grid()), self.lit_places(), self.looks());
        let white = |_: Vector3<f64>| 1.0;
        let picture = |place: Vector3<f64>| self.wanted(&pictures, 0, place);
        let lit = |values: &dyn Fn(usize, Vector3<f64>) -> f64| -> Vec<f64> {
            let value = |(pixel, look): (usize, &Option<(Vector3<f64>, usize)>)| {
                look.map_or(0.0, |(place, _)| values(pixel, place))
            };
            looks.iter().enumerate().map(value).collect()
        };
        let lights: [&dyn Fn(Vector3<f64>) -> f64; 2] = [&white, &picture];
        let frames = lights.iter().flat_map(|light| {
            let frame = frame(size, &places, light);
            [projected(&frame), projected(&compensated(built, frame))]
        });
        let photographs = self.photographs(&frames.collect::<Vec<_>>());
        let row = |name: &str, number: usize| {
            let (light, seen) = (lights[number], &photographs[2 * number..]);
            let wanted = lit(&|_, place| light(place));
            let sum: f64 = wanted.iter().sum();
            let tile = |words: &str, values: Vec<f64>| {
                let scale = values.iter().sum::<f64>() / sum;
                Tile::light((name, words), camera, values, scale * BRIGHTEST)
            };
            vec![
                tile("wanted", wanted.clone()),
                tile("without a table", lit(&|pixel, _| seen[0][pixel])),
                tile("with the table of all", lit(&|pixel, _| seen[1][pixel])),
            ]
        };
        let sheet = ContactSheet {
            heading: heading.to_owned(),
            rows: vec![row("White", 0), row("A picture", 1)],
            ..ContactSheet::default()
        };
        sheet.compose().expect("tiles")
    }

    /// The same of frames that are compensated somehow, where black is raised to this.
    fn seen_of(&self, black: f64, compensate: &dyn Fn(Picture) -> Picture) -> SeenOnScreen {
        let (rows, cols) = DETAILS;
        let pictures = natural_images(Grid::new(rows, cols).expect("a grid"));
        // White, black, and the pictures.
        let mut lights: Vec<Box<dyn Fn(Vector3<f64>) -> f64 + '_>> =
            vec![Box::new(|_| 1.0), Box::new(|_| 0.0)];
        for number in 0..pictures.ncols() {
            let pictures = &pictures;
            lights.push(Box::new(move |place| self.wanted(pictures, number, place)));
        }
        let (size, places) = (pixels(self.scene.grid()), self.lit_places());
        let frames: Vec<ProjectedFrame> = lights
            .iter()
            .map(|light| projected(&compensate(frame(size, &places, light))))
            .collect();
        let photographs = self.photographs(&frames);
        let looks = self.looks();
        let (mut whole, mut overlap) = (0.0, 0.0);
        for (light, seen) in lights.iter().zip(&photographs).skip(2) {
            let pairs = looks.iter().zip(seen).filter_map(|(look, seen)| {
                let (place, lit) = (*look)?;
                Some((*seen, black + (1.0 - black) * light(place), lit))
            });
            let pairs: Vec<(f64, f64, usize)> = pairs.collect();
            let sum = |of: &dyn Fn(&(f64, f64, usize)) -> f64| pairs.iter().map(of).sum::<f64>();
            let scale = sum(&|(s, w, _)| s * w) / sum(&|(s, _, _)| s * s);
            let error = |least: usize| {
                let lit = |lit: usize| f64::from(u8::from(lit >= least));
                let off = sum(&|(s, w, n)| lit(*n) * (scale * s - w).powi(2));
                (off / sum(&|(_, w, n)| lit(*n) * w * w)).sqrt()
            };
            whole += error(1) / pictures.ncols() as f64;
            overlap += error(2) / pictures.ncols() as f64;
        }
        let overlaps = looks.iter().flatten().any(|(_, lit)| *lit > 1);
        SeenOnScreen {
            whole,
            overlap: overlaps.then_some(overlap),
            step: self.step(&looks, &photographs[0]),
            step_of_black: self.step(&looks, &photographs[1]),
        }
    }

    /// The largest step of an even picture across a border of the overlap.
    fn step(&self, looks: &[Option<(Vector3<f64>, usize)>], seen: &[f64]) -> Option<f64> {
        let width = self.scene.camera.size.0 as usize;
        let mean = |x: usize, y: usize, lit: usize| {
            let (mut sum, mut count) = (0.0, 0);
            for pixel in (0..BESIDE * BESIDE).map(|at| (y + at / BESIDE) * width + x + at % BESIDE)
            {
                let (_, own) = looks.get(pixel).copied().flatten()?;
                if own != lit {
                    return None;
                }
                sum += seen[pixel];
                count += 1;
            }
            Some(sum / f64::from(count))
        };
        let height = seen.len() / width;
        let mut largest: Option<f64> = None;
        for y in 0..height - BESIDE {
            for x in 0..width - 4 * BESIDE {
                for (left, right) in [(1, 2), (2, 1)] {
                    // The pixels between belong to either.
                    let beside = mean(x, y, left).zip(mean(x + 2 * BESIDE, y, right));
                    if let Some((a, b)) = beside.filter(|(a, b)| a.max(*b) > 0.0) {
                        let step = (a - b).abs() / a.max(b);
                        largest = Some(largest.map_or(step, |largest| largest.max(step)));
                    }
                }
            }
        }
        largest
    }

    /// Photographs of frames without noise, mean of the channels.
    fn photographs(&self, frames: &[ProjectedFrame]) -> Vec<Vec<f64>> {
        let mut quiet = self.scene.clone();
        quiet.camera.full_well = None;
        quiet.camera.read_noise = 0.0;
        quiet.camera.bits = Some(16);
        let simulation = simulation(&quiet, Forced::default());
        let camera = VirtualCamera::new(&quiet, &simulation, 1).expect("light");
        let taken = Mutex::new(vec![Vec::new(); frames.len()]);
        let places: Vec<usize> = (0..frames.len()).collect();
        let keep = |place: usize, photograph: Option<Photograph>| {
            let photograph = photograph.expect("no fault");
            let pixels = 0..photograph.values[0].len();
            let planes = &photograph.values;
            let light = |pixel: usize| planes.iter().map(|plane| f64::from(plane[pixel])).sum();
            taken.lock().expect("no panic")[place] = pixels.map(light).collect();
            Ok::<(), SimulationError>(())
        };
        camera.take(frames, &places, keep).expect("light");
        taken.into_inner().expect("no panic")
    }
}

/// A frame that wants a picture whose light is that of places on the screen, as codes of sRGB.
fn frame(
    size: FrameSize,
    places: &[Option<Vector3<f64>>],
    light: &dyn Fn(Vector3<f64>) -> f64,
) -> Picture {
    let code = |place: &Option<Vector3<f64>>| {
        let value = place.map_or(0.0, |place| Response::Srgb.value(light(place)));
        (65535.0 * value).round() as u16
    };
    let codes = places.iter().map(code).collect();
    Picture::new(size, Samples::Sixteen(codes)).expect("one code a pixel")
}

/// What a table makes of a frame.
pub fn compensated(built: &BuiltTable, frame: Picture) -> Picture {
    let table = Table::check(&built.compiled.image).expect("a table");
    let compensator = Compensator::new(&table, CompensateOptions::default()).expect("threads");
    compensator.frame(frame).expect("a frame of the table").0
}

/// Whether a projector lights a place, half a cell within its border.
fn is_lit(view: &Pinhole, grid: Grid, place: &Vector3<f64>) -> bool {
    let within = |at: f64, cells: usize| {
        let border = 0.5 / cells as f64;
        (border..1.0 - border).contains(&at)
    };
    view.place(place)
        .is_some_and(|at| within(at.across, grid.cols()) && within(at.down, grid.rows()))
}

const fn of_eight_bits(code: u16) -> u8 {
    ((code as u32 + 128) / 257) as u8
}

/// A picture as projectors show it, with 8 bits.
fn projected(picture: &Picture) -> ProjectedFrame {
    let codes: Vec<u8> = match picture.samples() {
        Samples::Eight(codes) => codes.clone(),
        Samples::Sixteen(codes) => codes.iter().map(|code| of_eight_bits(*code)).collect(),
    };
    let channels = picture.channels();
    let colour = |pixel: &[u8]| [0, 1, 2].map(|channel| pixel[channel % channels]);
    ProjectedFrame {
        size: picture.size(),
        codes: codes.chunks_exact(channels).map(colour).collect(),
        exposure: 1.0,
    }
}
