//! Overlap of projectors: who lights what, where several light the same, how they share it, and
//! whose light crosses to whom.

use crate::{flood, frame_size};
use iltm_capture::ProjectorAreas;
use iltm_compile::build_table::BuiltTable;
use iltm_picture::{
    ColourScale, Lattice, Palette, Picture,
    canvas::{BACKGROUND, Canvas, Colour, FontWeight, INK, RasterHeight, Type},
    html::{PictureFile, colour_bar, img, percent, picture_file},
};
use iltm_runtime::{FrameSize, Grid};
use maud::{Markup, html};

/// Colours of projectors, one after the other, that people tell apart who see few colours (Okabe and
/// Ito, *Color Universal Design*, 2008).
const COLOURS: [Colour; 6] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [204, 121, 167],
    [240, 228, 66],
    [213, 94, 0],
];

/// Width of the camera's picture on the page, about.
const WIDTH: usize = 640;
/// Width of a stripe where several projectors light the same.
const STRIPE: usize = 6;
/// Shades of one colour: so few that all fit into a palette.
const SHADES: u8 = 32;
/// Part of a colour that stays where the photograph is dark, so that it can be told.
const LEAST: f64 = 0.3;
/// Width of the pictures of shares, about.
const FRAME: usize = 320;

/// Letters of names on the picture.
const NAME: Type = Type {
    height: RasterHeight::Size20,
    weight: FontWeight::Bold,
    colour: INK,
};

/// The section about the projectors; `names` are those of their captures.
pub(super) fn section(
    learned: &BuiltTable,
    areas: &ProjectorAreas,
    names: &[String],
    files: &mut Vec<PictureFile>,
) -> Markup {
    let room = room(learned, areas, names).map(|room| picture_file("projectors", &room));
    let markup = html! { section {
        h2 { "The projectors" }
        p {
            "Each projector was photographed while the others showed black. "
            @if areas.overlap {
                "So the photographs tell where they light the same place, and what bounces from one to the other. "
                "Where several light a place, each shows its share of the light there."
            } @else {
                "So the photographs tell what bounces from one to the other. No cell is lit by two projectors: each "
                "shows all of the light of its own."
            }
        }
        div .split {
            @if let Some(room) = &room {
                figure {
                    (img(&room.png, "The camera's picture, coloured by projector"))
                    figcaption {
                        "The camera's picture under white of all, in the colour of the projector that lights a place"
                        @if areas.overlap { "; striped where several do" }
                        "."
                    }
                }
            }
            div {
                h3 { "Who lights whom" }
                p { "A row of the table is a projector's picture, a column is a projector that lights it." }
                p {
                    b { "Bounces" } ": light that white of the column's projector adds to what the row's projector lights "
                    "alone, of its own white there. " b { "Overlap" } ": part of the row's picture, as the camera sees it, that "
                    "the column's projector lights too. " b { "Alone" } ": part that no other one lights."
                }
                p .quiet { code { "iltm check" } " states the same of bounces and overlaps." }
            }
        }
        div .example { (matrix(areas, names)) }
        @if areas.overlap { (blend(learned.inverse.grid, areas, names, files)) }
    } };
    files.extend(room);
    markup
}

/// A row for each projector that is lit, a column for each that lights it.
fn matrix(areas: &ProjectorAreas, names: &[String]) -> Markup {
    let crossing = |from: usize, to: usize| {
        let mut pairs = areas.crossing.iter();
        pairs.find(|light| (light.from, light.to) == (from, to))
    };
    html! { div .scroll { table {
        thead { tr {
            th { "picture of" }
            @for (from, name) in names.iter().enumerate() { th { "lit by " (named(from, name)) } }
        } }
        tbody { @for (to, name) in names.iter().enumerate() { tr {
            @let alone = areas.alone(to);
            td { (named(to, name)) }
            @for from in 0..names.len() { td { @match crossing(from, to) {
                None => { "alone " (format!("{:.0}\u{202f}%", 100.0 * alone)) }
                Some(light) => {
                    // Without such a place, nothing is known of bounces.
                    @if alone > 0.0 { "bounces " (percent(light.bounced)) }
                    @if light.overlap > 0.0 {
                        br; "overlap " (format!("{:.0}\u{202f}%", 100.0 * light.overlap))
                    }
                }
            } } }
        } } }
    } } }
}

