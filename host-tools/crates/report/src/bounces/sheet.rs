//! Contact sheet of the bounces: the photograph and its bounces, as they are and
//! brightened.

use super::Bounces;
use super::separate::LayerKind;
use crate::frame_size;
use iltm_picture::{
    ContactSheet, LightPicture, Picture, Tile,
    numbers::{number, percent},
};

/// A picture is halved until it is no wider than this.
const WIDEST: usize = 480;
/// One value in two hundred is brighter than what a picture's brightness is taken from.
const BRIGHT: f64 = 0.995;
/// Pictures side by side.
const ACROSS: usize = 7;

/// Composes the sheet; `None` if it would be larger than a frame can be.
#[must_use]
pub fn sheet(bounces: &Bounces) -> Option<Picture> {
    let separated = &bounces.separated;
    let shown = |planes: &[Vec<f32>]| shown(separated.size, planes);
    let photograph = shown(&separated.photograph)?;
    let bright = bright_of(&photograph);
    let mut plain = vec![Tile::new(
        ("Photograph", "black subtracted"),
        &photograph.for_display(),
    )];
    plain[0]
        .captions
        .push("all pictures to one scale".to_owned());
    let mut brightened = vec![Tile::default()];
    for layer in &separated.layers {
        let light = shown(&layer.planes)?;
        let shares = format!(
            "light {}, energy {}",
            percent(layer.light_share),
            percent(layer.energy_share)
        );
        let noise = format!("rms {} x noise", number(layer.rms / bounces.noise.cell));
        let mut tile = Tile::new((&title(layer.kind), &shares), &light.for_display());
        tile.captions.push(noise);
        plain.push(tile);
        let factor = factor_for(&light, bright);
        brightened.push(if factor > 1.0 {
            let words = format!("{factor} times brighter");
            Tile::new(("", &words), &light.scaled(factor).for_display())
        } else {
            Tile::default()
        });
    }
    let rows = plain.chunks(ACROSS).zip(brightened.chunks(ACROSS));
    let sheet = ContactSheet {
        heading: heading(bounces),
        rows: rows
            .flat_map(|(plain, bright)| [plain.to_vec(), bright.to_vec()])
            .collect(),
        notes: notes(bounces),
        ..ContactSheet::default()
    };
    sheet.compose()
}

pub(super) fn heading(bounces: &Bounces) -> String {
    let shot = &bounces.shot;
    match bounces.averaged {
        1 => format!(
            "Photograph {} ({}), bounce by bounce",
            shot.index, shot.role
        ),
        n => format!("Mean of {n} photographs ({}), bounce by bounce", shot.role),
    }
}

pub(super) fn title(kind: LayerKind) -> String {
    match kind {
        LayerKind::Bounce(1) => "1st bounce: direct".to_owned(),
        LayerKind::Bounce(2) => "2nd bounce".to_owned(),
        LayerKind::Bounce(3) => "3rd bounce".to_owned(),
        LayerKind::Bounce(k) => format!("{k}th bounce"),
        LayerKind::Rest => "Rest, below noise".to_owned(),
        LayerKind::Unseparated => "Not separated".to_owned(),
    }
}

fn notes(bounces: &Bounces) -> Vec<String> {
    vec![
        format!(
            "Light: sum over all pixels, of the photograph's; these add up to 100 %. Energy: sum of \
             squares; bounces overlap, so these do not."
        ),
        noise_words(bounces),
    ]
}

pub(super) fn noise_words(bounces: &Bounces) -> String {
    format!(
        "Noise: the camera's in the mean of a cell, {:.2e} of full scale (a pixel's is {:.2e}). \
         Light that was there under black ({} of all) is subtracted.",
        bounces.noise.cell,
        bounces.noise.pixel,
        percent(bounces.ambient_share),
    )
}

/// What a picture's brightness is judged by.
pub(super) fn bright_of(light: &LightPicture) -> f64 {
    light.quantile(BRIGHT)
}

/// How many times brighter a layer is shown beside a photograph that is this bright.
pub(super) fn factor_for(layer: &LightPicture, bright: f64) -> f64 {
    round_factor(bright / bright_of(layer).max(1e-9))
}

/// The picture at a size that suits sheet and page.
pub(super) fn shown((width, height): (usize, usize), planes: &[Vec<f32>]) -> Option<LightPicture> {
    let mut light = LightPicture::new(frame_size(width, height)?, planes.to_vec())?;
    while light.size().width() > WIDEST && light.size().height() > 1 {
        light = light.halved();
    }
    Some(light)
}

/// 1, 2, 5, 10, 20, 50 and so on, the largest that is no more than `factor`.
fn round_factor(factor: f64) -> f64 {
    // Brightening by less shows nothing new, by more shows nothing but noise.
    let factor = factor.clamp(1.0, 1000.0);
    let decade = 10_f64.powf((factor * 1.000_001).log10().floor());
    let digit = factor / decade;
    decade
        * if digit >= 5.0 {
            5.0
        } else if digit >= 2.0 {
            2.0
        } else {
            1.0
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_round_and_never_more_than_asked_for() {
        for (asked, given) in [(0.3, 1.0), (1.9, 1.0), (2.0, 2.0), (7.0, 5.0), (10.0, 10.0)] {
            assert!((round_factor(asked) - given).abs() < 1e-9, "{asked}");
        }
        assert!((round_factor(f64::INFINITY) - 1000.0).abs() < 1e-9);
    }
}
