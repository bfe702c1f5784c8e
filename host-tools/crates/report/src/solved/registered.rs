//! Where the cells are in the photographs.

use iltm_capture::NO_CELL;
use iltm_compile::build_table::BuiltTable;
use iltm_picture::{
    canvas::Canvas,
    html::{PictureFile, img, percent, picture_file},
};
use iltm_runtime::FrameSize;
use maud::{Markup, html};

/// Two colours for cells beside each other, and of pixels that are lit and not used.
const COLOURS: [[u8; 3]; 2] = [[245, 180, 90], [70, 130, 200]];
const UNUSED: [u8; 3] = [60, 62, 68];

/// The section with the map of the cells.
pub(super) fn section(learned: &BuiltTable, files: &mut Vec<PictureFile>) -> Markup {
    let measurements = &learned.measurements;
    let registration = &measurements.registration;
    let (width, height) = registration.camera;
    let size = u16::try_from(width).ok().zip(u16::try_from(height).ok());
    let size = size.and_then(|(width, height)| FrameSize::new(width, height));
    let file = size.map(|size| {
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
                (live) " of " (measurements.live.len()) " cells were found. Each square of the map is one cell of the projector as "
                "the camera sees it; pixels between the squares see two cells at once and are not used."
            }
            p .quiet {
                "White reaches " (percent(measurements.diagnostics.exposure)) " of the camera's full scale."
            }
        }
        @if let Some(file) = &file {
            figure { (img(&file.png, "Cells as the camera sees them")) figcaption { "The camera's picture, coloured by cell." } }
        }
    } };
    files.extend(file);
    markup
}