/// A projector's name beside its colour.
fn named(projector: usize, name: &str) -> Markup {
    let [red, green, blue] = colour(projector);
    let style = format!(
        "display:inline-block;width:.75em;height:.75em;border-radius:2px;background:#{red:02x}{green:02x}{blue:02x}"
    );
    html! { span .formula { span style=(style) {} "\u{a0}" (name) } }
}

fn colour(projector: usize) -> Colour {
    COLOURS[projector % COLOURS.len()]
}

/// Shares of the light, a picture of each projector's frame.
fn blend(
    grid: Grid,
    areas: &ProjectorAreas,
    names: &[String],
    files: &mut Vec<PictureFile>,
) -> Markup {
    let scale = ColourScale::linear(Palette::Viridis, 1.0);
    let frames = areas.parts.iter().enumerate();
    let frames = frames.filter_map(|(projector, part)| {
        let shares = part.places(grid.cols()).map(|cell| areas.cell_shares[cell]);
        let shares: Vec<f64> = shares.collect();
        let picture = shares_picture(&scale, part.rows, part.columns.len(), &shares)?;
        let name = format!("blend-{}", projector + 1);
        Some((projector, picture_file(&name, &picture)))
    });
    let frames: Vec<(usize, PictureFile)> = frames.collect();
    let markup = html! { div .example {
        h3 { "How they share the light" }
        p {
            "The frames of the projectors beside each other, from left to right as in the wide frame. The brighter, the "
            "larger is the projector's share of the light: 1 where it lights a place alone. The shares of a place add "
            "up to 1."
        }
        div style="display:grid;grid-template-columns:repeat(auto-fit,minmax(180px,1fr));gap:16px" {
            @for (projector, file) in &frames {
                figure {
                    (img(&file.png, "Shares of the light in the frame of a projector"))
                    figcaption { (named(*projector, &names[*projector])) }
                }
            }
        }
        (colour_bar(&scale, false))
    } };
    files.extend(frames.into_iter().map(|(_, file)| file));
    markup
}

/// Shares of cells as a table has them, interpolated between the cells' centres.
fn shares_picture(
    scale: &ColourScale,
    rows: usize,
    cols: usize,
    shares: &[f64],
) -> Option<Picture> {
    let grid = Grid::new(u16::try_from(rows).ok()?, u16::try_from(cols).ok()?).ok()?;
    let pixels = FRAME.div_ceil(cols);
    let size = frame_size(cols * pixels, rows * pixels)?;
    let fine = Lattice::new(grid, size)?.expand(shares);
    Some(scale.picture(size, fine.into_iter().map(f64::from)))
}

/// The camera's picture, coloured by who lights it, with names.
fn room(learned: &BuiltTable, areas: &ProjectorAreas, names: &[String]) -> Option<Picture> {
    let (width, height) = learned.measurements.registration.camera;
    let camera = frame_size(width, height)?;
    let mut white = Canvas::new(camera, [0; 3]);
    white.place(0, 0, &flood(learned)?);
    let bright = |pixel: usize| {
        let colours = white.get(pixel % width, pixel / width).map(u16::from);
        f64::from(colours.iter().sum::<u16>()) / (3.0 * 255.0)
    };
    coloured(camera, &areas.pixel_shares, bright, names)
}

