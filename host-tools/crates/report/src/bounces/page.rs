//! HTML page of the bounces: the photograph and its bounces, as they are and brightened.

use super::Bounces;
use super::separate::{Layer, LayerKind};
use super::sheet::{bright_of, factor_for, heading, noise_words, shown, title};
use iltm_picture::{
    LightPicture,
    html::{document, img, number, percent},
    png,
};
use maud::{Markup, html};

/// Standard errors below which the photographs do not prove that there are bounces.
pub const PROOF: f64 = 2.0;

const STYLE: &str = ".half > figure { margin-top: 6px; } h3 { margin-top: 28px; }";

/// The page; `None` if the photograph has no size that a picture can have.
#[must_use]
pub fn page(bounces: &Bounces) -> Option<String> {
    let separated = &bounces.separated;
    let photograph = shown(separated.size, &separated.photograph)?;
    let bright = bright_of(&photograph);
    let mut layers = Vec::new();
    for layer in &separated.layers {
        layers.push(pair(layer, &shown(separated.size, &layer.planes)?, bright));
    }
    let body = html! {
        main {
            (opening(bounces))
            section {
                h2 { "Bounce by bounce" }
                p {
                    "Left, all pictures to the photograph's scale. Right, the same brightened, where it is too dark "
                    "to be seen."
                }
                h3 { "Photograph" }
                div .half { figure {
                    (picture(&photograph, "The photograph"))
                    figcaption { "What the camera saw, without the light that was there under black." }
                } }
                @for layer in &layers { (layer) }
            }
            section {
                h2 { "Numbers" }
                (table(bounces))
                p .quiet {
                    "Light: share of the photograph's sum; these add up to 100 %. Energy: share of its sum of squares, "
                    "which does not add up, since bounces overlap. Brightest: of the camera's full scale. Last column: "
                    "root mean square, in units of the camera's noise in the mean of a cell. " (noise_words(bounces))
                }
                p .quiet {
                    code { "bounces.npy" } " holds the layers as numbers, " code { "bounces.csv" } " this table, and a PNG "
                    "of 16 bits each layer."
                }
            }
            footer { "Written by iltm " (env!("CARGO_PKG_VERSION")) "." }
        }
    };
    Some(document(&heading(bounces), STYLE, &body))
}

fn opening(bounces: &Bounces) -> Markup {
    let share = |wanted: fn(LayerKind) -> bool| {
        let layers = bounces.separated.layers.iter();
        let layers = layers.filter(|layer| wanted(layer.kind));
        layers.map(|layer| layer.light_share).sum::<f64>()
    };
    let direct = share(|kind| kind == LayerKind::Bounce(1));
    let elsewhere = share(|kind| kind == LayerKind::Unseparated);
    let confidence = bounces.report.prediction.confidence;
    html! {
        header {
            p .over { "iltm bounces" }
            h1 { (heading(bounces)) }
            p .lead {
                "Where the light of this photograph came from: straight from the projector, or by way of other "
                "surfaces that it lit."
            }
            div .numbers {
                div .number { b { (percent(direct)) } span { "straight from the projector" } }
                div .number { b { (percent(1.0 - direct - elsewhere)) } span { "by way of other surfaces" } }
                div .number { b { (percent(elsewhere)) } span { "where no cell was solved for" } }
            }
            @if bounces.saturated > 0 {
                p { (bounces.saturated) " pixels are saturated: their light is more than is shown." }
            }
            @if confidence < PROOF {
                p {
                    "The photographs do not prove that there are bounces at all: " (number(confidence))
                    " standard errors."
                }
            }
        }
    }
}

/// A layer as it is, and brightened if that shows more.
fn pair(layer: &Layer, light: &LightPicture, bright: f64) -> Markup {
    let title = title(layer.kind);
    let factor = factor_for(light, bright);
    html! {
        h3 { (title) }
        div .half {
            figure {
                (picture(light, &title))
                figcaption { (percent(layer.light_share)) " of the light, " (percent(layer.energy_share)) " of the energy" }
            }
            @if factor > 1.0 { figure {
                (picture(&light.scaled(factor), &format!("{title}, brightened")))
                figcaption { (number(factor)) " times brighter" }
            } }
        }
    }
}

fn picture(light: &LightPicture, alt: &str) -> Markup {
    img(&png::encode(&light.for_display()), alt)
}

fn table(bounces: &Bounces) -> Markup {
    html! {
        div .scroll { table {
            thead { tr {
                th { "layer" } th { "light" } th { "energy" } th { "brightest" } th { "rms / noise" }
            } }
            tbody { @for layer in &bounces.separated.layers { tr {
                td { (title(layer.kind)) } td { (percent(layer.light_share)) } td { (percent(layer.energy_share)) }
                td { (number(layer.brightest)) } td { (number(layer.rms / bounces.noise.cell)) }
            } } }
        } }
    }
}
