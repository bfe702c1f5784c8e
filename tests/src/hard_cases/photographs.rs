//! Camera: whole captures of a [`CoaxialScene`], written as files: each cell is a square of
//! camera pixels.

use crate::hard_cases::observations::{normal, sequence};
use iltm::capture::{MANIFEST_FILE, Manifest, Role, Shot};
use iltm::scene::coaxial::CoaxialScene;
use image::{ImageBuffer, Luma};
use nalgebra::DMatrix;
use std::path::Path;

/// Camera pixels along a cell's side.
const PITCH: usize = 6;
/// Camera pixels between the picture's border and the frame.
const MARGIN: usize = 5;

/// How a camera takes pictures.
#[derive(Clone, Copy, Debug)]
pub struct TestCamera {
    /// Value of the brightest cell under white; above 1 it is saturated.
    pub exposure: f64,
    /// Standard deviation of a pixel, of full scale.
    pub noise: f64,
    /// Largest value in the file, 255 or 65535.
    pub full_scale: u16,
    /// Values in the file are light to the power of `1 / gamma`.
    pub gamma: f64,
    /// Random patterns.
    pub bernoulli: usize,
}

impl Default for TestCamera {
    fn default() -> Self {
        Self {
            exposure: 0.8,
            noise: 0.002,
            full_scale: u16::MAX,
            gamma: 1.0,
            bernoulli: 60,
        }
    }
}

impl TestCamera {
    /// Writes the capture of a scene into a folder that exists; `settings` is its
    /// `capture.toml`.
    ///
    /// # Errors
    /// What cannot be written.
    pub fn write(
        &self,
        scene: &CoaxialScene,
        folder: &Path,
        settings: &str,
    ) -> Result<(), image::ImageError> {
        for part in ["patterns", "photos"] {
            std::fs::create_dir_all(folder.join(part))?;
        }
        let (patterns, roles) = sequence(scene.grid, self.bernoulli, 1);
        let black = DMatrix::zeros(scene.grid.cells(), 1);
        let mut shots = Vec::new();
        let transport = scene.transport();
        let flood = (&transport * DMatrix::from_element(scene.grid.cells(), 1, 1.0)).max();
        let mut random = fastrand::Rng::with_seed(2);
        let all = roles
            .iter()
            .copied()
            .zip(patterns.column_iter().map(nalgebra::Matrix::into_owned));
        let all = std::iter::once((Role::Black, black.column(0).into_owned())).chain(all);
        for (index, (role, pattern)) in (0..).zip(all) {
            let shot = Shot {
                index,
                role,
                pattern: format!("patterns/{index:03}.png").into(),
                photo: format!("photos/{index:03}.png").into(),
                exposure: None,
                line: u64::from(index) + 2,
            };
            let (rows, cols) = (scene.grid.rows(), scene.grid.cols());
            let shown: ImageBuffer<Luma<u8>, _> =
                ImageBuffer::from_fn(cols as u32, rows as u32, |x, y| {
                    Luma([if pattern[y as usize * cols + x as usize] > 0.5 {
                        255
                    } else {
                        0
                    }])
                });
            shown.save(folder.join(&shot.pattern))?;
            let light = &transport * pattern * (self.exposure / flood);
            let side = |cells: usize| (2 * MARGIN + PITCH * cells) as u32;
            let value = |x: u32, y: u32, random: &mut fastrand::Rng| {
                let cell = |at: u32, cells: usize| {
                    (at as usize)
                        .checked_sub(MARGIN)
                        .map(|at| at / PITCH)
                        .filter(|at| *at < cells)
                };
                let seen = match (cell(y, rows), cell(x, cols)) {
                    (Some(row), Some(col)) => light[row * cols + col],
                    _ => 0.0,
                };
                let value = (seen + 0.01 + self.noise * normal(random)).clamp(0.0, 1.0);
                (value.powf(1.0 / self.gamma) * f64::from(self.full_scale)).round() as u16
            };
            let path = folder.join(&shot.photo);
            if self.full_scale == 255 {
                let photo: ImageBuffer<Luma<u8>, _> =
                    ImageBuffer::from_fn(side(cols), side(rows), |x, y| {
                        Luma([value(x, y, &mut random) as u8])
                    });
                photo.save(path)?;
            } else {
                let photo: ImageBuffer<Luma<u16>, _> =
                    ImageBuffer::from_fn(side(cols), side(rows), |x, y| {
                        Luma([value(x, y, &mut random)])
                    });
                photo.save(path)?;
            }
            shots.push(shot);
        }
        std::fs::write(folder.join(MANIFEST_FILE), Manifest { shots }.to_csv())?;
        std::fs::write(folder.join("capture.toml"), settings)?;
        Ok(())
    }
}