/// The same of pixels that are as `bright` as on a screen, 0 to 1; `shares` by projector and pixel.
fn coloured(
    camera: FrameSize,
    shares: &[Vec<f32>],
    bright: impl Fn(usize) -> f64,
    names: &[String],
) -> Option<Picture> {
    let size = frame_size(WIDTH, (WIDTH * camera.height()).div_ceil(camera.width()))?;
    let mut canvas = Canvas::new(size, BACKGROUND);
    // Where no other one has a larger share, for a projector's name: sums of places, and how many.
    let mut places = vec![[0; 3]; shares.len()];
    for (x, y) in (0..size.pixels()).map(|at| (at % size.width(), at / size.width())) {
        let of_camera = |at: usize, of: usize, to: usize| at * to / of;
        let row = of_camera(y, size.height(), camera.height());
        let pixel = row * camera.width() + of_camera(x, size.width(), camera.width());
        let lit: Vec<usize> = (0..shares.len())
            .filter(|projector| shares[*projector][pixel] > 0.0)
            .collect();
        let steps = f64::from(SHADES);
        let bright = (bright(pixel) * steps).round() / steps;
        let (colour, bright) = if lit.is_empty() {
            ([255; 3], 0.5 * bright)
        } else {
            let projector = lit[(x + y) / STRIPE % lit.len()];
            (colour(projector), LEAST + (1.0 - LEAST) * bright)
        };
        let shade = |code: u8| (f64::from(code) * bright).round() as u8;
        canvas.set(x, y, colour.map(shade));
        let share = |projector: &usize| shares[*projector][pixel];
        let most = lit.iter().map(share).fold(0.0, f32::max);
        for projector in lit.into_iter().filter(|of| share(of) >= most) {
            let place = &mut places[projector];
            *place = [place[0] + x, place[1] + y, place[2] + 1];
        }
    }
    for (name, [x, y, count]) in names.iter().zip(places) {
        if let (Some(x), Some(y)) = (x.checked_div(count), y.checked_div(count)) {
            label(&mut canvas, [x, y], name);
        }
    }
    Some(canvas.finish())
}

/// Writes a name around a place.
fn label(canvas: &mut Canvas, [x, y]: [usize; 2], name: &str) {
    const ROOM: usize = 6;
    let (width, height) = (NAME.width(name), NAME.height as usize);
    let left = x.saturating_sub(width / 2).max(ROOM);
    let top = y.saturating_sub(height / 2).max(ROOM);
    for row in top - ROOM / 2..top + height + ROOM / 2 {
        (left - ROOM..left + width + ROOM).for_each(|col| canvas.set(col, row, BACKGROUND));
    }
    canvas.write(left, top, name, NAME);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_area_has_the_colour_of_its_projector_and_an_overlap_those_of_both() {
        // Four columns: the first projector's, both's, the second's and nobody's.
        let camera = FrameSize::new(4, 2).unwrap();
        let columns = |of: [f32; 4]| of.repeat(2);
        let shares = [columns([1.0, 0.5, 0.0, 0.0]), columns([0.0, 0.5, 1.0, 0.0])];
        let picture = coloured(camera, &shares, |_| 1.0, &[]).unwrap();
        let mut shown = Canvas::new(picture.size(), [0; 3]);
        shown.place(0, 0, &picture);
        let (quarter, height) = (picture.size().width() / 4, picture.size().height());
        let count = |column: usize, colour: Colour| {
            let pixels = (0..quarter * height).map(|at| (at % quarter, at / quarter));
            let same = |(x, y): &(usize, usize)| shown.get(column * quarter + x, *y) == colour;
            pixels.filter(same).count() as f64 / (quarter * height) as f64
        };
        let found: Vec<[f64; 2]> = (0..4)
            .map(|column| [count(column, COLOURS[0]), count(column, COLOURS[1])])
            .collect();
        assert_eq!(
            [found[0], found[2], found[3]],
            [[1.0, 0.0], [0.0, 1.0], [0.0; 2]]
        );
        assert!(
            found[1].iter().all(|part| (part - 0.5).abs() < 0.02),
            "{found:?}"
        );
    }
}
