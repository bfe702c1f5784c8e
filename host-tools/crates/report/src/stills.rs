//! Test images that show what interreflection does: bright panels beside dark ones, and a test card.
//!
//! Drawn by arithmetic at any size, in linear light, each pixel the mean of
//! several samples, so edges are smooth.

use crate::Wanted;
use iltm_picture::{
    LightPicture, Picture,
    canvas::{Canvas, FontWeight, RasterHeight, Type},
};
use iltm_runtime::FrameSize;
use std::f64::consts::TAU;

/// Samples along each side of a pixel.
const SAMPLES: usize = 3;

/// Linear red, green and blue, 0 to 1.
type LinearColour = [f64; 3];

/// Bright panels beside dark ones: what scatters from the bright shows on the dark.
#[must_use]
pub fn bright_and_dark(size: FrameSize) -> Wanted {
    Wanted {
        name: "panels",
        title: "Bright beside dark".to_owned(),
        remark: "Every second panel is bright. Its light falls on the dark panel opposite, most near the fold; \
                 the red panel's is red."
            .to_owned(),
        picture: paint(size, |x, y| {
            let (panel, along) = ((x * 4.0) as usize, (x * 4.0).fract());
            if panel.is_multiple_of(2) {
                [0.84 + 0.12 * (TAU * (1.5 * y + 0.5 * along)).sin(); 3]
            } else {
                disc_pattern(along, y)
            }
        }),
    }
}

/// Grey with darker and lighter discs.
fn disc_pattern(along: f64, y: f64) -> LinearColour {
    let (u, v) = (along * 3.0, y * 8.0);
    let (du, dv) = (u.fract() - 0.5, v.fract() - 0.5);
    let inside = du * du + dv * dv < 0.09;
    let lighter = (u as usize + v as usize).is_multiple_of(2);
    match (inside, lighter) {
        (true, true) => [0.45; 3],
        (true, false) => [0.22; 3],
        (false, _) => [0.32; 3],
    }
}

/// A test card: fine lines, pure colours, a ramp and words.
#[must_use]
pub fn test_card(size: FrameSize) -> Wanted {
    let picture = card(size);
    Wanted {
        name: "card",
        title: "Test card".to_owned(),
        remark: "Bars, fine lines, a ramp and lettering: light bleeds from one to the other where panels face \
                 each other, and edges show whether detail survives."
            .to_owned(),
        picture: lettered(&picture),
    }
}

/// The card without its name: circles are round and fields square on square pixels.
fn card(size: FrameSize) -> Picture {
    let (width, height) = (size.width() as f64, size.height() as f64);
    let shorter = width.min(height);
    paint(size, |x, y| {
        let (dx, dy) = ((x - 0.5) * width / shorter, (y - 0.5) * height / shorter);
        card_at((x, y), (dx, dy))
    })
}

/// The card's light at a place, which is in parts of the picture and, from its middle, in units of
/// the shorter side.
fn card_at((x, y): (f64, f64), (dx, dy): (f64, f64)) -> LinearColour {
    const BARS: [LinearColour; 8] = [
        [0.75, 0.75, 0.75],
        [0.75, 0.75, 0.14],
        [0.14, 0.75, 0.75],
        [0.14, 0.75, 0.14],
        [0.75, 0.14, 0.75],
        [0.75, 0.14, 0.14],
        [0.14, 0.14, 0.75],
        [0.14, 0.14, 0.14],
    ];
    let radius = dx.hypot(dy);
    if radius < 0.44 && (radius - 0.43).abs() < 0.007 {
        return [0.9; 3];
    }
    if radius < 0.43 {
        return inner_card((dx, dy), radius);
    }
    if y > 0.78 {
        return BARS[((x * 8.0) as usize).min(7)];
    }
    if y < 0.14 {
        // Lines that get finer to the right.
        let phase = 12.0 * x + 22.0 * x * x;
        return if phase.fract() < 0.5 {
            [0.7; 3]
        } else {
            [0.14; 3]
        };
    }
    let line = |place: f64| (place - place.round()).abs() < 0.02;
    if line(dx * 16.0) || line(dy * 16.0) {
        [0.5; 3]
    } else {
        [0.22, 0.24, 0.28]
    }
}

