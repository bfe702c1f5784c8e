//! The folder of a separated photograph: numbers for programs, pictures for people.
//!
//! ```text
//! bounces.html     all pictures, as they are and brightened, complete in itself
//! bounces.csv      a line a layer: shares of light and energy, brightness, noise
//! bounces.npy      the layers, float32, rows x columns x channels x layers
//! photograph.png   16 bits, 65,535 is the camera's full scale, black subtracted
//! bounce-1.png     the same scale: direct light; then bounce-2.png and so on
//! rest.png, unseparated.png
//! ```

use super::Bounces;
use super::page::page;
use super::separate::{Layer, LayerKind, Separated};
use crate::frame_size;
use iltm_picture::{FolderError, Picture, Samples, WholeFolder, npy, png};
use rayon::prelude::*;
use std::fmt::Write;
use std::io;
use std::path::Path;

impl LayerKind {
    /// Its name in files and data.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Bounce(k) => format!("bounce-{k}"),
            Self::Rest => "rest".to_owned(),
            Self::Unseparated => "unseparated".to_owned(),
        }
    }
}

/// The page's name in the folder.
pub const PAGE: &str = "bounces.html";

/// A file and what it is of.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FileOf {
    /// Its name in the folder.
    pub name: String,
    /// What it shows, in a few words.
    pub what: &'static str,
}

/// What was written.
#[derive(Clone, PartialEq, Debug)]
pub struct WrittenBounces {
    /// The files, those for people first.
    pub files: Vec<FileOf>,
    /// Largest difference between the photograph and the sum of what the 16-bit
    /// pictures hold, camera units: they are rounded, and negative light is black in
    /// them.
    pub largest_gap_of_pictures: f64,
    /// Largest difference between the photograph and the sum of the layers in
    /// `bounces.npy`, camera units.
    pub largest_gap: f64,
}

/// Whether [`write()`] writes files of this name.
#[must_use]
pub fn is_own(name: &str) -> bool {
    let picture = name.strip_suffix(".png");
    let bounce = picture.and_then(|name| name.strip_prefix("bounce-"));
    [PAGE, "bounces.csv", "bounces.npy"].contains(&name)
        || picture.is_some_and(|name| ["photograph", "rest", "unseparated"].contains(&name))
        || bounce.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Writes a separated photograph into the folder `out`: beside its place first, then
/// renamed, so that it is whole or not there. An earlier one is replaced.
///
/// # Errors
/// [`FolderError`] if something else is in its place or it cannot be written.
pub fn write(bounces: &Bounces, out: &Path) -> Result<WrittenBounces, FolderError> {
    let made = WholeFolder::replace(out, is_own)?;
    let separated = &bounces.separated;
    let mut files = Vec::new();
    let mut add = |name: &str, what, bytes: Vec<u8>| {
        files.push(FileOf {
            name: name.to_owned(),
            what,
        });
        made.file(name, bytes)
    };
    if let Some(page) = page(bounces) {
        add(PAGE, "all pictures, for people", page.into_bytes())?;
    }
    add(
        "bounces.csv",
        "shares and brightness",
        csv(bounces).into_bytes(),
    )?;
    add("bounces.npy", "the layers as numbers", array(separated))?;
    let (photograph, _) = sixteen_bits(separated.size, &separated.photograph)?;
    add("photograph.png", "the photograph", png::encode(&photograph))?;
    let mut sums = vec![0.0_f64; photograph.samples().len()];
    let pictures: Vec<_> = separated
        .layers
        .par_iter()
        .map(|layer| sixteen_bits(separated.size, &layer.planes))
        .collect();
    for (layer, picture) in separated.layers.iter().zip(pictures) {
        let (picture, light) = picture?;
        for (sum, light) in sums.iter_mut().zip(light) {
            *sum += light;
        }
        let name = format!("{}.png", layer.kind.name());
        add(&name, described(layer), png::encode(&picture))?;
    }
    made.finish()?;
    Ok(WrittenBounces {
        files,
        largest_gap_of_pictures: gap(&separated.photograph, &sums),
        largest_gap: separated.largest_gap(),
    })
}

fn described(layer: &Layer) -> &'static str {
    match layer.kind {
        LayerKind::Bounce(1) => "direct light",
        LayerKind::Bounce(_) => "light reflected so many times",
        LayerKind::Rest => "all further bounces",
        LayerKind::Unseparated => "light where no cell was solved for",
    }
}

/// A picture of light in camera units and the light that its codes stand for, the
/// channels of a pixel side by side.
fn sixteen_bits(
    (width, height): (usize, usize),
    planes: &[Vec<f32>],
) -> Result<(Picture, Vec<f64>), FolderError> {
    let full = f64::from(u16::MAX);
    let code = |light: f32| (f64::from(light).clamp(0.0, 1.0) * full).round() as u16;
    let pixels = 0..width * height;
    let codes: Vec<u16> = pixels
        .flat_map(|pixel| planes.iter().map(move |plane| code(plane[pixel])))
        .collect();
    let light = codes.iter().map(|code| f64::from(*code) / full).collect();
    let size = frame_size(width, height);
    let picture = size.and_then(|size| Picture::new(size, Samples::Sixteen(codes)));
    let picture = picture.ok_or_else(|| FolderError::Io {
        path: "photograph.png".into(),
        source: io::Error::other("a picture of this size cannot be written"),
    })?;
    Ok((picture, light))
}

/// Largest difference between planes and values with the channels side by side.
fn gap(planes: &[Vec<f32>], values: &[f64]) -> f64 {
    let channels = planes.len();
    let of_channel = |(channel, plane): (usize, &Vec<f32>)| {
        let own = values.iter().skip(channel).step_by(channels);
        let differences = plane
            .iter()
            .zip(own)
            .map(|(a, b)| (f64::from(*a) - b).abs());
        differences.fold(0.0, f64::max)
    };
    planes
        .iter()
        .enumerate()
        .map(of_channel)
        .fold(0.0, f64::max)
}

fn csv(bounces: &Bounces) -> String {
    let mut text = String::from(
        "layer,light_share,energy_share,rms,brightest,darkest,noise_of_a_cell,noise_of_a_pixel\n",
    );
    for layer in &bounces.separated.layers {
        let Layer {
            light_share,
            energy_share,
            rms,
            brightest,
            darkest,
            ..
        } = layer;
        let (name, noise) = (layer.kind.name(), bounces.noise);
        let (cell, pixel) = (noise.cell, noise.pixel);
        let _ = writeln!(
            text,
            "{name},{light_share:.9},{energy_share:.9},{rms:.9},{brightest:.9},{darkest:.9},{cell:.9},{pixel:.9}"
        );
    }
    text
}

/// `rows x columns x channels x layers`, float32.
fn array(separated: &Separated) -> Vec<u8> {
    let (width, height) = separated.size;
    let (channels, layers) = (separated.photograph.len(), separated.layers.len());
    let mut values = Vec::with_capacity(width * height * channels * layers);
    for pixel in 0..width * height {
        for channel in 0..channels {
            let layers = separated.layers.iter();
            values.extend(layers.map(|layer| layer.planes[channel][pixel]));
        }
    }
    npy::write(&[height, width, channels, layers], &values)
}
