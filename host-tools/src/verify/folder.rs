//! Writes the folder of pictures that a table is verified with.

use super::images::test_images;
use super::response::ProjectorCurves;
use super::role::{VERIFY_FILE, VerifyManifest, VerifyRole, VerifyShot};
use super::{TestImage, VerifyError};
use crate::capture::{Pattern, Role, SETTINGS_FILE, Settings, shown};
use crate::progress::Progress;
use crate::scene::folder::{FolderError, beside, put_in_place};
use crate::video::{Compensator, Picture, Samples, VideoError, png};
use iltm_runtime::FrameSize;
use iltm_runtime::image::Table;
use rayon::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

/// What stands in the folder for whoever takes the photographs.
const README: &str = include_str!("README.txt");

/// Where the cells lie on the projector's chip.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Layout {
    /// The projector's resolution.
    pub projector: FrameSize,
    /// Pixels left black on each side.
    pub border: u16,
}

impl Layout {
    /// Where nothing else is known.
    pub const DEFAULT: Self = Self {
        projector: match FrameSize::new(1920, 1080) {
            Some(size) => size,
            None => unreachable!(),
        },
        border: 0,
    };

    /// Pixels of the cells together; `None` if the border leaves none.
    fn cells(self) -> Option<FrameSize> {
        let side =
            |side: usize| u16::try_from(side.checked_sub(2 * usize::from(self.border))?).ok();
        FrameSize::new(
            side(self.projector.width())?,
            side(self.projector.height())?,
        )
    }
}

/// What was written.
#[derive(Clone, Debug)]
pub struct Written {
    /// Pictures to project, each of which is photographed once.
    pub pictures: usize,
    /// The test images.
    pub images: Vec<TestImage>,
}

/// A picture to project.
struct Slide {
    role: VerifyRole,
    /// One pixel a cell.
    cells: Picture,
    /// What the projector is sent within the border.
    full: Picture,
}

