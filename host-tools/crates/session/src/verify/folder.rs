//! Verification folder: writes the pictures that a table is verified with.

use super::images::test_images;
use super::manifest::{VerifyManifest, VerifyRole};
use super::response::ProjectorCurves;
use super::{TestImage, VerifyError};
use crate::{Layout, slide_name};
use iltm_capture::{Pattern, Role, SETTINGS_FILE, Settings, VERIFY_FILE, numbered, pattern_set};
use iltm_picture::{Picture, WholeFolder, progress::Progress};
use iltm_runtime::{FrameSize, image::Table};
use iltm_video::Compensator;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// What stands in the folder for whoever takes the photographs.
const README: &str = include_str!("README.txt");

/// What was written.
#[derive(Clone, Debug)]
pub struct Written {
    /// Pictures to project, each of which is photographed once.
    pub pictures: usize,
    /// The test images.
    pub images: Vec<TestImage>,
}

/// Random patterns beside the Gray code: without them camera pixels are found so roughly
/// that a good table seems four times worse than it is, and more of them bring little.
const BERNOULLI: usize = 32;

/// What they follow from: any number but those of captures.
const SEED: u64 = 0x5EE;

/// A picture to project.
struct VerifySlide {
    role: VerifyRole,
    /// One pixel a cell.
    cells: Picture,
    /// What the projector is sent.
    full: Picture,
}

/// Writes the folder `out`, whole or not at all: for each test image the picture as it is
/// and as `table` compensates it, white, black, a Gray code and some random patterns.
///
/// # Errors
/// [`VerifyError::Folder`] if something is in its place or it cannot be written,
/// [`VerifyError::Slides`] if cells and projector do not fit together.
pub fn write(
    table: &Table<'_>,
    layout: &Layout,
    settings: &Settings,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Written, VerifyError> {
    let images = test_images(table)?;
    let folder = WholeFolder::create(out)?;
    for name in ["patterns", "slides", "photos", "wanted"] {
        folder.folder(name)?;
    }
    let slides = slides(table, layout, &images)?;
    progress.begin("writing the pictures", slides.len() as u64);
    let written = slides.par_iter().enumerate().map(|(index, slide)| {
        folder.picture(numbered("patterns", index as u32), &slide.cells)?;
        folder.picture(slide_name(index as u32), &slide.full)?;
        progress.advance(1);
        Ok(())
    });
    written.collect::<Result<Vec<()>, VerifyError>>()?;
    for (image, test) in images.iter().enumerate() {
        folder.picture(wanted_file(image as u8), &test.wanted)?;
    }
    let manifest = VerifyManifest::numbered("patterns", (0..).zip(slides.iter().map(|s| s.role)));
    folder.file(VERIFY_FILE, manifest.to_csv())?;
    // Numbers and strings always have a TOML form.
    folder.file(SETTINGS_FILE, toml::to_string(settings).unwrap_or_default())?;
    let readme = README.replace("PHOTOGRAPHS", &slides.len().to_string());
    folder.file("README.md", readme)?;
    folder.finish()?;
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

/// All pictures in the order in which they are shown: white and black also in the middle
/// and at the end, so that a lamp that changes meanwhile is noticed.
fn slides(
    table: &Table<'_>,
    layout: &Layout,
    images: &[TestImage],
) -> Result<Vec<VerifySlide>, VerifyError> {
    let curves = ProjectorCurves::new(table);
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let within = Layout::new(table.grid(), layout.inner(), 0)?;
    let code = |(role, pattern): &(Role, Pattern)| -> Result<VerifySlide, VerifyError> {
        let lit = |cell: usize, _| 255 * u8::from(pattern.lit[cell]);
        let cells = Picture::of_codes(FrameSize::of_grid(table.grid()), 1, lit);
        Ok(VerifySlide {
            role: VerifyRole::Code(*role),
            full: layout.slide(&cells)?,
            cells,
        })
    };
    let coded = pattern_set(table.grid(), BERNOULLI, SEED);
    let all = |shown: &[(Role, Pattern)]| shown.iter().map(code).collect::<Result<Vec<_>, _>>();
    // White and black.
    let ends = || all(&coded[..2]);
    let mut slides = all(&coded)?;
    slides.extend(ends()?);
    for (image, test) in (0..).zip(images) {
        let plain = plain(&test.wanted, &curves);
        let mut full = within.slide(&test.wanted)?;
        compensator.picture(&mut full)?;
        let Some(full) = layout.framed(&full) else {
            unreachable!("slides have 8 bits and the size of the cells");
        };
        slides.push(VerifySlide {
            role: VerifyRole::Plain(image),
            full: layout.slide(&plain)?,
            cells: plain,
        });
        slides.push(VerifySlide {
            role: VerifyRole::Compensated(image),
            cells: test.compensated.clone(),
            full,
        });
    }
    slides.extend(ends()?);
    Ok(slides)
}

/// A wanted picture as a projector is sent it that is not compensated: the same light,
/// relative to the projector's own white.
pub(super) fn plain(wanted: &Picture, curves: &ProjectorCurves) -> Picture {
    let light = iltm_picture::LightPicture::decode(wanted, iltm_picture::Response::Srgb);
    Picture::of_codes(wanted.size(), wanted.channels(), |pixel, channel| {
        curves.code(channel, f64::from(light.planes()[channel][pixel]))
    })
}
