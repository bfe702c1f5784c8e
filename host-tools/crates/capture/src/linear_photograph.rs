//! Linear photograph: one photograph of a capture as light, for whoever wants to look at it
//! rather than to solve from it.

use crate::devices::Devices;
use crate::format::error::CaptureError;
use crate::format::manifest::{MANIFEST_FILE, Manifest, Shot};
use crate::format::photo_files::resolve;
use crate::format::role::Role;
use crate::format::settings::Settings;
use crate::photographs::Photographs;
use iltm_picture::progress::Progress;
use std::path::Path;

/// The light of one photograph, or of all photographs of white.
#[derive(Clone, PartialEq, Debug)]
pub struct LinearPhotograph {
    /// Its line in the manifest; the first of white.
    pub shot: Shot,
    /// Photographs averaged: all of white, or the one that was asked for.
    pub averaged: usize,
    /// Photographs of black averaged.
    pub blacks: usize,
    /// Width and height in pixels, those of a [`Registration`](crate::Registration).
    pub size: (usize, usize),
    /// Light with black subtracted, one plane a channel, row by row, camera units.
    pub planes: Vec<Vec<f32>>,
    /// What was subtracted, the same way.
    pub black: Vec<Vec<f32>>,
    /// Pixels at the camera's full scale, whose light is not known.
    pub saturated: Vec<bool>,
}

impl LinearPhotograph {
    /// Reads the photograph `index` of a capture; the mean of all photographs of
    /// white if there is no index.
    ///
    /// # Errors
    /// [`CaptureError::Asked`] if there is no such index or it is one of black;
    /// [`CaptureError::NoBlack`] and [`CaptureError::NoWhite`] if there is none; a
    /// photograph's own error.
    pub fn read(
        folder: &Path,
        index: Option<u32>,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        Self::read_by(folder, index, None, progress)
    }

    /// The same in the light that measured `devices` say: with the camera's measured
    /// response, and of the projector's channels where the camera mixes them. That is
    /// the light that an inverse of the capture means.
    ///
    /// # Errors
    /// Those of [`LinearPhotograph::read`].
    pub fn read_as(
        folder: &Path,
        index: Option<u32>,
        devices: &Devices,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        Self::read_by(folder, index, Some(devices), progress)
    }

    fn read_by(
        folder: &Path,
        index: Option<u32>,
        devices: Option<&Devices>,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        let mut shots = Manifest::read(folder)?.shots;
        let settings = Settings::read(folder)?;
        let chosen = choose(&shots, index, &folder.join(MANIFEST_FILE))?;
        resolve(folder, &mut shots)?;
        let black = of_role(&shots, Role::Black);
        if black.is_empty() {
            let path = folder.join(MANIFEST_FILE);
            return Err(CaptureError::NoBlack { path });
        }
        let mut reading = settings.camera.reading();
        if let Some(devices) = devices {
            reading.response = devices.camera.clone();
        }
        let mut photographs = Photographs::new(folder, &shots, &reading)?;
        if let Some(inverse) = devices.and_then(Devices::unmixing) {
            photographs.unmix(inverse);
        }
        let count = (chosen.len() + black.len()) as u64;
        progress.begin("reading the photograph", count);
        let (black_light, _) = photographs.mean(&black, progress)?;
        let (mut planes, saturated) = photographs.mean(&chosen, progress)?;
        progress.end();
        for (plane, black) in planes.iter_mut().zip(&black_light) {
            for (light, black) in plane.iter_mut().zip(black) {
                *light -= black;
            }
        }
        Ok(Self {
            shot: shots[chosen[0]].clone(),
            averaged: chosen.len(),
            blacks: black.len(),
            size: (photographs.format.width, photographs.format.height),
            planes,
            black: black_light,
            saturated,
        })
    }
}

fn of_role(shots: &[Shot], role: Role) -> Vec<usize> {
    let all = 0..shots.len();
    all.filter(|at| shots[*at].role == role).collect()
}

/// The photographs meant, at least one, as indices into `shots`.
fn choose(shots: &[Shot], index: Option<u32>, manifest: &Path) -> Result<Vec<usize>, CaptureError> {
    let path = || manifest.to_owned();
    let Some(index) = index else {
        let white = of_role(shots, Role::White);
        if white.is_empty() {
            return Err(CaptureError::NoWhite { path: path() });
        }
        return Ok(white);
    };
    let asked = |line: String, reason| CaptureError::Asked {
        place: format!("{}{line}", manifest.display()),
        reason,
        next_step: "Choose another index from the first column of capture.csv, or leave it out for \
             white.",
    };
    let Some(at) = shots.iter().position(|shot| shot.index == index) else {
        let last = shots.last().map_or(0, |shot| shot.index);
        let reason =
            format!("there is no photograph with the index {index}; the last one is {last}");
        return Err(asked(String::new(), reason));
    };
    if shots[at].role == Role::Black {
        let reason = format!(
            "the photograph with the index {index} is of black: it shows the ambient light, which \
             is subtracted from every other, and nothing of the projector's"
        );
        return Err(asked(format!(", line {}", shots[at].line), reason));
    }
    Ok(vec![at])
}
