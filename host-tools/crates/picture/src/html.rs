//! HTML pages that are complete in themselves: the frame that every page stands in, and
//! pictures, colour bars and [number words](crate::numbers) inside of one.

use crate::{ColourScale, Picture, numbers, png};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page that is complete in itself: `style` adds to the style that all pages share.
#[must_use]
pub fn document(title: &str, style: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(concat!(include_str!("style.css"), include_str!("chart.css")))) (PreEscaped(style)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}

/// A picture, encoded.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PictureFile {
    /// Name without extension: lower-case letters and `-`.
    pub name: String,
    /// Contents of the PNG file.
    pub png: Vec<u8>,
}

/// A picture as a file.
#[must_use]
pub fn picture_file(name: &str, picture: &Picture) -> PictureFile {
    PictureFile {
        name: name.to_owned(),
        png: png::encode(picture),
    }
}

/// A PNG file inside of a page.
#[must_use]
pub fn img(png: &[u8], alt: &str) -> Markup {
    html! { img src=(format!("data:image/png;base64,{}", STANDARD.encode(png))) alt=(alt); }
}

/// The picture of this name inside of a page; nothing if there is none.
#[must_use]
pub fn img_named(files: &[PictureFile], name: &str, alt: &str) -> Markup {
    let file = files.iter().find(|file| file.name == name);
    html! { @if let Some(file) = file { (img(&file.png, alt)) } }
}

/// A text with a capital letter in front.
#[must_use]
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

/// The colours of a scale with its ticks; `open` where greater numbers have its last colour.
#[must_use]
pub fn colour_bar(scale: &ColourScale, open: bool) -> Markup {
    const STOPS: usize = 16;
    let stops: Vec<String> = (0..=STOPS)
        .map(|stop| {
            let [red, green, blue] = scale.colour_at(stop as f64 / STOPS as f64);
            format!("#{red:02x}{green:02x}{blue:02x}")
        })
        .collect();
    let ticks = scale.ticks();
    html! {
        div .bar role="img" aria-label="Colour scale" {
            div .colours style=(format!("background:linear-gradient(to right,{})", stops.join(","))) {}
            div .ticks {
                @for tick in &ticks {
                    @let end = tick.place > 0.95;
                    span .end[end] style=(format!("left:{:.1}%", 100.0 * tick.place)) {
                        (tick.label) @if end && open { " +" }
                    }
                }
            }
        }
    }
}

/// [`numbers::number`] as pages have it.
#[must_use]
pub fn number(value: f64) -> String {
    typeset(&numbers::number(value))
}

/// [`numbers::percent`] as pages have it.
#[must_use]
pub fn percent(share: f64) -> String {
    typeset(&numbers::percent(share))
}

/// [`numbers::grouped`] as pages have it.
#[must_use]
pub fn grouped(value: u64) -> String {
    typeset(&numbers::grouped(value))
}

/// Minus signs, and narrow spaces at which no line breaks.
fn typeset(number: &str) -> String {
    let spaced = number.replace([' ', ','], "\u{202f}");
    spaced.replace('-', "\u{2212}")
}
