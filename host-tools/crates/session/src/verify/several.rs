//! Verification of several projectors that overlap: stripes of two on one place cannot be told apart, so
//! each shows its code while the others are black. Test images are drawn on the camera's picture, so
//! that what both show of a place is one, and all show them at once.

use super::folder::{AFTER_IMAGES, BERNOULLI, ListedAs, SEED, VerifySlide, fine_slides};
use super::images::screen_title;
use super::manifest::{VerifyManifest, VerifyRole, VerifyShot};
use super::outcome::MOST_SHIFTED;
use super::pixels::{at_pixels, means_of_cells, wanted};
use super::readings::{self, Shown, check_all_there, fine_pictures, live, paired};
use super::response::ProjectorCurves;
use super::{Readings, TestImage, VerifyError};
use crate::{Layout, PatternsError, Purpose, SLIDES_FOLDER, fine_stripes};
use iltm_capture::{
    CameraPlaces, CaptureError, CellPlanes, Correspondence, Manifest, Pattern, PictureShift,
    RemeasuredSeveral, Role, Settings, Shot, StripeManifest, VERIFY_FILE, pattern_set,
    projector_file, projector_stripes_file, remeasure_several,
};
use iltm_compile::Provenance;
use iltm_picture::{FramePart, Picture, Samples, WholeFolder, foreign_file, progress::Progress};
use iltm_runtime::{FrameSize, Grid, image::Table};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

/// File that says what the captures showed that the table was made from.
const BEFORE_FILE: &str = "before.toml";

/// Its light under white: a list for each channel, of the cells row by row, in camera units.
const LIGHT: &str = "white";

/// Its correspondences: numbers of two projectors from 0, column and row of a pixel of the first, and
/// place in the picture of the second.
const PLACES: &str = "correspondences";

/// Bytes that the file may have: twice those of the largest grid in three channels.
const MOST_BYTES: u64 = 8 << 20;

/// All pictures in the order in which they are shown: the code of each projector while the others are
/// black, then the images. White of all comes first, since it is the brightest picture, and again in
/// the middle and at the end; some random patterns of each projector lie between the images and behind
/// them, so that a camera that moves there is noticed.
pub(super) fn slides(
    table: &Table<'_>,
    layout: &Layout,
    images: &[TestImage],
    parts: &[FramePart],
) -> Result<Vec<VerifySlide>, VerifyError> {
    let curves = ProjectorCurves::new(table);
    let all = || {
        let size = FrameSize::of_grid(table.grid());
        let cells = Picture::of_codes(size, 1, |_, _| u8::MAX);
        let full = layout.slide(&cells)?;
        let role = VerifyRole::Code(Role::White);
        Ok::<_, VerifyError>(VerifySlide::cells(role, cells, full))
    };
    let mut slides = vec![all()?];
    let mut rest = Vec::new();
    let between = (2 * images.len()).div_ceil(parts.len().max(1)) + AFTER_IMAGES;
    for (index, part) in parts.iter().enumerate() {
        let part = ProjectorPart::new(table.grid(), layout, part)?;
        let mut codes = Vec::new();
        for (role, pattern) in pattern_set(part.own.grid(), BERNOULLI, SEED + index as u64) {
            let cells = part.of_cells(&pattern);
            codes.push(VerifySlide {
                listed: ListedAs::Code(index + 1, role),
                full: layout.slide(&cells)?,
                cells: Some(cells),
            });
        }
        let later = codes.split_off(codes.len() - between.min(codes.len()));
        // White and black once more at the end.
        let ends = codes[..2].to_vec();
        slides.append(&mut codes);
        slides.extend(part.stripes(index + 1));
        rest.push((later.into_iter(), ends));
    }
    slides.push(all()?);
    let mut turn = (0..rest.len()).cycle();
    for (image, test) in (0..).zip(images) {
        for slide in fine_slides((image, test), layout, &curves)? {
            slides.push(slide);
            slides.extend(turn.next().and_then(|of| rest[of].0.next()));
        }
    }
    for (later, ends) in rest {
        slides.extend(later);
        slides.extend(ends);
    }
    slides.push(all()?);
    Ok(slides)
}

