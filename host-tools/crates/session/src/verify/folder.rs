//! Verification folder: writes the pictures that a table is verified with.

use super::card::Card;
use super::images::{MOST_CLIPPED, RANGES, fine_images, screen_images, test_images};
use super::manifest::{VerifyManifest, VerifyRole};
use super::response::ProjectorCurves;
use super::{TestImage, VerifyError, several};
use crate::{Layout, SLIDES_FOLDER, Slide, fine_stripes, slide_name};
use iltm_capture::{
    CameraPlaces, Pattern, Role, SETTINGS_FILE, STRIPES_FILE, Settings, StripeManifest, StripeRole,
    VERIFY_FILE, numbered, pattern_set,
};
use iltm_picture::{Picture, Response, WholeFolder, progress::Progress};
use iltm_runtime::{FrameSize, image::Table};
use iltm_video::{Compensator, VideoError};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// What stands in the folder for whoever takes the photographs.
const README: &str = include_str!("README.txt");

/// The same for several projectors that overlap.
const README_SEVERAL: &str = include_str!("README-several.txt");

/// The same for a chain that compensates.
const README_WANTED: &str = include_str!("README-wanted.txt");

/// What was written.
#[derive(Clone, Debug)]
pub struct Written {
    /// Pictures to project, each of which is photographed once.
    pub pictures: usize,
    /// Pictures of the film: all of them, each after its card; none if the projection has too
    /// few pixels for a card, or the slides are for a projector alone.
    pub film: usize,
    /// Fine stripes among the pictures.
    pub stripes: usize,
    /// The test images of one pixel a cell.
    pub images: Vec<TestImage>,
    /// The test images of one pixel a pixel of the projector.
    pub fine: Vec<TestImage>,
}

/// Random patterns beside the Gray code: without them camera pixels are found so roughly
/// that a good table seems four times worse than it is, and more of them bring little.
pub(super) const BERNOULLI: usize = 32;

/// Random patterns after the last image: as many as movement is found by.
pub(super) const AFTER_IMAGES: usize = 4;

/// What they follow from: any number but those of captures.
pub(super) const SEED: u64 = 0x5EE;

/// A picture to project.
#[derive(Clone)]
pub(super) struct VerifySlide {
    pub(super) listed: ListedAs,
    /// One pixel a cell; `None` if the slide says more than that.
    pub(super) cells: Option<Picture>,
    /// What the projector is sent.
    pub(super) full: Picture,
}

/// In which list a slide stands, and as what.
#[derive(Clone, Copy)]
pub(super) enum ListedAs {
    Verify(VerifyRole),
    Stripes(StripeRole),
    /// Patterns and stripes of one of several projectors, which are counted from 1.
    Code(usize, Role),
    CodeStripes(usize, StripeRole),
}

impl VerifySlide {
    pub(super) fn cells(role: VerifyRole, cells: Picture, full: Picture) -> Self {
        let (listed, cells) = (ListedAs::Verify(role), Some(cells));
        Self {
            listed,
            cells,
            full,
        }
    }
}

/// What the slides of a folder are.
#[derive(Clone, Copy, Debug)]
pub enum Slides<'p> {
    /// Each test image as it is and as the table compensates it: for a projector alone.
    Both {
        /// Whether there are stripes and images of the projector's own pixels too.
        fine: bool,
    },
    /// The same for several projectors that overlap, whose pixels the camera of their captures sees at
    /// these places.
    Several(&'p CameraPlaces),
    /// Each test image as it should look: for a chain that compensates.
    Wanted,
}

/// Folder where the photographs go.
pub(super) const PHOTOS_FOLDER: &str = "photos";

/// Folder of the slides with their cards, for a player.
const FILM_FOLDER: &str = "film";

/// File that says which table a folder of wanted images is for: nothing else in it does.
pub(super) const TABLE_FILE: &str = "table.txt";

