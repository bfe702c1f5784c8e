//! The picture that people look at: the photograph and its bounces, as they are and
//! brightened.

use super::Bounces;
use super::folder::frame_size;
use super::separate::LayerKind;
use iltm_picture::{
    LightPicture, Picture,
    canvas::{BACKGROUND, Canvas, INK, QUIET, Type},
    numbers::{number, percent},
};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

/// Pixels between pictures and around them.
const GAP: usize = 16;
/// Pixels that a line of letters takes.
const LINE: usize = 22;
/// Least width of a column: its words have to fit.
const COLUMN: usize = 250;
/// A picture is halved until it is no wider than this.
const WIDEST: usize = 480;
/// A picture is enlarged by whole factors up to this.
const NARROWEST: usize = 200;
/// Columns side by side.
const ACROSS: usize = 7;

const TITLE: Type = Type {
    height: RasterHeight::Size20,
    weight: FontWeight::Bold,
    colour: INK,
};

const TEXT: Type = Type {
    height: RasterHeight::Size16,
    weight: FontWeight::Regular,
    colour: QUIET,
};

/// One column: a picture twice, and its words.
struct Column {
    title: String,
    lines: [String; 2],
    light: LightPicture,
    /// What its second picture is brightened by; 1 if it has none.
    factor: f64,
}

/// Composes the sheet; `None` if it would be larger than a frame can be.
#[must_use]
pub fn sheet(bounces: &Bounces) -> Option<Picture> {
    let columns = columns(bounces)?;
    let picture = columns.first()?.light.size();
    let wide = picture.width().max(COLUMN);
    let across = columns.len().min(ACROSS);
    let block = LINE * 3 + GAP + 2 * (picture.height() + LINE) + 2 * GAP;
    let head = 2 * GAP + LINE;
    let note = notes(bounces);
    let longest = note.iter().map(|line| TEXT.width(line)).max().unwrap_or(0);
    let width = (GAP + across * (wide + GAP)).max(longest + 2 * GAP);
    let height = head + columns.len().div_ceil(ACROSS) * block + note.len() * LINE + GAP;
    let mut canvas = Canvas::new(frame_size(width, height)?, BACKGROUND);
    canvas.write(GAP, GAP, &heading(bounces), TITLE);
    for (at, column) in columns.iter().enumerate() {
        let x = GAP + at % ACROSS * (wide + GAP);
        let y = head + at / ACROSS * block;
        column.draw(&mut canvas, (x, y));
    }
    let below = height - GAP - note.len() * LINE;
    for (at, line) in note.iter().enumerate() {
        canvas.write(GAP, below + at * LINE, line, TEXT);
    }
    Some(canvas.finish())
}

impl Column {
    fn draw(&self, canvas: &mut Canvas, (x, y): (usize, usize)) {
        canvas.write(x, y, &self.title, TITLE);
        for (at, line) in self.lines.iter().enumerate() {
            canvas.write(x, y + (at + 1) * LINE, line, TEXT);
        }
        let top = y + 3 * LINE + GAP / 2;
        canvas.place(x, top, &self.light.for_display());
        if self.factor > 1.0 {
            let below = top + self.light.size().height() + GAP / 2;
            canvas.write(x, below, &format!("{} times brighter", self.factor), TEXT);
            let brightened = self.light.scaled(self.factor);
            canvas.place(x, below + LINE, &brightened.for_display());
        }
    }
}

fn heading(bounces: &Bounces) -> String {
    let shot = &bounces.shot;
    match bounces.averaged {
        1 => format!(
            "Photograph {} ({}), bounce by bounce",
            shot.index, shot.role
        ),
        n => format!("Mean of {n} photographs ({}), bounce by bounce", shot.role),
    }
}

fn columns(bounces: &Bounces) -> Option<Vec<Column>> {
    let separated = &bounces.separated;
    let shown = |planes: &[Vec<f32>]| shown(separated.size, planes);
    let photograph = shown(&separated.photograph)?;
    let bright = brightness(&photograph);
    let mut columns = vec![Column {
        title: "Photograph".to_owned(),
        lines: [
            "black subtracted".to_owned(),
            "all pictures to one scale".to_owned(),
        ],
        factor: 1.0,
        light: photograph,
    }];
    for layer in &separated.layers {
        let light = shown(&layer.planes)?;
        columns.push(Column {
            title: title(layer.kind),
            lines: [
                format!(
                    "light {}, energy {}",
                    percent(layer.light_share),
                    percent(layer.energy_share)
                ),
                format!("rms {} x noise", number(layer.rms / bounces.noise.cell)),
            ],
            factor: round_factor(bright / brightness(&light).max(1e-9)),
            light,
        });
    }
    Some(columns)
}

fn title(kind: LayerKind) -> String {
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
        format!(
            "Noise: the camera's in the mean of a cell, {:.2e} of full scale (a pixel's is {:.2e}). \
             Light that was there under black ({} of all) is subtracted.",
            bounces.noise.cell,
            bounces.noise.pixel,
            percent(bounces.ambient_share),
        ),
    ]
}

/// The picture at a size that suits the sheet.
fn shown((width, height): (usize, usize), planes: &[Vec<f32>]) -> Option<LightPicture> {
    let mut light = LightPicture::new(frame_size(width, height)?, planes.to_vec())?;
    while light.size().width() > WIDEST && light.size().height() > 1 {
        light = light.halved();
    }
    let factor = (NARROWEST / light.size().width()).clamp(1, 8);
    if factor == 1 {
        return Some(light);
    }
    let (width, height) = (light.size().width(), light.size().height());
    let larger = |plane: &Vec<f32>| {
        let at = |pixel: usize| {
            let (x, y) = (pixel % (width * factor), pixel / (width * factor));
            plane[y / factor * width + x / factor]
        };
        (0..width * height * factor * factor).map(at).collect()
    };
    let planes = light.planes().iter().map(larger).collect();
    LightPicture::new(frame_size(width * factor, height * factor)?, planes)
}

/// What one value in two hundred is brighter than.
fn brightness(light: &LightPicture) -> f64 {
    let mut values: Vec<f32> = light.planes().iter().flatten().copied().collect();
    let at = values.len() - 1 - values.len() / 200;
    let (_, value, _) = values.select_nth_unstable_by(at, f32::total_cmp);
    f64::from(*value)
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