/// What one projector shows of the wide frame.
struct ProjectorPart {
    /// Its own cells and pixels.
    own: Layout,
    /// Cells and pixels of the wide frame.
    all: (Grid, FrameSize),
    /// Its part of both.
    parts: [FramePart; 2],
}

impl ProjectorPart {
    fn new(grid: Grid, layout: &Layout, cells: &FramePart) -> Result<Self, VerifyError> {
        let frame = layout.projector();
        let no_cells = || PatternsError::Cells {
            grid,
            projector: frame,
            border: 0,
        };
        let pixels = cells.pixels(grid, frame).ok_or_else(no_cells)?;
        let own = Grid::new(cells.rows as u16, cells.columns.len() as u16).ok();
        let (own, size) = own.zip(pixels.frame()).ok_or_else(no_cells)?;
        Ok(Self {
            own: Layout::new(own, size, 0)?,
            all: (grid, frame),
            parts: [cells.clone(), pixels],
        })
    }

    /// A pattern of the wide frame's cells, black where others show.
    fn of_cells(&self, pattern: &Pattern) -> Picture {
        let (grid, part) = (self.all.0, &self.parts[0]);
        Picture::of_codes(FrameSize::of_grid(grid), 1, |cell, _| {
            let own = part.own(grid.cols(), cell);
            255 * u8::from(own.is_some_and(|own| pattern.lit[own]))
        })
    }

    /// Fine stripes of the projector with this number, as slides of the wide frame.
    fn stripes(&self, projector: usize) -> Vec<VerifySlide> {
        let (frame, part) = (self.all.1, &self.parts[1]);
        let widened = |picture: &Picture| {
            let Samples::Eight(codes) = picture.samples() else {
                unreachable!("stripes have 8 bits");
            };
            Picture::of_codes(frame, 1, |pixel, _| {
                let own = part.own(frame.width(), pixel);
                own.map_or(0, |own| codes[own])
            })
        };
        let slides = fine_stripes(&self.own).into_iter();
        let slides = slides.filter_map(|slide| match slide.purpose {
            Purpose::Stripes(role) => Some(VerifySlide {
                listed: ListedAs::CodeStripes(projector, role),
                cells: None,
                full: widened(&slide.picture),
            }),
            Purpose::Scene(_) | Purpose::Calibration(_) => None,
        });
        slides.collect()
    }
}

/// Writes what is listed of each projector, and how bright white was; says how many stripes there are.
pub(super) fn write_lists(
    folder: &WholeFolder,
    slides: &[VerifySlide],
    places: &CameraPlaces,
) -> Result<usize, VerifyError> {
    let numbered = || (0_u32..).zip(slides.iter().map(|slide| slide.listed));
    let mut count = 0;
    for projector in 1..=places.parts.len() {
        let code = numbered().filter_map(|(index, listed)| match listed {
            ListedAs::Code(of, role) if of == projector => Some((index, role)),
            _ => None,
        });
        let stripes = numbered().filter_map(|(index, listed)| match listed {
            ListedAs::CodeStripes(of, role) if of == projector => Some((index, role)),
            _ => None,
        });
        let code = Manifest::numbered("patterns", code);
        let stripes = StripeManifest::numbered(SLIDES_FOLDER, stripes);
        folder.file(projector_file(projector), code.to_csv())?;
        folder.file(projector_stripes_file(projector), stripes.to_csv())?;
        count += stripes.shots.len();
    }
    let before = Before {
        white: places.white.clone(),
        correspondences: places.correspondences.clone(),
    };
    folder.file(BEFORE_FILE, before.text())?;
    Ok(count)
}

