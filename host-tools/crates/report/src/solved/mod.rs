//! The report of a solve: what was learned of a scene, and what it means for the user's
//! own content, as a page that a browser shows without network.
//!
//! [`Report`] draws what every report has; here are the images for a scene nobody knows
//! (`wanted`), where the cells are (`registered`) and how bright white may be
//! (`headroom`).

mod headroom;
mod registered;
mod wanted;

use crate::{Command, Report, ReportError, Words};
use iltm_compile::build_table::BuiltTable;
use iltm_picture::{LightPicture, Picture, html::PictureFile, progress::Progress};
use iltm_runtime::image::Table;
use std::path::Path;

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
pub struct SolvedReport {
    /// The page, complete in itself.
    pub page: String,
    /// All pictures, to be kept beside it.
    pub files: Vec<PictureFile>,
}

/// The report of a scene that was learned from the folder `capture` into the file `table`.
///
/// # Errors
/// [`ReportError`] if the table cannot show an image.
pub fn report(
    learned: &BuiltTable,
    capture: &Path,
    table: &Path,
    content: &[Content],
    progress: &dyn Progress,
) -> Result<SolvedReport, ReportError> {
    let checked = Table::check(&learned.compiled.image).map_err(ReportError::Table)?;
    let wanted = wanted::wanted(&checked, content);
    let report = Report::new(learned, wanted, progress)?;
    let mut files = report.files.clone();
    let mut sections = vec![registered::section(learned, &mut files)];
    sections.push(headroom::section(learned, &checked, content, &mut files));
    let words = Words {
        sections,
        ..words(learned, capture, table)
    };
    let page = report.html(&words);
    Ok(SolvedReport { page, files })
}

fn words(learned: &BuiltTable, capture: &Path, table: &Path) -> Words {
    let named = &learned.measurements.settings.scene.name;
    let title = named.clone().unwrap_or_else(|| {
        let name = capture.file_name().unwrap_or(capture.as_os_str());
        name.to_string_lossy().into_owned()
    });
    let (capture, table) = (quoted(capture), quoted(table));
    let command = |what: &str, line: String| Command {
        what: what.to_owned(),
        line,
    };
    Words {
        title,
        scene: "What the photographs of this scene say, what the table makes of it, and what it \
                will look like on the wall."
            .to_owned(),
        commands: vec![
            command(
                "This table again, without new photographs:",
                format!("iltm solve {capture} -o {table}"),
            ),
            command(
                "Proof on the wall: pictures to project and to photograph, then a verdict:",
                format!("iltm verify {table} -o verification\niltm verify {table} verification"),
            ),
            command(
                "Live:",
                format!(
                    "ffmpeg -i VIDEO -pix_fmt yuv420p -f yuv4mpegpipe - | iltm compensate {table} - -o - | mpv -"
                ),
            ),
        ],
        seconds: Vec::new(),
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
