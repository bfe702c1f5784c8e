//! Wanted images that show what a table does to a scene nobody knows beforehand.

use super::Content;
use crate::Wanted;
use crate::stills::test_card;
use iltm_picture::{LightPicture, Picture};
use iltm_runtime::{FrameSize, Grid, image::Table};
use iltm_solve::{DARKEST_SHOWN, natural_images};

/// Names for the user's own pictures; no more are shown.
const OWN: [&str; 3] = ["content-1", "content-2", "content-3"];

/// Pixels of a picture's longer side, about.
const SIDE: usize = 384;

/// The user's own pictures; without any a natural image and a test card.
pub(super) fn wanted(table: &Table<'_>, content: &[Content]) -> Vec<Wanted> {
    let (grid, channels) = (table.grid(), usize::from(table.channels()));
    let mut wanted: Vec<Wanted> = OWN
        .into_iter()
        .zip(content)
        .filter_map(|(name, content)| {
            let frame = content.frames.get(content.frames.len() / 2)?;
            let picture = halved(frame, grid);
            (picture.channels() >= channels).then(|| Wanted {
                name,
                title: content.name.clone(),
                remark: "From the content that was given.".to_owned(),
                picture: of_channels(picture, channels),
            })
        })
        .collect();
    // White was chosen for these: others would only show that it was not for them.
    if !wanted.is_empty() {
        return wanted;
    }
    wanted.push(natural(grid, channels));
    if let Some(size) = size(grid) {
        let card = test_card(size);
        wanted.push(Wanted {
            picture: of_channels(card.picture, channels),
            ..card
        });
    }
    wanted
}

/// A size of the grid's shape, so many whole pixels a cell that it is large enough.
fn size(grid: Grid) -> Option<FrameSize> {
    let factor = SIDE.div_ceil(grid.rows().max(grid.cols())).max(1);
    let side = |cells: usize| u16::try_from(cells * factor).ok();
    FrameSize::new(side(grid.cols())?, side(grid.rows())?)
}

/// Dead leaves: surfaces before each other, as in photographs.
fn natural(grid: Grid, channels: usize) -> Wanted {
    // As fine as a grid can be.
    let factor = (1..=SIDE / grid.cols().max(grid.rows()).max(1))
        .rev()
        .find(|factor| factor * factor * grid.cells() <= Grid::MAX_CELLS)
        .unwrap_or(1);
    let side = |cells: usize| (cells * factor) as u16;
    let fine = Grid::new(side(grid.rows()), side(grid.cols())).unwrap_or(grid);
    let images = natural_images(fine);
    let picture = LightPicture::from_fn(FrameSize::of_grid(fine), channels, |channel, cell| {
        let common = images[(cell, 0)];
        let light = if channels == 1 {
            common
        } else {
            0.6 * common + 0.4 * images[(cell, 1 + channel)]
        };
        (DARKEST_SHOWN + (1.0 - DARKEST_SHOWN) * light) as f32
    });
    Wanted {
        name: "natural",
        title: "Like a photograph".to_owned(),
        remark:
            "Surfaces of all sizes before each other, which have the statistics of natural images."
                .to_owned(),
        picture: picture.for_display(),
    }
}

/// The picture, half as large until a page can hold it.
fn halved(picture: &Picture, grid: Grid) -> Picture {
    let mut light = LightPicture::decode(picture, iltm_picture::Response::Srgb);
    while light.size().width() > 2 * SIDE {
        let half = light.halved();
        if !half.size().holds(grid) || half.size() == light.size() {
            break;
        }
        light = half;
    }
    light.for_display()
}

/// A picture in colour as one of the table's channels: grey light is the mean.
fn of_channels(picture: Picture, channels: usize) -> Picture {
    if picture.channels() == channels {
        return picture;
    }
    let light = LightPicture::decode(&picture, iltm_picture::Response::Srgb);
    let mean = |pixel: usize| {
        let colours = light.planes().iter().map(|plane| plane[pixel]);
        colours.sum::<f32>() / light.planes().len() as f32
    };
    LightPicture::from_fn(light.size(), 1, |_, pixel| mean(pixel)).for_display()
}