/// Reads a folder of several projectors, whose `verify.csv` is `manifest`.
pub(super) fn read(
    folder: &Path,
    manifest: VerifyManifest,
    table: &Table<'_>,
    progress: &dyn Progress,
) -> Result<Readings, VerifyError> {
    let settings = Settings::read(folder)?;
    let mut codes: Vec<Vec<Shot>> = Vec::new();
    while let Some(list) = Manifest::read_named(folder, &projector_file(codes.len() + 1))? {
        codes.push(list.shots);
    }
    let mut white = Vec::new();
    let mut images: BTreeMap<u8, [Option<VerifyShot>; 2]> = BTreeMap::new();
    for shot in manifest.shots {
        match shot.role {
            VerifyRole::Code(Role::White) => white.push(readings::with_role(&shot, Role::White)),
            VerifyRole::FinePlain(image) => images.entry(image).or_default()[0] = Some(shot),
            VerifyRole::FineCompensated(image) => images.entry(image).or_default()[1] = Some(shot),
            _ => {}
        }
    }
    let list = || folder.join(VERIFY_FILE);
    if images.is_empty() {
        return Err(VerifyError::NoImages { path: list() });
    }
    if white.is_empty() {
        return Err(CaptureError::NoWhite { path: list() }.into());
    }
    let pairs = paired(images, folder)?;
    let code = [codes.concat(), white.clone()].concat();
    check_all_there(folder, &code, pairs.iter())?;
    let fine = fine_pictures(folder, table, &settings, &pairs)?;
    let pictures: Vec<Shot> = (pairs.iter().flat_map(|(_, pair)| pair))
        .map(|shot| readings::with_role(shot, Role::White))
        .collect();
    let photographs = RemeasuredSeveral {
        codes: &codes,
        white: &white,
        pictures: &pictures,
    };
    let mixing = Provenance::read(table.provenance()).mixing;
    let revisited = remeasure_several(folder, &settings, mixing, photographs, progress)?;
    let pixels = match &revisited.pixels {
        None => return Err(VerifyError::NotFine),
        Some(Err(error)) => return Err(VerifyError::Map(error.clone())),
        Some(Ok(pixels)) => pixels,
    };
    // Photographs and pictures are averaged over the same pixels, since few cells of one projector
    // are on the camera's picture what they are on its own.
    let of_cells = |planes: &[Vec<f32>]| -> CellPlanes {
        let cells = &revisited.pixels_of_cells;
        let planes = planes.iter();
        planes
            .map(|plane| means_of_cells(pixels, cells, plane))
            .collect()
    };
    let placed = of_cells(&[vec![1.0; pixels.views.pixels().len()]]);
    let live = live(folder, table, &revisited)?;
    let live = live
        .iter()
        .zip(&placed[0])
        .map(|(live, placed)| *live && *placed > 0.0);
    let curves = ProjectorCurves::new(table);
    let drive = |picture: &Picture| -> Vec<Vec<f32>> {
        let planes = readings::input(picture, &curves).into_iter();
        let planes = planes.map(|plane| plane.into_iter().map(|drive| drive as f32).collect());
        planes
            .map(|plane: Vec<f32>| at_pixels(pixels, &plane))
            .collect()
    };
    let (expected_white, correspondences) = match before(folder, table, codes.len())? {
        Some(before) => (Some(before.white), before.correspondences),
        None => (None, Vec::new()),
    };
    let shown = pairs.into_iter().zip(&fine).enumerate();
    let shown = shown.map(|(at, ((image, pair), fine))| {
        let taken = [2 * at, 2 * at + 1];
        let wanted = of_cells(&wanted(pixels, fine));
        Shown {
            image,
            title: screen_title(image.into()),
            clipped: fine.clipped,
            // As it is, an image is its own light.
            input: [wanted.clone(), of_cells(&drive(&fine.compensated))],
            wanted,
            seen: taken.map(|at| of_cells(&pixels.pictures[at])),
            photos: pair.map(|shot| shot.photo),
            views: taken.map(|at| revisited.views.get(at).cloned()),
        }
    });
    Ok(Readings {
        shown: shown.collect(),
        live: live.collect(),
        fine,
        wanted: false,
        flood: vec![vec![1.0; table.grid().cells()]; table.channels().into()],
        exchanged: PictureShift::exchanged(
            &correspondences,
            &revisited.correspondences,
            MOST_SHIFTED,
        ),
        unseen: PictureShift::unseen(&correspondences, &revisited.correspondences),
        shifts: PictureShift::find(&correspondences, &revisited.correspondences),
        expected_white,
        revisited,
    })
}

