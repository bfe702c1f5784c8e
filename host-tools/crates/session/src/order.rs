//! Order of showing: which pictures, and one after the other.

use super::Layout;
use super::calibration_pictures::{even, probes, ramp_roles};
use iltm_capture::{CalibrationRole, CodeAxis, Role, StripeRole, pattern_set};
use iltm_picture::{Picture, Response, Samples};
use iltm_runtime::{FrameSize, Grid};

/// What a picture is shown for: which list it stands in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Purpose {
    /// To learn the scene: `capture.csv`.
    Scene(Role),
    /// To measure projector and camera: `calibration.csv`.
    Calibration(CalibrationRole),
    /// To see the projector's pixels: `stripes.csv`.
    Stripes(StripeRole),
}

/// One picture to show.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Slide {
    /// What for.
    pub purpose: Purpose,
    /// One pixel a cell, 8 bits, grey or RGB; of fine stripes and images, one a pixel of the
    /// projector inside its border.
    pub picture: Picture,
}

/// What to show.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct OrderOptions {
    /// Bernoulli patterns.
    pub bernoulli: usize,
    /// Images, one pixel a pixel of the projector inside its border, 8 bits.
    pub images: Vec<Picture>,
    /// Seed of the Bernoulli patterns.
    pub seed: u64,
    /// Levels of the response ramp, in white and in each channel, 2 to 256; 0 for
    /// none.
    pub ramp: u16,
    /// Whether stripes finer than the cells are shown.
    pub stripes: bool,
    /// Whether blur is probed.
    pub probe: bool,
    /// White and black are shown again after so many others, at least 1.
    pub repeat_every: usize,
}

impl Default for OrderOptions {
    fn default() -> Self {
        Self {
            bernoulli: 150,
            images: Vec::new(),
            seed: 1,
            ramp: 9,
            stripes: true,
            probe: true,
            repeat_every: 16,
        }
    }
}

/// White and black, the ramps and probes, then the patterns of [`pattern_set`], fine stripes
/// after the Gray code; white and black again every [`OrderOptions::repeat_every`] pictures and
/// at the very end, which shows whether lamp, camera or scene changed meanwhile.
///
/// Bernoulli patterns come last, and images behind them, so that a session that had to stop early still has
/// all that a solve needs, but fewer of them.
#[must_use]
pub fn order(layout: &Layout, options: &OrderOptions) -> Vec<Slide> {
    let grid = layout.grid();
    let mut flood = Vec::new();
    let mut others = calibration(grid, options);
    let mut stripes = if options.stripes {
        fine_stripes(layout)
    } else {
        Vec::new()
    };
    for (role, pattern) in pattern_set(grid, options.bernoulli, options.seed) {
        let list = match role {
            Role::White | Role::Black => &mut flood,
            Role::Bernoulli => {
                others.append(&mut stripes);
                &mut others
            }
            Role::Column { .. } | Role::Row { .. } | Role::Image => &mut others,
        };
        list.extend(slide(Purpose::Scene(role), binary(grid, &pattern.lit)));
    }
    others.append(&mut stripes);
    others.extend(options.images.iter().map(|picture| Slide {
        purpose: Purpose::Scene(Role::Image),
        picture: picture.clone(),
    }));
    let mut slides = flood.clone();
    let mut since = 0;
    for slide in others {
        if since == options.repeat_every.max(1) {
            slides.extend_from_slice(&flood);
            since = 0;
        }
        slides.push(slide);
        since += 1;
    }
    slides.extend(flood);
    slides
}

/// Stripes finer than the cells, of both axes, as a projector that follows sRGB shows them.
pub(crate) fn fine_stripes(layout: &Layout) -> Vec<Slide> {
    let (grid, inner) = (layout.grid(), layout.inner());
    let sides = [
        (CodeAxis::Column, grid.cols(), inner.width()),
        (CodeAxis::Row, grid.rows(), inner.height()),
    ];
    let of_axis = |(axis, cells, pixels): (CodeAxis, usize, usize)| {
        let (roles, bits) = StripeRole::of_axis(axis, cells, pixels);
        roles.into_iter().filter_map(move |role| {
            let code = |at: usize| {
                let value = Response::Srgb.value(role.light(at, pixels, cells, bits));
                (255.0 * value).round() as u8
            };
            let codes: Vec<u8> = (0..pixels).map(code).collect();
            let at = |pixel: usize| match axis {
                CodeAxis::Column => codes[pixel % inner.width()],
                CodeAxis::Row => codes[pixel / inner.width()],
            };
            let samples = (0..inner.pixels()).map(at).collect();
            let picture = Picture::new(inner, Samples::Eight(samples));
            slide(Purpose::Stripes(role), picture)
        })
    };
    sides.into_iter().flat_map(of_axis).collect()
}