/// Writes the folder `out`, whole or not at all: for each test image the picture as it is
/// and as `table` compensates it, white, black and a Gray code.
///
/// # Errors
/// [`VerifyError::Folder`] if something is in its place or it cannot be written,
/// [`VerifyError::Video`] if a frame of the projector's size is smaller than the grid.
pub fn write(
    table: &Table<'_>,
    layout: Layout,
    settings: &Settings,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Written, VerifyError> {
    let smaller = VideoError::SmallerThanGrid {
        frame: layout.projector,
        grid: table.grid(),
    };
    let size = layout.cells().filter(|size| size.holds(table.grid()));
    let size = size.ok_or(smaller)?;
    let images = test_images(table)?;
    let folder = beside(out)?;
    for name in ["patterns", "slides", "photos", "wanted"] {
        let path = folder.path().join(name);
        fs::create_dir(&path).map_err(|source| FolderError::Io { path, source })?;
    }
    let slides = slides(table, size, &images)?;
    progress.begin("writing the pictures", slides.len() as u64);
    let written = slides.par_iter().enumerate().map(|(index, slide)| {
        let [pattern, shown, _] = names(index);
        save(&folder.path().join(pattern), &slide.cells)?;
        let bordered = bordered(&slide.full, layout);
        save(&folder.path().join(shown), &bordered)?;
        progress.advance(1);
        Ok(())
    });
    written.collect::<Result<Vec<()>, VerifyError>>()?;
    for (image, test) in images.iter().enumerate() {
        save(&folder.path().join(wanted_file(image as u8)), &test.wanted)?;
    }
    let shots = slides.iter().enumerate().map(|(index, slide)| {
        let [pattern, _, photo] = names(index);
        VerifyShot {
            index: index as u32,
            role: slide.role,
            pattern,
            photo,
            exposure: None,
            line: index as u64 + 2,
        }
    });
    let manifest = VerifyManifest {
        shots: shots.collect(),
    };
    let texts = [
        (VERIFY_FILE, manifest.to_csv()),
        // Numbers and strings always have a TOML form.
        (SETTINGS_FILE, toml::to_string(settings).unwrap_or_default()),
        (
            "README.md",
            README.replace("PHOTOGRAPHS", &slides.len().to_string()),
        ),
    ];
    for (name, text) in texts {
        let path = folder.path().join(name);
        fs::write(&path, text).map_err(|source| FolderError::Io { path, source })?;
    }
    put_in_place(folder, out)?;
    progress.end();
    Ok(Written {
        pictures: slides.len(),
        images,
    })
}

/// Where the wanted light of a test image stands, relative to the folder: sRGB codes.
pub(super) fn wanted_file(image: u8) -> PathBuf {
    Path::new("wanted").join(format!("{image}.png"))
}

/// Pattern, slide and photograph of an index, relative to the folder.
fn names(index: usize) -> [PathBuf; 3] {
    ["patterns", "slides", "photos"].map(|name| Path::new(name).join(format!("{index:03}.png")))
}

/// All pictures in the order in which they are shown: white and black also in the middle
/// and at the end, so that a lamp that changes meanwhile is noticed.
fn slides(
    table: &Table<'_>,
    size: FrameSize,
    images: &[TestImage],
) -> Result<Vec<Slide>, VideoError> {
    let curves = ProjectorCurves::new(table);
    let compensator = Compensator::new(table, crate::video::Settings::default())?;
    let code = |(role, pattern): &(Role, Pattern)| {
        let cells = of_pattern(pattern);
        let full = enlarged(&cells, size);
        let role = VerifyRole::Code(*role);
        Slide { role, cells, full }
    };
    let more = std::env::var("ILTM_B")
        .ok()
        .and_then(|t| t.parse().ok())
        .unwrap_or(0);
    let coded = shown(table.grid(), more, 0);
    let ends = || coded.iter().take(2).map(code);
    let mut slides: Vec<Slide> = coded.iter().map(code).collect();
    slides.extend(ends());
    for (image, test) in (0..).zip(images) {
        let plain = plain(&test.wanted, &curves);
        let mut full = enlarged(&test.wanted, size);
        compensator.picture(&mut full)?;
        slides.push(Slide {
            role: VerifyRole::Plain(image),
            full: enlarged(&plain, size),
            cells: plain,
        });
        slides.push(Slide {
            role: VerifyRole::Compensated(image),
            cells: test.compensated.clone(),
            full,
        });
    }
    slides.extend(ends());
    Ok(slides)
}

/// A wanted picture as a projector is sent it that is not compensated: the same light,
/// relative to the projector's own white.
pub(super) fn plain(wanted: &Picture, curves: &ProjectorCurves) -> Picture {
    let channels = wanted.channels();
    let light = crate::report::LightPicture::decode(wanted, crate::capture::Response::Srgb);
    let pixels = 0..wanted.size().pixels();
    let samples = pixels.flat_map(|pixel| {
        let planes = light.planes().iter().enumerate();
        planes.map(move |(channel, plane)| (channel, f64::from(plane[pixel])))
    });
    let samples = samples.map(|(channel, light)| curves.code(channel, light));
    eight(
        wanted.size(),
        samples.take(pixels_of(wanted) * channels).collect(),
    )
}

fn pixels_of(picture: &Picture) -> usize {
    picture.size().pixels()
}

/// A pattern as a grey picture of one pixel a cell.
fn of_pattern(pattern: &Pattern) -> Picture {
    let lit = pattern.lit.iter().map(|lit| 255 * u8::from(*lit));
    match FrameSize::new(pattern.cols as u16, pattern.rows as u16) {
        Some(size) => eight(size, lit.collect()),
        None => unreachable!("a grid has cells"),
    }
}

/// Every cell as a block of pixels: those whose middle lies in it.
fn enlarged(cells: &Picture, size: FrameSize) -> Picture {
    let Samples::Eight(samples) = cells.samples() else {
        unreachable!("test images have 8 bits");
    };
    let channels = cells.channels();
    let place = |pixel: usize, length: usize, cells: usize| (2 * pixel + 1) * cells / (2 * length);
    let (rows, cols) = (cells.size().height(), cells.size().width());
    let columns: Vec<usize> = (0..size.width())
        .map(|x| place(x, size.width(), cols))
        .collect();
    let mut all = Vec::with_capacity(size.pixels() * channels);
    for y in 0..size.height() {
        let row = place(y, size.height(), rows);
        for col in &columns {
            all.extend(&samples[(row * cols + col) * channels..][..channels]);
        }
    }
    eight(size, all)
}

/// The picture with its black border.
fn bordered(picture: &Picture, layout: Layout) -> Picture {
    let Samples::Eight(samples) = picture.samples() else {
        unreachable!("slides have 8 bits");
    };
    let channels = picture.channels();
    let (width, border) = (layout.projector.width(), usize::from(layout.border));
    let mut all = vec![0; layout.projector.pixels() * channels];
    let rows = samples.chunks_exact(picture.size().width() * channels);
    for (row, line) in rows.enumerate() {
        let start = ((row + border) * width + border) * channels;
        all[start..][..line.len()].copy_from_slice(line);
    }
    eight(layout.projector, all)
}

/// A picture of 8-bit samples, one or three for each pixel.
fn eight(size: FrameSize, samples: Vec<u8>) -> Picture {
    match Picture::new(size, Samples::Eight(samples)) {
        Some(picture) => picture,
        None => unreachable!("samples were made pixel by pixel"),
    }
}

fn save(path: &Path, picture: &Picture) -> Result<(), VerifyError> {
    let io = |source| FolderError::Io {
        path: path.to_owned(),
        source,
    };
    let mut bytes = Vec::new();
    png::write(&mut bytes, picture).map_err(VideoError::Png)?;
    fs::write(path, bytes).map_err(io)?;
    Ok(())
}
