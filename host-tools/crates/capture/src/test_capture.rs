//! Small simulated captures for tests: a flat grid in front of a camera that
//! does not line up with it, with bounced light, ambient light and noise.

use iltm_capture::{CaptureOptions, Code, CodeAxis, Manifest, Measurements, Pattern, Role};
use iltm_picture::progress::Silent;
use iltm_runtime::Grid;
use image::{ExtendedColorType, ImageBuffer, Luma};
use std::path::Path;
use tempfile::TempDir;

/// Repeatable random numbers (xorshift64*, Vigna 2016).
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed | 1 << 40)
    }

    /// Uniform in 0 to 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Standard normal: twelve uniforms, exact in mean and variance.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A simulated scene and how it is photographed.
#[derive(Clone, Debug)]
pub(crate) struct TestCapture {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    /// Camera pixels along a cell's side; need not be whole.
    pub(crate) pitch: f64,
    /// Camera pixels between the picture's border and the grid.
    pub(crate) margin: f64,
    /// Camera pixels over which a cell's border is blurred.
    pub(crate) blur: f64,
    /// Light of one cell on its own patch, of full scale.
    pub(crate) direct: f64,
    /// Light of one cell on each other patch and beside the grid.
    pub(crate) bounced: f64,
    pub(crate) ambient: f64,
    /// Standard deviation of a camera pixel.
    pub(crate) noise: f64,
    pub(crate) bernoulli: usize,
    /// Exposures at which each pattern is photographed; one without a name if empty.
    pub(crate) times: Vec<f64>,
    /// Photographs of white and of black each.
    pub(crate) repeats: usize,
    /// Number of the first column and of the first row in the Gray code.
    pub(crate) offset: [usize; 2],
    /// Gain of each channel, 1 or 3.
    pub(crate) gains: Vec<f64>,
    /// Full scale of the files, 255 or 65535.
    pub(crate) full_scale: u16,
    /// From light to the value in the file.
    pub(crate) encode: fn(f64) -> f64,
    /// Albedo at a place in cell coordinates (row, column), relative.
    pub(crate) albedo: fn(f64, f64) -> f64,
}

impl Default for TestCapture {
    fn default() -> Self {
        Self {
            rows: 5,
            cols: 6,
            pitch: 6.3,
            margin: 4.4,
            blur: 1.0,
            direct: 0.5,
            bounced: 0.005,
            ambient: 0.02,
            noise: 0.004,
            bernoulli: 30,
            times: Vec::new(),
            repeats: 1,
            offset: [0; 2],
            gains: vec![1.0],
            full_scale: u16::MAX,
            encode: |light| light,
            albedo: |_, _| 1.0,
        }
    }
}

impl TestCapture {
    pub(crate) fn grid(&self) -> Grid {
        Grid::new(self.rows as u16, self.cols as u16).unwrap()
    }

    /// Width and height of a photograph.
    pub(crate) fn camera(&self) -> (usize, usize) {
        let side = |cells: usize| (2.0 * self.margin + self.pitch * cells as f64).ceil() as usize;
        (side(self.cols), side(self.rows))
    }

    /// Share of camera pixel `at`, widened to the blur, that lies in cell `index`,
    /// along one axis.
    pub(crate) fn overlap(&self, at: usize, index: usize) -> f64 {
        let from = self.margin + self.pitch * index as f64;
        let centre = at as f64 + 0.5;
        let (low, high) = (centre - 0.5 * self.blur, centre + 0.5 * self.blur);
        (high.min(from + self.pitch) - low.max(from)).max(0.0) / self.blur
    }

    /// Every pattern with its role, in the order it is shown.
    pub(crate) fn patterns(&self) -> Vec<(Role, Pattern)> {
        let grid = self.grid();
        let code = |cells: usize, offset: usize| Code {
            bits: (cells + offset).next_power_of_two().trailing_zeros() as u8,
            offset,
        };
        let sides = [(self.cols, self.offset[0]), (self.rows, self.offset[1])];
        let codes = sides.map(|(cells, offset)| code(cells, offset));
        let mut roles = [Role::White, Role::Black].repeat(self.repeats);
        for inverse in [false, true] {
            for (axis, code) in [CodeAxis::Column, CodeAxis::Row].into_iter().zip(codes) {
                roles.extend((0..code.bits).map(|bit| axis.stripe(bit, inverse)));
            }
        }
        let coded = roles.into_iter().map(|role| {
            let pattern = Pattern::of_codes((self.rows, self.cols), role, codes);
            (role, pattern.unwrap())
        });
        let mut dice = Dice::new(1);
        let random = (0..self.bernoulli).map(|_| {
            let lit = (0..grid.cells()).map(|_| dice.uniform() < 0.5).collect();
            let (rows, cols) = (self.rows, self.cols);
            (Role::Bernoulli, Pattern { rows, cols, lit })
        });
        coded.chain(random).collect()
    }

