//! Chain of `iltm simulate --photograph --chain`: what player, device and projector make of
//! slides before the scene is lit.

use super::failure::{Failure, Kind};
use super::tables::check;
use crate::capture::Settings;
use crate::session::{Layout, slide_name};
use crate::video::{CompensateOptions, Compensator, VideoError};
use iltm_picture::{Picture, Response, Samples, foreign_file, png};
use iltm_runtime::{FrameSize, Grid};
use std::io::BufReader;
use std::path::Path;
use std::str::FromStr;

/// What a chain does to slides.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Chain {
    /// It shows them as they are.
    Off,
    /// It compensates them.
    Once,
    /// It compensates them twice.
    Twice,
    /// It compensates them and exchanges left and right.
    Mirrored,
    /// It compensates them and moves them right by so many pixels.
    Shifted(f64),
    /// It compensates them and scales them about the middle.
    Scaled(f64),
}

impl FromStr for Chain {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, size) = text.split_once('=').unwrap_or((text, ""));
        let size = size.parse::<f64>().ok().filter(|size| size.is_finite());
        match (name, size) {
            ("off", None) => Ok(Self::Off),
            ("once", None) => Ok(Self::Once),
            ("twice", None) => Ok(Self::Twice),
            ("mirrored", None) => Ok(Self::Mirrored),
            ("shifted", Some(pixels)) => Ok(Self::Shifted(pixels)),
            ("scaled", Some(factor)) if factor > 0.0 => Ok(Self::Scaled(factor)),
            _ => {
                Err("it is off, once, twice, mirrored, shifted=PIXELS or scaled=FACTOR".to_owned())
            }
        }
    }
}

/// What the projector is given in each cell for the slides of a folder.
pub(super) struct ChainedSlides<'a> {
    pub(super) folder: &'a Path,
    pub(super) chain: Chain,
    /// The bytes of the table that compensates, and its file.
    pub(super) table: &'a [u8],
    pub(super) path: &'a Path,
    pub(super) grid: Grid,
    /// Of the projector.
    pub(super) response: Response,
}

impl ChainedSlides<'_> {
    /// Input codes of every cell for the slides of these indices.
    pub(super) fn codes(&self, indices: &[u32]) -> Result<Vec<Vec<[u8; 3]>>, Failure> {
        let table = check(self.path, self.table)?;
        let compensator = Compensator::new(&table, CompensateOptions::default())?;
        let settings = Settings::read(self.folder)?;
        let refuse = |what: &str| {
            Failure::new(
                Kind::Capture,
                format!("{}: {what}", self.folder.display()),
                "Make the folder anew with `iltm verify TABLE.iltm -o FOLDER`.",
            )
        };
        let size = settings.projector.size;
        let size = size.and_then(|[width, height]| FrameSize::new(width, height));
        let size = size.ok_or_else(|| refuse("its capture.toml names no projector.size"))?;
        let layout = Layout::new(self.grid, size, settings.projector.border)?;
        let times = match self.chain {
            Chain::Off => 0,
            Chain::Twice => 2,
            _ => 1,
        };
        let of_slide = |index: &u32| {
            let path = self.folder.join(slide_name(*index));
            let read = |source| VideoError::File {
                path: path.clone(),
                source,
            };
            let file = BufReader::new(foreign_file::open(&path).map_err(read)?);
            let mut slide = png::read(file).map_err(VideoError::Png)?;
            for _ in 0..times {
                let mut inner = layout.unframed(&slide).ok_or_else(|| {
                    refuse("its slides have another size than its capture.toml says")
                })?;
                compensator.picture(&mut inner)?;
                slide = layout.framed(&inner).unwrap_or(slide);
            }
            let shown = self.warped(&slide);
            let light = layout.cell_light(&shown, self.response);
            let light = light.ok_or_else(|| refuse("its slides have not 8 bits"))?;
            let code = |light: f64| (255.0 * self.response.value(light)).round() as u8;
            let cell =
                |cell: usize| [0, 1, 2].map(|channel| code(light[channel % light.len()][cell]));
            Ok((0..self.grid.cells()).map(cell).collect())
        };
        indices.iter().map(of_slide).collect()
    }

    /// The picture as it leaves the projector.
    fn warped(&self, slide: &Picture) -> Picture {
        let (size, channels) = (slide.size(), slide.channels());
        let (width, height) = (size.width() as f64, size.height() as f64);
        let Samples::Eight(codes) = slide.samples() else {
            return slide.clone();
        };
        let from = |x: f64, y: f64| match self.chain {
            Chain::Mirrored => (width - 1.0 - x, y),
            Chain::Shifted(pixels) => (x - pixels, y),
            Chain::Scaled(factor) => (
                (x + 0.5 - width / 2.0) / factor + width / 2.0 - 0.5,
                (y + 0.5 - height / 2.0) / factor + height / 2.0 - 0.5,
            ),
            Chain::Off | Chain::Once | Chain::Twice => (x, y),
        };
        Picture::of_codes(size, channels, |pixel, channel| {
            let (x, y) = from((pixel % size.width()) as f64, (pixel / size.width()) as f64);
            let (x, y) = (x.round(), y.round());
            let inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
            let at = (y as usize * size.width() + x as usize) * channels + channel;
            if inside {
                codes.get(at).copied().unwrap_or(0)
            } else {
                0
            }
        })
    }
}
