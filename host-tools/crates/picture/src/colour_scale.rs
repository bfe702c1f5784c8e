//! Colour scales: from numbers to colours, and the ticks that say which is which.
//!
//! The colours are magma and viridis: their lightness rises evenly, so that more
//! looks like more, also in grey and to eyes that see fewer colours.

use crate::Picture;
use crate::numbers::{decades, number, steps};
use iltm_runtime::FrameSize;

/// Colours of a picture: more than an eye tells apart in it, and few enough to make
/// it a small file.
pub const SHADES: u32 = 96;

/// Which colours.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Palette {
    /// Black, purple, orange, pale yellow.
    Magma,
    /// Dark purple, green, yellow.
    Viridis,
}

/// How numbers are spread over the colours.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Spread {
    /// Equal differences look alike.
    Linear,
    /// Equal ratios look alike.
    Logarithmic,
}

/// A range of numbers as colours; numbers outside have the end's colour.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ColourScale {
    palette: Palette,
    spread: Spread,
    low: f64,
    high: f64,
}

/// A labelled place of a colour bar.
#[derive(Clone, PartialEq, Debug)]
pub struct Tick {
    /// 0 at the dark end, 1 at the bright one.
    pub place: f64,
    /// The number.
    pub label: String,
}

impl ColourScale {
    /// From 0 to `high`.
    #[must_use]
    pub const fn linear(palette: Palette, high: f64) -> Self {
        Self {
            palette,
            spread: Spread::Linear,
            low: 0.0,
            high,
        }
    }

    /// Over `decades` powers of ten below `high`.
    #[must_use]
    pub fn logarithmic(palette: Palette, high: f64, decades: i32) -> Self {
        Self {
            palette,
            spread: Spread::Logarithmic,
            low: high / 10_f64.powi(decades),
            high,
        }
    }

    /// Where a number lies, 0 to 1.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        let place = match self.spread {
            Spread::Linear => (value - self.low) / (self.high - self.low),
            Spread::Logarithmic => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        // Nothing at all, on a logarithmic scale, is minus infinity or undefined.
        if place.is_nan() {
            0.0
        } else {
            place.clamp(0.0, 1.0)
        }
    }

    /// The sRGB colour of a number.
    #[must_use]
    pub fn colour(&self, value: f64) -> [u8; 3] {
        self.colour_at(self.place(value))
    }

    /// The sRGB colour at a place of the bar, 0 to 1.
    #[must_use]
    pub fn colour_at(&self, place: f64) -> [u8; 3] {
        let gradient = match self.palette {
            Palette::Magma => colorous::MAGMA,
            Palette::Viridis => colorous::VIRIDIS,
        };
        let colour = gradient.eval_continuous(place);
        [colour.r, colour.g, colour.b]
    }

    /// A picture of numbers, one a pixel, row by row, in [`SHADES`] colours.
    ///
    /// # Panics
    /// If there is not one for each pixel.
    #[must_use]
    pub fn picture(&self, size: FrameSize, values: impl IntoIterator<Item = f64>) -> Picture {
        let last = f64::from(SHADES - 1);
        let shade = |value| self.colour_at((self.place(value) * last).round() / last);
        let samples: Vec<u8> = values.into_iter().flat_map(shade).collect();
        assert_eq!(samples.len(), 3 * size.pixels(), "a number a pixel");
        Picture::of_colours(size, samples)
    }

    /// Places to label: powers of ten, or steps of 1, 2 or 5.
    #[must_use]
    pub fn ticks(&self) -> Vec<Tick> {
        let tick = |value: f64| Tick {
            place: self.place(value),
            label: number(value),
        };
        match self.spread {
            Spread::Linear => steps(self.low, self.high, 4)
                .into_iter()
                .map(tick)
                .collect(),
            Spread::Logarithmic => decades(self.low, self.high).into_iter().map(tick).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Response;

    /// CIE 1976 L* of an sRGB colour, from its relative luminance (IEC 61966-2-1,
    /// CIE 15).
    fn lightness([red, green, blue]: [u8; 3]) -> f64 {
        let light = |code: u8| Response::Srgb.light(f64::from(code) / 255.0);
        let luminance = 0.2126 * light(red) + 0.7152 * light(green) + 0.0722 * light(blue);
        if luminance > 216.0 / 24_389.0 {
            116.0 * luminance.cbrt() - 16.0
        } else {
            luminance * 24_389.0 / 27.0
        }
    }

    #[test]
    fn more_is_lighter() {
        for palette in [Palette::Magma, Palette::Viridis] {
            let scale = ColourScale::linear(palette, 1.0);
            let steps: Vec<f64> = (0..=64)
                .map(|step| lightness(scale.colour(f64::from(step) / 64.0)))
                .collect();
            assert!(
                steps.windows(2).all(|pair| pair[0] < pair[1]),
                "{palette:?} {steps:?}"
            );
            assert!(steps[64] - steps[0] > 70.0);
        }
    }

    #[test]
    fn numbers_outside_have_the_colour_of_the_end() {
        let scale = ColourScale::logarithmic(Palette::Viridis, 1.0, 3);
        assert_eq!(scale.colour(0.0), scale.colour(1e-3));
        assert_eq!(scale.colour(f64::NAN), scale.colour(1e-3));
        assert_eq!(scale.colour(7.0), scale.colour(1.0));
        assert!((scale.place(10_f64.powf(-1.5)) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let labels = |scale: ColourScale| -> Vec<String> {
            scale.ticks().into_iter().map(|tick| tick.label).collect()
        };
        let linear = ColourScale::linear(Palette::Magma, 0.2);
        assert_eq!(labels(linear), ["0", "0.05", "0.1", "0.15", "0.2"]);
        let logarithmic = ColourScale::logarithmic(Palette::Magma, 3.0, 3);
        assert_eq!(labels(logarithmic), ["0.01", "0.1", "1"]);
    }
}