/// Writes the folder `out`, whole or not at all: the test images, white, black, a Gray code
/// and some random patterns. For a chain that compensates, white and black are two greys that
/// every cell can show.
///
/// # Errors
/// [`VerifyError::Folder`] if something is in its place or it cannot be written,
/// [`VerifyError::Slides`] if cells and projector do not fit together.
pub fn write(
    table: &Table<'_>,
    layout: &Layout,
    (settings, kind): (&Settings, Slides<'_>),
    out: &Path,
    progress: &dyn Progress,
) -> Result<Written, VerifyError> {
    let images = match kind {
        // Cells of one do not lie on those of the other.
        Slides::Several(_) => Vec::new(),
        Slides::Both { .. } | Slides::Wanted => test_images(table)?,
    };
    let fine = match kind {
        Slides::Several(places) => screen_images(table, places)?,
        Slides::Both { fine: true } => fine_images(table, layout.inner())?,
        Slides::Both { fine: false } | Slides::Wanted => Vec::new(),
    };
    let mut settings = settings.clone();
    let size = layout.projector();
    settings.projector.size = Some([size.width() as u16, size.height() as u16]);
    settings.projector.border = layout.border();
    let folder = WholeFolder::create(out)?;
    for name in ["patterns", SLIDES_FOLDER, PHOTOS_FOLDER, "wanted"] {
        folder.folder(name)?;
    }
    let slides = match kind {
        Slides::Both { .. } => slides(table, layout, &images, &fine)?,
        Slides::Several(places) => several::slides(table, layout, &fine, &places.parts)?,
        Slides::Wanted => wanted_slides(table, layout, &images)?,
    };
    progress.begin("writing the pictures", slides.len() as u64);
    let written = slides.par_iter().enumerate().map(|(index, slide)| {
        if let Some(cells) = &slide.cells {
            folder.picture(numbered("patterns", index as u32), cells)?;
        }
        folder.picture(slide_name(index as u32), &slide.full)?;
        progress.advance(1);
        Ok(())
    });
    written.collect::<Result<Vec<()>, VerifyError>>()?;
    for (image, test) in images.iter().enumerate() {
        folder.picture(wanted_file(image as u8), &test.wanted)?;
    }
    for (image, test) in fine.iter().enumerate() {
        folder.picture(fine_file(image as u8), &test.wanted)?;
    }
    let (manifest, own) = lists(&slides);
    folder.file(VERIFY_FILE, manifest.to_csv())?;
    if !own.shots.is_empty() {
        folder.file(STRIPES_FILE, own.to_csv())?;
    }
    let mut stripes = own.shots.len();
    if let Slides::Several(places) = kind {
        stripes = several::write_lists(&folder, &slides, places)?;
    }
    folder.file(SETTINGS_FILE, settings.to_toml())?;
    let film = match kind {
        Slides::Both { .. } | Slides::Several(_) => 0,
        Slides::Wanted => write_film(table, layout, &slides, &folder)?,
    };
    let readme = match kind {
        Slides::Both { .. } => README,
        Slides::Several(_) => README_SEVERAL,
        Slides::Wanted => {
            folder.file(TABLE_FILE, format!("{:08x}\n", table.id()))?;
            README_WANTED
        }
    };
    let readme = readme.replace("PHOTOGRAPHS", &slides.len().to_string());
    folder.file("README.md", readme)?;
    folder.finish()?;
    progress.end();
    Ok(Written {
        pictures: slides.len(),
        film,
        stripes,
        images,
        fine,
    })
}

/// The lists of these slides.
fn lists(slides: &[VerifySlide]) -> (VerifyManifest, StripeManifest) {
    let of = |fine: bool| {
        let slides = (0..).zip(slides);
        slides.filter_map(move |(index, slide)| match slide.listed {
            ListedAs::Verify(role) if slide.cells.is_none() == fine => Some((index, role)),
            _ => None,
        })
    };
    let mut verify = VerifyManifest::numbered("patterns", of(false));
    let fine = VerifyManifest::numbered(SLIDES_FOLDER, of(true));
    verify.shots.extend(fine.shots);
    verify.shots.sort_by_key(|shot| shot.index);
    let stripes = (0..).zip(slides);
    let stripes = stripes.filter_map(|(index, slide)| match slide.listed {
        ListedAs::Stripes(role) => Some((index, role)),
        ListedAs::Verify(_) | ListedAs::Code(..) | ListedAs::CodeStripes(..) => None,
    });
    let stripes = StripeManifest::numbered(SLIDES_FOLDER, stripes);
    (verify, stripes)
}

/// Writes the film: every slide after its card, and a last card, after which nothing is a
/// slide. Says how many pictures it has.
fn write_film(
    table: &Table<'_>,
    layout: &Layout,
    slides: &[VerifySlide],
    folder: &WholeFolder,
) -> Result<usize, VerifyError> {
    let card = |index: usize| {
        let (table, slide) = (table.id(), index as u32);
        Card { table, slide }.picture(layout)
    };
    let cards: Option<Vec<Picture>> = (0..=slides.len()).map(card).collect();
    let Some(cards) = cards else {
        return Ok(0);
    };
    folder.folder(FILM_FOLDER)?;
    let slides = slides.iter().map(|slide| &slide.full).map(Some);
    let pairs = cards.iter().zip(slides.chain([None]));
    let film: Vec<&Picture> = pairs
        .flat_map(|(card, slide)| [Some(card), slide])
        .flatten()
        .collect();
    let written = film.par_iter().enumerate().map(|(at, picture)| {
        folder.picture(numbered(FILM_FOLDER, at as u32), picture)?;
        Ok(())
    });
    written.collect::<Result<Vec<()>, VerifyError>>()?;
    Ok(film.len())
}

/// Where the wanted light of a test image stands, relative to the folder: sRGB codes.
pub(super) fn wanted_file(image: u8) -> PathBuf {
    Path::new("wanted").join(format!("{image}.png"))
}

/// The same of a fine test image.
pub(super) fn fine_file(image: u8) -> PathBuf {
    Path::new("wanted").join(format!("fine-{image}.png"))
}

/// All pictures in the order in which they are shown: white and black also in the middle
/// and at the end, so that a lamp that changes meanwhile is noticed; random patterns also
/// between the images and after them, so that a camera that moves there is. Fine stripes, where
/// there are fine images, follow the code.
fn slides(
    table: &Table<'_>,
    layout: &Layout,
    images: &[TestImage],
    fine: &[TestImage],
) -> Result<Vec<VerifySlide>, VerifyError> {
    let curves = ProjectorCurves::new(table);
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let within = Layout::new(table.grid(), layout.inner(), 0)?;
    let code = |(role, pattern): &(Role, Pattern)| -> Result<VerifySlide, VerifyError> {
        let lit = |cell: usize, _| 255 * u8::from(pattern.lit[cell]);
        let cells = Picture::of_codes(FrameSize::of_grid(table.grid()), 1, lit);
        let full = layout.slide(&cells)?;
        Ok(VerifySlide::cells(VerifyRole::Code(*role), cells, full))
    };
    let coded = pattern_set(table.grid(), BERNOULLI, SEED);
    let all = |shown: &[(Role, Pattern)]| shown.iter().map(code).collect::<Result<Vec<_>, _>>();
    // White and black.
    let ends = || all(&coded[..2]);
    let between = 2 * images.len() + AFTER_IMAGES;
    let (first, rest) = coded.split_at(coded.len() - between);
    let mut rest = rest.iter();
    let mut slides = all(first)?;
    if !fine.is_empty() {
        slides.extend(stripes(layout)?);
    }
    slides.extend(ends()?);
    for (image, test) in (0..).zip(images) {
        let plain = plain(&test.wanted, &curves);
        let mut full = within.slide(&test.wanted)?;
        compensator.picture(&mut full)?;
        let Some(full) = layout.framed(&full) else {
            unreachable!("slides have 8 bits and the size of the cells");
        };
        let shown = layout.slide(&plain)?;
        slides.push(VerifySlide::cells(VerifyRole::Plain(image), plain, shown));
        slides.extend(rest.next().map(code).transpose()?);
        let (role, cells) = (VerifyRole::Compensated(image), test.compensated.clone());
        slides.push(VerifySlide::cells(role, cells, full));
        slides.extend(rest.next().map(code).transpose()?);
    }
    for (image, test) in (0..).zip(fine) {
        slides.extend(fine_slides((image, test), layout, &curves)?);
    }
    slides.extend(all(rest.as_slice())?);
    slides.extend(ends()?);
    Ok(slides)
}

/// A test image of the projector's own pixels as it is and compensated.
pub(super) fn fine_slides(
    (image, test): (u8, &TestImage),
    layout: &Layout,
    curves: &ProjectorCurves,
) -> Result<[VerifySlide; 2], VerifyError> {
    let slide = |role, picture: &Picture| -> Result<VerifySlide, VerifyError> {
        Ok(VerifySlide {
            listed: ListedAs::Verify(role),
            cells: None,
            full: layout.slide(picture)?,
        })
    };
    let plain = plain(&test.wanted, curves);
    Ok([
        slide(VerifyRole::FinePlain(image), &plain)?,
        slide(VerifyRole::FineCompensated(image), &test.compensated)?,
    ])
}

/// Stripes finer than the cells.
fn stripes(layout: &Layout) -> Result<Vec<VerifySlide>, VerifyError> {
    let slide = |slide: Slide| {
        let crate::Purpose::Stripes(role) = slide.purpose else {
            return Ok(None);
        };
        Ok(Some(VerifySlide {
            listed: ListedAs::Stripes(role),
            cells: None,
            full: layout.slide(&slide.picture)?,
        }))
    };
    let slides = fine_stripes(layout).into_iter().map(slide);
    slides.filter_map(Result::transpose).collect()
}

/// All slides for a chain that compensates, in the order in which they are shown.
fn wanted_slides(
    table: &Table<'_>,
    layout: &Layout,
    images: &[TestImage],
) -> Result<Vec<VerifySlide>, VerifyError> {
    let coded = pattern_set(table.grid(), BERNOULLI, SEED);
    let levels = levels(table)?;
    let code = |(role, pattern): &(Role, Pattern)| -> Result<VerifySlide, VerifyError> {
        let lit = |cell: usize, _| 255 * u8::from(pattern.lit[cell]);
        let cells = Picture::of_codes(FrameSize::of_grid(table.grid()), 1, lit);
        let full = layout.slide(&grey(table, levels, &pattern.lit))?;
        Ok(VerifySlide::cells(VerifyRole::Code(*role), cells, full))
    };
    let all = |shown: &[(Role, Pattern)]| shown.iter().map(code).collect::<Result<Vec<_>, _>>();
    let (first, rest) = coded.split_at(coded.len() - images.len() - AFTER_IMAGES);
    let mut rest = rest.iter();
    let mut slides = all(first)?;
    slides.extend(all(&coded[..2])?);
    for (image, test) in (0..).zip(images) {
        let full = layout.slide(&test.wanted)?;
        let (role, cells) = (VerifyRole::Wanted(image), test.wanted.clone());
        slides.push(VerifySlide::cells(role, cells, full));
        slides.extend(rest.next().map(code).transpose()?);
    }
    slides.extend(all(rest.as_slice())?);
    slides.extend(all(&coded[..2])?);
    Ok(slides)
}

/// sRGB codes of a pattern between two lights, in as many channels as the table has.
pub(super) fn grey(table: &Table<'_>, levels: [f64; 2], lit: &[bool]) -> Picture {
    let codes = levels.map(|light| (Response::Srgb.value(light) * 255.0).round() as u8);
    let size = FrameSize::of_grid(table.grid());
    Picture::of_codes(size, table.channels().into(), |cell, _| {
        codes[usize::from(lit[cell])]
    })
}

/// The darkest and the brightest light between which a table can show the patterns, farthest
/// apart.
pub(super) fn levels(table: &Table<'_>) -> Result<[f64; 2], VideoError> {
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let most = super::Expected::new(table).even_grey().min(1.0);
    let coded = pattern_set(table.grid(), BERNOULLI, SEED);
    let mut levels = [most; 2];
    for (dark, bright) in RANGES {
        levels = [most * dark, most * bright];
        let mut worst = 0.0_f64;
        for (_, pattern) in &coded {
            let mut shown = grey(table, levels, &pattern.lit);
            let totals = compensator.picture(&mut shown)?;
            worst = worst.max(totals.clipped as f64 / totals.samples.max(1) as f64);
        }
        if worst <= MOST_CLIPPED {
            break;
        }
    }
    Ok(levels)
}

/// A wanted picture as a projector is sent it that is not compensated: the same light,
/// relative to the projector's own white.
pub(super) fn plain(wanted: &Picture, curves: &ProjectorCurves) -> Picture {
    let light = iltm_picture::LightPicture::decode(wanted, iltm_picture::Response::Srgb);
    Picture::of_codes(wanted.size(), wanted.channels(), |pixel, channel| {
        curves.code(channel, f64::from(light.planes()[channel][pixel]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::test_scene::{inverse, scene};
    use iltm_compile::{CompileOptions, compile};
    use iltm_runtime::Grid;

    fn range(inverse: &iltm_solve::InverseTransport) -> [f64; 2] {
        let compiled = compile(inverse, None, &CompileOptions::default()).unwrap();
        levels(&Table::check(&compiled.image).unwrap()).unwrap()
    }

    #[test]
    fn patterns_have_the_range_that_the_table_can_show() {
        // Cells that hardly light each other show any pattern; those that light each other
        // much cannot show dark ones beside bright ones.
        let grid = Grid::new(5, 8).unwrap();
        let flat = range(&inverse(grid, 1, |_, _| 6.0, |_, _| 0.0));
        let deep = range(&scene(1));
        assert!((flat[0] / flat[1] - 0.2 / 1.0).abs() < 1e-9, "{flat:?}");
        assert!(deep[0] / deep[1] > 0.25, "{deep:?}");
    }
}
