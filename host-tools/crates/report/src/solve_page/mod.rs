//! Page of a solve: what was learned of a scene, and what it means for the user's own
//! content, in a file that a browser shows without network.
//!
//! [`Report`] draws what every report has; here are where the cells are, the images for a
//! scene nobody knows (`wanted`), how bright white may be (`headroom`) and who lights whom, of
//! several projectors (`projectors`).

mod headroom;
mod projectors;
mod wanted;

use crate::{Command, Report, ReportError, Words, frame_size};
use iltm_capture::NO_CELL;
use iltm_compile::build_table::BuiltTable;
use iltm_picture::{
    LightPicture, Picture,
    canvas::Canvas,
    html::{PictureFile, img, percent, picture_file},
    progress::Progress,
};
use iltm_runtime::image::Table;
use maud::{Markup, html};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Pictures or videos that the user is going to show.
#[derive(Clone, Debug)]
pub struct Content {
    /// Name of the file.
    pub name: String,
    /// Some of its frames, evenly spread; sRGB codes.
    pub frames: Vec<Picture>,
}

impl Content {
    /// Its frames as light relative to white.
    #[must_use]
    pub fn light(&self) -> Vec<LightPicture> {
        let decode = |picture| LightPicture::decode(picture, iltm_picture::Response::Srgb);
        self.frames.iter().map(decode).collect()
    }
}

/// A page and the pictures on it.
#[derive(Clone, Debug)]
pub struct SolvePage {
    /// The page, complete in itself.
    pub page: String,
    /// All pictures, to be kept beside it.
    pub files: Vec<PictureFile>,
}

/// The report of a scene that was learned from the folders `captures` into the file `table`: one, or
/// one of each projector.
///
/// # Errors
/// [`ReportError`] if the table cannot show an image.
pub fn report(
    learned: &BuiltTable,
    captures: &[PathBuf],
    table: &Path,
    content: &[Content],
    progress: &dyn Progress,
) -> Result<SolvePage, ReportError> {
    let checked = Table::check(&learned.compiled.image).map_err(ReportError::Table)?;
    let wanted = if learned.is_overlapping() {
        Vec::new()
    } else {
        wanted::wanted(&checked, content)
    };
    let report = Report::new(learned, wanted, progress)?;
    let mut files = report.files.clone();
    let mut sections = vec![cell_map(learned, &mut files)];
    sections.push(headroom::section(learned, &checked, content, &mut files));
    let names = names(captures);
    let projectors = learned
        .projectors
        .as_ref()
        .map(|areas| projectors::section(learned, areas, &names, &mut files));
    let words = Words {
        projectors,
        sections,
        ..words(learned, captures, &names, table)
    };
    let page = report.html(&words);
    Ok(SolvePage { page, files })
}

/// Two colours for cells beside each other, and of pixels that are lit and not used.
const COLOURS: [[u8; 3]; 2] = [[245, 180, 90], [70, 130, 200]];
const UNUSED: [u8; 3] = [60, 62, 68];

/// The section with the map of the cells in the photographs.
fn cell_map(learned: &BuiltTable, files: &mut Vec<PictureFile>) -> Markup {
    let measurements = &learned.measurements;
    let registration = &measurements.registration;
    let (width, height) = registration.camera;
    let file = frame_size(width, height).map(|size| {
        let mut canvas = Canvas::new(size, [0; 3]);
        let cols = measurements.grid.cols();
        let cells = registration
            .cell_of_pixel
            .iter()
            .zip(&registration.seen_cell);
        for (pixel, (used, seen)) in cells.enumerate() {
            let colour = match (*used, *seen) {
                (NO_CELL, NO_CELL) => continue,
                (NO_CELL, _) => UNUSED,
                (cell, _) => {
                    let cell = cell as usize;
                    COLOURS[(cell / cols + cell % cols) % 2]
                }
            };
            canvas.set(pixel % width, pixel / width, colour);
        }
        picture_file("registration", &canvas.finish())
    });
    let live = measurements.live.iter().filter(|live| **live).count();
    let markup = html! { section .split {
        div {
            h2 { "Where the cells are" }
            p {
                (live) " of " (learned.report.cells) " cells were found. Each square of the map is one cell of "
                @if learned.projectors.is_some() { "a" } @else { "the" }
                " projector as the camera sees it; pixels between the squares see two cells at once and are not used."
                @if learned.is_overlapping() {
                    " Where projectors overlap, the map has the cells of the one with the largest share of the light."
                }
            }
            p .quiet {
                @if learned.projectors.is_some() { "White of one projector reaches at most " } @else { "White reaches " }
                (percent(measurements.diagnostics.exposure)) " of the camera's full scale."
            }
        }
        @if let Some(file) = &file {
            figure { (img(&file.png, "Cells as the camera sees them")) figcaption { "The camera's picture, coloured by cell." } }
        }
    } };
    files.extend(file);
    markup
}

/// Names of the captures' folders: without what leads to them, if that tells them apart.
fn names(captures: &[PathBuf]) -> Vec<String> {
    let last = |capture: &PathBuf| {
        let name = capture.file_name().unwrap_or(capture.as_os_str());
        name.to_string_lossy().into_owned()
    };
    let names: Vec<String> = captures.iter().map(last).collect();
    if names.iter().collect::<BTreeSet<_>>().len() == names.len() {
        return names;
    }
    let whole = captures.iter().map(|capture| capture.display().to_string());
    whole.collect()
}

fn words(learned: &BuiltTable, captures: &[PathBuf], names: &[String], table: &Path) -> Words {
    let named = &learned.measurements.settings.scene.name;
    let title = named.clone().unwrap_or_else(|| names.join(" and "));
    let captures: Vec<String> = captures.iter().map(|capture| quoted(capture)).collect();
    let (captures, table) = (captures.join(" "), quoted(table));
    // Test images of projectors that overlap are drawn by their captures.
    let drawn = if learned.is_overlapping() {
        format!(" --captures {captures}")
    } else {
        String::new()
    };
    Words {
        title,
        scene: "What the photographs of this scene say, what the table makes of it, and what it \
                will look like on the wall."
            .to_owned(),
        commands: vec![
            Command::new(
                "This table again, without new photographs:",
                format!("iltm solve {captures} -o {table}"),
            ),
            Command::new(
                "Proof on the wall: pictures to project and to photograph, then a verdict:",
                format!(
                    "iltm verify {table} -o verification{drawn}\niltm verify {table} verification"
                ),
            ),
            Command::new(
                "Live:",
                format!(
                    "ffmpeg -i VIDEO -pix_fmt yuv420p -f yuv4mpegpipe - | iltm compensate {table} - -o - | mpv -"
                ),
            ),
        ],
        seconds: Vec::new(),
        projectors: None,
        sections: Vec::new(),
    }
}

/// A path as a word of a shell's command.
#[must_use]
pub fn quoted(path: &Path) -> String {
    // A path with a zero byte, which is refused, is no file's.
    shlex::try_quote(&path.to_string_lossy())
        .unwrap_or_default()
        .into_owned()
}