/// Ramps and probes.
fn calibration(grid: Grid, options: &OrderOptions) -> Vec<Slide> {
    let ramps = ramp_roles(options.ramp).into_iter().filter_map(|role| {
        let CalibrationRole::Ramp { channel, level } = role else {
            return None;
        };
        let cells = even(grid, channel.input(level));
        slide(Purpose::Calibration(role), cells)
    });
    let probing = if options.probe {
        probes(grid)
    } else {
        Vec::new()
    };
    let probe = |lit: Vec<bool>| {
        let role = CalibrationRole::Probe;
        slide(Purpose::Calibration(role), binary(grid, &lit))
    };
    ramps.chain(probing.into_iter().filter_map(probe)).collect()
}

fn slide(purpose: Purpose, picture: Option<Picture>) -> Option<Slide> {
    picture.map(|picture| Slide { purpose, picture })
}

/// Lit cells as 255, others as 0; `None` unless there is one of each.
fn binary(grid: Grid, lit: &[bool]) -> Option<Picture> {
    let samples = lit.iter().map(|lit| 255 * u8::from(*lit)).collect();
    Picture::new(FrameSize::of_grid(grid), Samples::Eight(samples))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(rows: u16, cols: u16) -> Layout {
        let projector = FrameSize::new(16 * cols, 9 * rows).unwrap();
        Layout::new(Grid::new(rows, cols).unwrap(), projector, 0).unwrap()
    }

    fn purposes(options: &OrderOptions) -> Vec<Purpose> {
        let slides = order(&layout(3, 5), options);
        slides.iter().map(|slide| slide.purpose).collect()
    }

    const WHITE: Purpose = Purpose::Scene(Role::White);
    const BLACK: Purpose = Purpose::Scene(Role::Black);

    #[test]
    fn white_and_black_come_first_last_and_at_least_as_often_as_asked() {
        for repeat_every in [1, 2, 5, 16, 1000] {
            let options = OrderOptions {
                repeat_every,
                bernoulli: 20,
                ..OrderOptions::default()
            };
            let purposes = purposes(&options);
            // Two halvings and a wave of four steps along each side.
            let stripes = 2 * (2 * 2 + 4);
            assert_eq!(purposes[..2], [WHITE, BLACK]);
            assert_eq!(purposes[purposes.len() - 2..], [WHITE, BLACK]);
            let between = purposes.split(|purpose| [WHITE, BLACK].contains(purpose));
            assert_eq!(
                between.map(<[_]>::len).max(),
                Some(repeat_every.min(33 + 1 + 10 + stripes + 20))
            );
            // And never twice in a row.
            let pairs = purposes.windows(2);
            assert!(!pairs.clone().any(|pair| pair == [BLACK, WHITE]));
        }
    }

    #[test]
    fn the_patterns_are_those_that_a_simulation_shows_in_the_same_order() {
        let grid = Grid::new(3, 5).unwrap();
        let options = OrderOptions {
            bernoulli: 40,
            seed: 9,
            ..OrderOptions::default()
        };
        let once = |purpose: &Purpose| match purpose {
            Purpose::Scene(Role::White | Role::Black)
            | Purpose::Calibration(_)
            | Purpose::Stripes(_) => None,
            Purpose::Scene(role) => Some(*role),
        };
        let slides = order(&layout(3, 5), &options);
        let slides: Vec<(Role, &Picture)> = slides
            .iter()
            .filter_map(|slide| Some((once(&slide.purpose)?, &slide.picture)))
            .collect();
        let simulated = pattern_set(grid, 40, 9);
        assert_eq!(slides.len(), simulated.len() - 2);
        for ((role, cells), (expected, pattern)) in slides.iter().zip(&simulated[2..]) {
            assert_eq!(role, expected);
            assert_eq!(Some((*cells).clone()), binary(grid, &pattern.lit));
        }
    }

    #[test]
    fn without_ramp_and_probe_nothing_is_calibrated() {
        let options = OrderOptions {
            ramp: 0,
            probe: false,
            ..OrderOptions::default()
        };
        let is_calibration = |purpose: &Purpose| matches!(purpose, Purpose::Calibration(_));
        assert!(!purposes(&options).iter().any(is_calibration));
        assert!(
            purposes(&OrderOptions::default())
                .iter()
                .any(is_calibration)
        );
    }
}
