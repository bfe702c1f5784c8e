//! Benchmark scenes: the light that methods are compared on, a capture's, or a described scene's.
//!
//! Most methods want photographs that nobody took, so the scene's transport has to be
//! known: for a described scene it is simulated, one cell lit at a time, as the camera
//! sees it; for a capture it is its `reference_T.npy`, or what all its photographs
//! together tell.

use super::{GroundTruth, Rig};
use crate::benchmark::{self, Methods};
use crate::inversion::{self, Together, projector_of};
use crate::rig::clear_dead;
use iltm_capture::{
    CaptureError, CaptureOptions, Measurements, NO_CELL, NoiseModel, ReferenceError,
    SeveralCaptures, pattern_set, read_reference, read_several,
};
use iltm_picture::unfinished::TemporaryFolder;
use iltm_picture::{FramePart, progress::Progress};
use iltm_runtime::Grid;
use iltm_scene::{
    Simulation, SimulationError, SimulationOptions, VirtualCamera,
    description::{Scene, SceneError},
    folder::{self, CaptureFolderError},
};
use iltm_solve::{SolveError, SolveOptions, solve, wanted_images};
use nalgebra::{DMatrix, DVector};
use std::path::Path;
use thiserror::Error;

/// Cells of the largest grid that is compared on: every method works with whole
/// matrices.
pub const MOST_CELLS: usize = 1_024;

/// Cells lit alone that are simulated together.
const TOGETHER: usize = 64;

/// Bernoulli photographs by which a described scene's camera is registered.
const REGISTRATION: usize = 60;

/// Details of a wanted image along a side of the camera's picture, at most.
const MOST_DETAILS: u16 = 128;

/// Side of a detail of wanted images where projectors overlap, in cells. Cells of two projectors do not
/// lie on each other, so smaller details would be judged by where cells lie. Films have them in their
/// pixels, which are shared out one by one.
const DETAIL: f64 = 2.0;

/// A scene's light, cell by cell.
#[derive(Debug)]
pub struct BenchmarkScene {
    /// How the transport is known.
    pub known: &'static str,
    /// Whether there are three channels, of which it is the green one.
    pub colour: bool,
    /// What answers are judged by.
    pub truth: GroundTruth,
    /// What photographs are taken with; its noise is the camera's.
    pub rig: Rig,
    /// Columns of cells of each of several projectors; empty for one.
    parts: Vec<FramePart>,
    /// How several projectors that overlap share the light.
    together: Option<Together>,
}