/// What lies in the card's circle, from its middle.
fn inner_card((dx, dy): (f64, f64), radius: f64) -> LinearColour {
    if dy < -0.20 {
        return [0.85; 3];
    }
    if dy < -0.08 {
        let share = (dx / 0.9 + 0.5).clamp(0.0, 1.0);
        return [0.1 + 0.9 * share * share; 3];
    }
    if dy < 0.08 {
        return [0.16; 3];
    }
    let row = (dy - 0.08) * 24.0;
    if row < 4.0 {
        let fields = (dx * 24.0).floor() + row.floor();
        return if fields.rem_euclid(2.0) < 0.5 {
            [0.75; 3]
        } else {
            [0.16; 3]
        };
    }
    if radius < 0.43 && (dx.atan2(dy) * 24.0 / TAU).rem_euclid(1.0) < 0.5 {
        [0.75, 0.2, 0.14]
    } else {
        [0.7, 0.58, 0.25]
    }
}

/// The card with a name on the dark band across its circle.
fn lettered(picture: &Picture) -> Picture {
    let letters = Type {
        height: if picture.size().height() > 300 {
            RasterHeight::Size32
        } else {
            RasterHeight::Size20
        },
        weight: FontWeight::Bold,
        colour: [230; 3],
    };
    let (width, height) = (picture.size().width(), picture.size().height());
    let mut canvas = Canvas::new(picture.size(), [0; 3]);
    canvas.place(0, 0, picture);
    let text = "LIGHT TRANSPORT";
    let left = width.saturating_sub(letters.width(text)) / 2;
    let top = (height / 2).saturating_sub(letters.height.val() / 2);
    canvas.write(left, top, text, letters);
    canvas.finish()
}

/// Draws a picture from the light at each place, both axes 0 to 1.
fn paint(size: FrameSize, light: impl Fn(f64, f64) -> LinearColour) -> Picture {
    let place = |pixel: usize, sample: usize, length: usize| {
        (pixel as f64 + (sample as f64 + 0.5) / SAMPLES as f64) / length as f64
    };
    LightPicture::from_fn(size, 3, |channel, pixel| {
        let (col, row) = (pixel % size.width(), pixel / size.width());
        let samples = (0..SAMPLES * SAMPLES).map(|sample| {
            let x = place(col, sample % SAMPLES, size.width());
            let y = place(row, sample / SAMPLES, size.height());
            light(x, y)[channel] / (SAMPLES * SAMPLES) as f64
        });
        samples.sum::<f64>() as f32
    })
    .for_display()
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Samples;

    #[test]
    fn stills_are_drawn_at_any_size_and_span_the_range_of_light() {
        for (width, height) in [(24, 16), (480, 320)] {
            let size = FrameSize::new(width, height).unwrap();
            for wanted in [bright_and_dark(size), test_card(size)] {
                assert_eq!(
                    (wanted.picture.size(), wanted.picture.channels()),
                    (size, 3)
                );
                let Samples::Eight(samples) = wanted.picture.samples() else {
                    panic!("8 bits");
                };
                let (least, most) = (samples.iter().min(), samples.iter().max());
                assert!(
                    least < Some(&150) && most > Some(&220),
                    "{least:?} {most:?}"
                );
            }
        }
    }

    #[test]
    fn words_are_on_the_card() {
        let size = FrameSize::new(480, 320).unwrap();
        assert_ne!(test_card(size).picture, card(size));
    }

    #[test]
    fn the_circle_is_round_on_pictures_of_every_aspect() {
        for (width, height) in [(480, 320), (640, 360), (360, 640), (300, 300)] {
            let card = card(FrameSize::new(width, height).unwrap());
            let Samples::Eight(samples) = card.samples() else {
                panic!("8 bits");
            };
            let (width, height) = (usize::from(width), usize::from(height));
            let radius = 0.435 * width.min(height) as f64;
            for angle in [0.0_f64, 0.1, 0.25, 0.4, 0.5, 0.75, 0.9] {
                let (sin, cos) = (angle * TAU).sin_cos();
                let col = (width as f64 / 2.0 + radius * cos) as usize;
                let row = (height as f64 / 2.0 + radius * sin) as usize;
                let red = samples[3 * (row * width + col)];
                assert!(red > 235, "{width} x {height}, {angle}: {red}");
            }
        }
    }
}