/// What the captures said when the table was made.
struct Before {
    /// Light of white of all projectors, camera units.
    white: CellPlanes,
    correspondences: Vec<Correspondence>,
}

impl Before {
    fn text(&self) -> String {
        let numbers = |known: &Correspondence| {
            let [first, second] = known.projectors.map(|number| number as f64);
            let [x, y] = known.pixel.map(f64::from);
            let [across, down] = known.place.map(f64::from);
            [first, second, x, y, across, down]
        };
        let correspondences: Vec<[f64; 6]> = self.correspondences.iter().map(numbers).collect();
        let lists = [
            (LIGHT, toml::Value::try_from(&self.white)),
            (PLACES, toml::Value::try_from(correspondences)),
        ];
        // Numbers always have a TOML form.
        let lists = lists.into_iter();
        let lists = lists.filter_map(|(key, list)| Some((key.to_owned(), list.ok()?)));
        lists.collect::<toml::Table>().to_string()
    }

    /// `None` of what [`Before::text`] did not write for a table of so many channels and cells and so many
    /// projectors.
    fn read(text: &str, (channels, cells): (usize, usize), projectors: usize) -> Option<Self> {
        let mut lists = text.parse::<toml::Table>().ok()?;
        let white: CellPlanes = lists.remove(LIGHT)?.try_into().ok()?;
        let whole = white.len() == channels
            && white.iter().all(|plane| plane.len() == cells)
            && white.iter().flatten().all(|light| light.is_finite());
        let correspondence = |numbers: [f64; 6]| {
            let [first, second, x, y, across, down] = numbers;
            let numbers = [first as usize, second as usize];
            let known = numbers.iter().all(|number| *number < projectors);
            known.then_some(Correspondence {
                projectors: numbers,
                pixel: [x as u16, y as u16],
                place: [across as f32, down as f32],
            })
        };
        let places: Vec<[f64; 6]> = lists.remove(PLACES)?.try_into().ok()?;
        let correspondences = places.into_iter().map(correspondence);
        let correspondences = correspondences.collect::<Option<_>>()?;
        whole.then_some(Self {
            white,
            correspondences,
        })
    }
}

/// What the folder says of the captures; `None` where it says nothing.
fn before(
    folder: &Path,
    table: &Table<'_>,
    projectors: usize,
) -> Result<Option<Before>, VerifyError> {
    let path = folder.join(BEFORE_FILE);
    let text = match foreign_file::read_text(&path, MOST_BYTES) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        text => text,
    };
    let size = (usize::from(table.channels()), table.grid().cells());
    let before = text
        .ok()
        .and_then(|text| Before::read(&text, size, projectors));
    before.map(Some).ok_or(VerifyError::Before { path })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written() -> Before {
        Before {
            white: vec![vec![0.25, 1e-9, 0.5], vec![1.5, 0.0, 0.125]],
            correspondences: vec![Correspondence {
                projectors: [0, 2],
                pixel: [1919, 7],
                place: [3.5, 0.25],
            }],
        }
    }

    #[test]
    fn what_captures_said_is_read_back_for_its_own_table() {
        let text = written().text();
        let read = |size, projectors| Before::read(&text, size, projectors);
        let found = read((2, 3), 3).unwrap();
        assert_eq!(found.white, written().white);
        assert_eq!(found.correspondences, written().correspondences);
        for (size, projectors) in [((1, 3), 3), ((2, 4), 3), ((2, 3), 2)] {
            assert!(read(size, projectors).is_none());
        }
    }

    proptest! {
        #[test]
        fn no_text_is_too_wild(text in ".*", at in 0_usize..80, put in ".{0,4}") {
            prop_assert!(Before::read(&text, (2, 3), 3).is_none());
            // Nearly what was written.
            let mut text = written().text();
            let at = at.min(text.len());
            text.insert_str(at, &put);
            let _ = Before::read(&text, (2, 3), 3);
        }
    }
}