/// Why there is no light to compare on.
#[derive(Debug, Error)]
pub enum BenchmarkSceneError {
    /// The photographs cannot be used.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The capture does not tell its scene's transport.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The capture's reference cannot be used.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// The scene's description cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The scene's photographs could not be written.
    #[error(transparent)]
    Folder(#[from] CaptureFolderError),
    /// There is no room for the scene's photographs.
    #[error("there is no room for temporary photographs: {0}")]
    Room(#[from] std::io::Error),
    /// More cells than methods with whole matrices can work with.
    #[error("{cells} cells; methods are compared on {MOST_CELLS} at most")]
    TooLarge {
        /// Cells of the grid.
        cells: usize,
    },
    /// The transport has no inverse.
    #[error("the scene's transport has no inverse, by which answers could be judged")]
    Singular,
}

impl BenchmarkScene {
    /// The light of a capture folder, its green channel if it has colour.
    ///
    /// # Errors
    /// [`BenchmarkSceneError`] if it cannot be read or solved.
    pub fn of_capture(
        folder: &Path,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<Self, BenchmarkSceneError> {
        let measurements = iltm_capture::read(folder, &CaptureOptions::default(), progress)?;
        check_size(measurements.grid)?;
        let inverse = solve(&measurements, &SolveOptions::default(), progress)?.inverse;
        let cells = measurements.grid.cells();
        let channel = inverse.channels.len() / 2;
        let measured = read_reference(folder, measurements.grid, inverse.channels.len())?;
        let measured = measured.and_then(|mut channels| channels.drain(channel..).next());
        let (transport, known) = if let Some(transport) = measured {
            (transport, "measured: the capture\u{2019}s reference_T.npy")
        } else {
            let light = inverse
                .channel(channel)
                .light(&DMatrix::identity(cells, cells));
            let known = "what iltm finds from all photographs of the capture, which is kind \
                         to methods that look for the same";
            (light.ok_or(BenchmarkSceneError::Singular)?, known)
        };
        Self::new(&measurements, inverse.live, transport, known, seed)
    }

    /// The light of a described scene, its green channel if it has colour.
    ///
    /// # Errors
    /// [`BenchmarkSceneError`] if it cannot be read or simulated.
    pub fn of_scene(
        file: &Path,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<Self, BenchmarkSceneError> {
        let scene = Scene::read(file)?;
        check_size(scene.grid())?;
        let simulation = Simulation::new(&scene, &SimulationOptions::default(), progress)?;
        let room = TemporaryFolder::new()?;
        let mut folders = Vec::new();
        for (index, projector) in scene.projectors.iter().enumerate() {
            let folder = room.path().join(index.to_string());
            let patterns = pattern_set(projector.grid, REGISTRATION, seed);
            let camera = VirtualCamera::new(&scene, &simulation, seed + index as u64)?;
            folder::write(&camera, Some(index), &patterns, &folder, progress)?;
            folders.push(folder);
        }
        let several = read_several(&folders, &CaptureOptions::default(), progress)?;
        let mut transport = simulated(&simulation, &several, progress)?;
        let known = "simulated without noise, one cell lit at a time";
        let (all, live) = (&several.all, several.all.live.clone());
        let parts = scene.parts();
        if !overlap(&transport, all.grid, &parts) {
            let scene = Self::new(all, live, transport, known, seed)?;
            return Ok(Self { parts, ..scene });
        }
        clear_dead(&mut transport, &live);
        let together = Together {
            overlaps: several.overlaps.clone(),
            shares: Some(several.shares_of_cells()),
        };
        let inverse = together.matrix(&transport, &live);
        let inverse = inverse.ok_or(BenchmarkSceneError::Singular)?;
        let images = images_seen(all);
        let rig = rig(all, transport.clone(), &live, seed);
        let truth = GroundTruth::of_overlapping((all.grid, transport, live), inverse, images);
        Ok(Self {
            known,
            colour: all.channels.len() > 1,
            rig,
            truth: truth.ok_or(BenchmarkSceneError::Singular)?,
            parts,
            together: Some(together),
        })
    }

    /// The methods that fit it: all, with `photographs` where one likes, or those for projectors that
    /// overlap.
    #[must_use]
    pub fn methods(&self, photographs: usize, seed: u64) -> Methods {
        match &self.together {
            Some(together) => (Vec::new(), inversion::of_overlapping(&self.parts, together)),
            None => benchmark::all(&self.parts, photographs, seed),
        }
    }

    fn new(
        measurements: &Measurements,
        live: Vec<bool>,
        mut transport: DMatrix<f64>,
        known: &'static str,
        seed: u64,
    ) -> Result<Self, BenchmarkSceneError> {
        clear_dead(&mut transport, &live);
        let grid = measurements.grid;
        let rig = rig(measurements, transport.clone(), &live, seed);
        let truth = GroundTruth::new(grid, transport, live).ok_or(BenchmarkSceneError::Singular)?;
        Ok(Self {
            known,
            colour: measurements.channels.len() > 1,
            truth,
            rig,
            parts: Vec::new(),
            together: None,
        })
    }
}

fn rig(measurements: &Measurements, transport: DMatrix<f64>, live: &[bool], seed: u64) -> Rig {
    let noise = cell_noise(measurements, live);
    Rig::new(measurements.grid, transport, live.to_vec(), noise, seed)
}

/// Wanted images that lie on the camera's picture, `N x n`: cells that overlap want the same light.
fn images_seen(measurements: &Measurements) -> DMatrix<f64> {
    let centres = &measurements.registration.centre;
    let detail = DETAIL * measurements.registration.cell_side();
    // Least and most of a coordinate, and how many details lie between them.
    let extent = |side: usize| {
        let seen = centres.iter().flatten().map(|at| at[side]);
        let (least, most) = seen.fold((f64::INFINITY, 0.0_f64), |(least, most), at| {
            (least.min(at), most.max(at))
        });
        (
            least,
            (((most - least) / detail) as u16).min(MOST_DETAILS) + 2,
        )
    };
    let ((left, cols), (top, rows)) = (extent(0), extent(1));
    let grid = Grid::new(rows, cols).expect("there are details, and few");
    let drawn = wanted_images(grid);
    DMatrix::from_fn(centres.len(), drawn.ncols(), |place, image| {
        let Some([x, y]) = centres[place] else {
            return 0.0;
        };
        let (x, y) = ((x - left) / detail, (y - top) / detail);
        let (col, row) = (
            x.min(f64::from(cols - 2)) as usize,
            y.min(f64::from(rows - 2)) as usize,
        );
        let (right, lower) = (x.fract(), y.fract());
        let at = |row: usize, col: usize| drawn[(row * grid.cols() + col, image)];
        let of_row = |row| (1.0 - right) * at(row, col) + right * at(row, col + 1);
        (1.0 - lower) * of_row(row) + lower * of_row(row + 1)
    })
}

/// Part of a cell's own light from which another projector's cell lights it directly: bounces from a
/// single cell are far less.
const DIRECT: f64 = 0.1;

/// Whether cells of one projector light another's directly. The transport is known, so it says more than
/// the photographs: a coarse camera's pixels mix cells at a corner.
fn overlap(transport: &DMatrix<f64>, grid: Grid, parts: &[FramePart]) -> bool {
    let projector = |cell: usize| projector_of(cell, grid, parts);
    (0..grid.cells()).any(|cell| {
        let own = transport[(cell, cell)];
        let lit = transport.row(cell);
        let mut others = lit
            .iter()
            .enumerate()
            .filter(|(from, _)| projector(*from) != projector(cell));
        own > 0.0 && others.any(|(_, light)| *light > DIRECT * own)
    })
}

fn check_size(grid: Grid) -> Result<(), BenchmarkSceneError> {
    let cells = grid.cells();
    if cells > MOST_CELLS {
        return Err(BenchmarkSceneError::TooLarge { cells });
    }
    Ok(())
}

/// Noise of a cell with as many pixels as most have.
fn cell_noise(measurements: &Measurements, live: &[bool]) -> NoiseModel {
    let cells = measurements.pixels.iter().zip(live);
    let mut pixels: Vec<u32> = cells.filter(|(_, l)| **l).map(|(p, _)| *p).collect();
    pixels.sort_unstable();
    let typical = f64::from(pixels.get(pixels.len() / 2).copied().unwrap_or(1).max(1));
    let channel = measurements.channels.len() / 2;
    let of_pixel = measurements.channels[channel].noise_model;
    NoiseModel {
        shot: of_pixel.shot / typical,
        floor: of_pixel.floor / typical,
    }
}

/// `T` as the camera sees it: mean light of each cell's pixels while one cell after the
/// other is lit, in the units of the measurements.
fn simulated(
    simulation: &Simulation<'_>,
    several: &SeveralCaptures,
    progress: &dyn Progress,
) -> Result<DMatrix<f64>, BenchmarkSceneError> {
    let grid = simulation.grid();
    let (cells, channel) = (grid.cells(), simulation.channels() / 2);
    // Pixels of every projector's cells: where pictures overlap, a pixel is of several.
    let mut labels = Vec::new();
    for projector in &several.projectors {
        let (own, part) = (&projector.own, &projector.part);
        let seen = own.registration.cell_of_pixel.iter().enumerate();
        labels.extend(
            seen.filter(|(_, cell)| **cell != NO_CELL)
                .map(|(pixel, cell)| (pixel, part.place(grid.cols(), *cell as usize))),
        );
    }
    let means = |photograph: &[f32]| {
        let mut sums = vec![(0.0, 0_u32); cells];
        for (pixel, cell) in &labels {
            let (sum, count) = &mut sums[*cell];
            *sum += f64::from(photograph[*pixel]);
            *count += 1;
        }
        sums.into_iter()
            .map(|(sum, count)| sum / f64::from(count.max(1)))
    };
    let black = simulation.expose(&DMatrix::zeros(cells, 1))?;
    let black: Vec<f64> = means(&simulation.photograph(&black, 0)[channel]).collect();
    let mut transport = DMatrix::zeros(cells, cells);
    progress.begin("lighting one cell at a time", cells as u64);
    for first in (0..cells).step_by(TOGETHER) {
        let count = TOGETHER.min(cells - first);
        let lit = DMatrix::from_fn(cells, count, |cell, k| {
            f64::from(u8::from(cell == first + k))
        });
        let exposed = simulation.expose(&lit)?;
        for k in 0..count {
            let light = means(&simulation.photograph(&exposed, k)[channel]);
            let mut column = transport.column_mut(first + k);
            for (value, (light, black)) in column.iter_mut().zip(light.zip(&black)) {
                *value = light - black;
            }
        }
        progress.advance(count as u64);
    }
    progress.end();
    // The camera's exposure: the same flood light, as measured and as simulated.
    let channels = &several.all.channels;
    let measured = &channels[channels.len() / 2].observations;
    let whites = several.projectors.iter().map(|projector| {
        let white = projector.views.start + Measurements::WHITE;
        measured.column(white).into_owned()
    });
    let white: DVector<f64> = whites.sum();
    let flood = transport.column_sum();
    let exposure = white.dot(&flood) / flood.norm_squared();
    if !exposure.is_finite() {
        return Err(BenchmarkSceneError::Singular);
    }
    Ok(transport * exposure)
}