    /// Light in every pixel under a pattern, before the channel's gain and noise.
    pub(crate) fn light(&self, pattern: &Pattern) -> Vec<f64> {
        let (width, height) = self.camera();
        let far = pattern.lit.iter().filter(|&&lit| lit).count() as f64 * self.bounced;
        let pixel = |at: usize| {
            let (x, y) = (at % width, at / width);
            let mut light = self.ambient + far;
            for (cell, _) in pattern.lit.iter().enumerate().filter(|(_, lit)| **lit) {
                let (row, col) = (cell / self.cols, cell % self.cols);
                light += (self.direct - self.bounced) * self.overlap(y, row) * self.overlap(x, col);
            }
            let place = |at: usize| (at as f64 + 0.5 - self.margin) / self.pitch;
            light * (self.albedo)(place(y), place(x))
        };
        (0..width * height).map(pixel).collect()
    }

    /// Writes the capture into a folder and returns its manifest.
    pub(crate) fn write(&self, folder: &Path) -> Manifest {
        for part in ["patterns", "photos"] {
            std::fs::create_dir_all(folder.join(part)).unwrap();
        }
        let times: Vec<Option<f64>> = match self.times.as_slice() {
            [] => vec![None],
            times => times.iter().copied().map(Some).collect(),
        };
        let (mut dice, mut roles) = (Dice::new(2), Vec::new());
        let patterns = self.patterns();
        for (role, _) in &patterns {
            roles.extend(times.iter().map(|_| *role));
        }
        let mut manifest = Manifest::numbered("patterns", (0..).zip(roles));
        for (at, shot) in manifest.shots.iter_mut().enumerate() {
            let (_, pattern) = &patterns[at / times.len()];
            shot.exposure = times[at % times.len()];
            let time = shot.exposure.unwrap_or(1.0);
            let light: Vec<f64> = self.light(pattern).iter().map(|l| time * l).collect();
            save_pattern(pattern, &folder.join(&shot.pattern));
            self.save_photo(&light, &mut dice, &folder.join(&shot.photo));
        }
        std::fs::write(folder.join(iltm_capture::MANIFEST_FILE), manifest.to_csv()).unwrap();
        manifest
    }

    fn save_photo(&self, light: &[f64], dice: &mut Dice, path: &Path) {
        let (width, height) = self.camera();
        let full = f64::from(self.full_scale);
        let mut value = |light: f64| {
            let noisy = (light + self.noise * dice.normal()).clamp(0.0, 1.0);
            ((self.encode)(noisy) * full).round() as u16
        };
        let values = light
            .iter()
            .flat_map(|&light| self.gains.iter().map(move |gain| gain * light))
            .map(&mut value);
        let (bytes, colour): (Vec<u8>, _) = if self.full_scale == 255 {
            let colours = [ExtendedColorType::L8, ExtendedColorType::Rgb8];
            (values.map(|value| value as u8).collect(), colours)
        } else {
            let colours = [ExtendedColorType::L16, ExtendedColorType::Rgb16];
            (values.flat_map(u16::to_ne_bytes).collect(), colours)
        };
        let colour = colour[self.gains.len() / 3];
        image::save_buffer(path, &bytes, width as u32, height as u32, colour).unwrap();
    }

    /// Writes the capture into a new folder.
    pub(crate) fn folder(&self) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        folder
    }

    /// Writes the capture into a new folder and reads it.
    pub(crate) fn read(&self) -> Measurements {
        let folder = self.folder();
        iltm_capture::read(folder.path(), &CaptureOptions::default(), &Silent).unwrap()
    }
}

/// Writes a pattern as `iltm patterns` does.
pub(crate) fn save_pattern(pattern: &Pattern, path: &Path) {
    let values = pattern.lit.iter().map(|&lit| 255 * u8::from(lit)).collect();
    let (width, height) = (pattern.cols as u32, pattern.rows as u32);
    let picture = ImageBuffer::<Luma<u8>, Vec<u8>>::from_raw(width, height, values).unwrap();
    picture.save(path).unwrap();
}
