//! Injected faults: what goes wrong at real installations, done to simulated photographs on
//! purpose, to practise with and to test the gates before a solve against.

use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;
use strum::{Display, EnumIter, EnumString, VariantNames};
use thiserror::Error;

/// What can go wrong while a scene is photographed. Its name on the command line is its own in
/// small letters.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Display, EnumIter, EnumString, VariantNames,
)]
#[strum(serialize_all = "kebab-case")]
pub enum CaptureFault {
    /// The camera's values follow another gamma than `capture.toml` says.
    Gamma,
    /// The camera exposes each photograph for its own brightness.
    AutoExposure,
    /// Somebody touches the tripod after two thirds of the photographs.
    Tripod,
    /// Two photographs have each other's names.
    Swapped,
    /// The camera missed a photograph: the file is not there.
    Dropped,
    /// The camera missed a photograph, and all later ones have the name of the one
    /// before; the last was taken twice.
    Skipped,
    /// White is brighter than the camera can tell.
    Clipped,
    /// The projector bends its response, adds white to grey and dims dark pictures.
    Vivid,
    /// Bright and dark bands of mains light, elsewhere in each photograph.
    Flicker,
}

impl CaptureFault {
    /// What its size is, the size where none is given, and the least and the largest.
    const fn sizes(self) -> (&'static str, f64, [f64; 2]) {
        match self {
            Self::Gamma => ("the camera's gamma", 2.2, [0.2, 5.0]),
            Self::AutoExposure => ("part of the brightness evened out", 1.0, [0.0, 1.0]),
            Self::Tripod => ("pixels", 3.0, [0.0, 1e3]),
            Self::Swapped | Self::Dropped | Self::Skipped => (
                "place of the photograph, 0 to 1 of the session",
                0.6,
                [0.0, 1.0],
            ),
            Self::Clipped => ("times the exposure", 1.6, [1.0, 100.0]),
            Self::Vivid => (
                "part of the light that a black picture loses",
                0.15,
                [0.0, 1.0],
            ),
            Self::Flicker => ("amplitude of the bands", 0.03, [0.0, 1.0]),
        }
    }
}

/// A fault that is simulated, and its size.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct InjectedFault {
    /// What happens.
    pub kind: CaptureFault,
    /// How much of it, in its own unit.
    pub size: f64,
}

/// A text that no [`InjectedFault`] has.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum UnknownFault {
    /// The name is none.
    #[error("there is no fault `{name}`; there are {}", CaptureFault::VARIANTS.join(", "))]
    Name {
        /// What stands there.
        name: String,
    },
    /// The size is none.
    #[error("{kind}: `{size}` is not {what}, from {} to {}", range[0], range[1])]
    Size {
        /// Which fault.
        kind: CaptureFault,
        /// What stands there.
        size: String,
        /// What the size is.
        what: &'static str,
        /// Least and largest, as text.
        range: [String; 2],
    },
}

impl From<CaptureFault> for InjectedFault {
    /// Of the size that it is likely to have.
    fn from(kind: CaptureFault) -> Self {
        let (_, size, _) = kind.sizes();
        Self { kind, size }
    }
}

impl FromStr for InjectedFault {
    type Err = UnknownFault;

    /// Reads `NAME` or `NAME=SIZE`.
    fn from_str(text: &str) -> Result<Self, UnknownFault> {
        let (name, size) = match text.split_once('=') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        let kind: CaptureFault = name.parse().map_err(|_| UnknownFault::Name {
            name: name.to_owned(),
        })?;
        let Some(size) = size else {
            return Ok(kind.into());
        };
        let (what, _, [least, most]) = kind.sizes();
        let number = size.parse().ok().filter(|n| (least..=most).contains(n));
        number
            .map(|size| Self { kind, size })
            .ok_or_else(|| UnknownFault::Size {
                kind,
                size: size.to_owned(),
                what,
                range: [least.to_string(), most.to_string()],
            })
    }
}

impl fmt::Display for InjectedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.kind, self.size)
    }
}

/// All that goes wrong in one session of `count` photographs.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct InjectedFaults<'f> {
    pub(super) faults: &'f [InjectedFault],
    pub(super) count: usize,
}

impl InjectedFaults<'_> {
    /// Size of a kind, if it happens.
    pub(super) fn size(&self, kind: CaptureFault) -> Option<f64> {
        let found = self.faults.iter().find(|fault| fault.kind == kind);
        found.map(|fault| fault.size)
    }

    /// Place in the session that a size from 0 to 1 means; never its first four
    /// photographs, nor its last, which could not be exchanged with a later one.
    fn place(&self, size: f64) -> usize {
        let last = self.count.saturating_sub(2);
        ((size * self.count as f64) as usize).clamp(4.min(last), last)
    }

    /// Which slide the photograph at `place` shows; `None` if there is none.
    pub(super) fn shown_at(&self, place: usize) -> Option<usize> {
        let at = |kind| self.size(kind).map(|size| self.place(size));
        if at(CaptureFault::Dropped) == Some(place) {
            return None;
        }
        if at(CaptureFault::Skipped).is_some_and(|skipped| place >= skipped) {
            return Some((place + 1).min(self.count - 1));
        }
        match at(CaptureFault::Swapped) {
            Some(first) if place == first => Some(first + 1),
            Some(first) if place == first + 1 => Some(first),
            _ => Some(place),
        }
    }

    /// Light that a projector with light `wanted` (by channel, 0 to 1) makes of it.
    pub(super) fn projected(&self, wanted: [f64; 3]) -> [f64; 3] {
        if self.size(CaptureFault::Vivid).is_none() {
            return wanted;
        }
        // An S through 0, half and 1; then a white segment for what is grey.
        let bent = wanted.map(|light| light * light * (3.0 - 2.0 * light));
        let grey = bent.into_iter().fold(f64::INFINITY, f64::min);
        bent.map(|light| (0.7 * light + 0.3 * grey).min(1.0))
    }

    /// Part of its light that the projector has left for a picture whose mean light is
    /// `mean`.
    pub(super) fn dimmed(&self, mean: f64) -> f64 {
        let most = self.size(CaptureFault::Vivid).unwrap_or(0.0);
        1.0 - most * (1.0 - mean)
    }

    /// Exposure of a photograph whose mean light is `mean`, relative to that of white,
    /// whose mean light is `white`.
    pub(super) fn exposure(&self, mean: f64, white: f64) -> f64 {
        let clipped = self.size(CaptureFault::Clipped).unwrap_or(1.0);
        let follows = self.size(CaptureFault::AutoExposure).unwrap_or(0.0);
        // No camera exposes a thousand times as long.
        clipped * (white / mean.max(1e-3 * white)).powf(follows)
    }

    /// What the photograph at `place` looks like, `light` being one plane a channel, row
    /// by row, `width` across.
    pub(super) fn disturb(&self, light: &mut [Vec<f32>], width: usize, place: usize) {
        if let Some(pixels) = self.size(CaptureFault::Tripod)
            && 3 * place >= 2 * self.count
        {
            for plane in &mut *light {
                *plane = moved(plane, width, [0.8 * pixels, 0.6 * pixels]);
            }
        }
        if let Some(amplitude) = self.size(CaptureFault::Flicker) {
            for plane in light {
                banded(plane, width, amplitude, place);
            }
        }
    }
}

/// A plane as a camera sees it that has moved by `[right, down]` pixels; what comes in at
/// the border is what was there.
fn moved(plane: &[f32], width: usize, [right, down]: [f64; 2]) -> Vec<f32> {
    let height = plane.len() / width;
    let at = |x: isize, y: isize| {
        let x = x.clamp(0, width as isize - 1) as usize;
        let y = y.clamp(0, height as isize - 1) as usize;
        plane[y * width + x]
    };
    let [(left, u), (top, v)] = [right, down].map(|step| {
        let whole = step.floor();
        (whole as isize, (step - whole) as f32)
    });
    let pixel = |pixel: usize| {
        let (x, y) = (
            (pixel % width) as isize + left,
            (pixel / width) as isize + top,
        );
        let upper = (1.0 - u) * at(x, y) + u * at(x + 1, y);
        let lower = (1.0 - u) * at(x, y + 1) + u * at(x + 1, y + 1);
        (1.0 - v) * upper + v * lower
    };
    (0..plane.len()).map(pixel).collect()
}

/// Bands over the rows: a shutter that rolls for a frame of 30 a second sees 3.3 half
/// waves of 50 Hz, and the next photograph begins at another phase.
fn banded(plane: &mut [f32], width: usize, amplitude: f64, place: usize) {
    /// Of the golden ratio: no two photographs have nearly the same phase.
    const PHASE: f64 = 0.618_034;
    const BANDS: f64 = 3.3;
    let height = (plane.len() / width).max(1) as f64;
    for (row, line) in plane.chunks_mut(width).enumerate() {
        let phase = BANDS * row as f64 / height + PHASE * place as f64;
        let gain = (1.0 + amplitude * (TAU * phase).sin()) as f32;
        for light in line {
            *light *= gain;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strum::IntoEnumIterator;

    fn faults(faults: &[InjectedFault]) -> InjectedFaults<'_> {
        InjectedFaults { faults, count: 100 }
    }

    #[test]
    fn a_fault_is_read_with_or_without_a_size_and_written_back() {
        for kind in CaptureFault::iter() {
            let usual: InjectedFault = kind.to_string().parse().unwrap();
            assert_eq!(usual, kind.into());
            assert_eq!(usual.to_string().parse(), Ok(usual));
        }
        let error = "flicker=2"
            .parse::<InjectedFault>()
            .unwrap_err()
            .to_string();
        assert!(error.contains("from 0 to 1"), "{error}");
        let error = "flikker".parse::<InjectedFault>().unwrap_err().to_string();
        assert!(error.contains("auto-exposure, tripod"), "{error}");
    }

    #[test]
    fn photographs_are_exchanged_missing_or_late_from_the_place_on() {
        let of = |text: &str| -> Vec<Option<usize>> {
            let fault = [text.parse().unwrap()];
            (58..=62)
                .map(|place| faults(&fault).shown_at(place))
                .collect()
        };
        let some = |places: [usize; 5]| places.map(Some).to_vec();
        assert_eq!(of("swapped"), some([58, 59, 61, 60, 62]));
        assert_eq!(of("skipped"), some([58, 59, 61, 62, 63]));
        assert_eq!(of("dropped")[2], None);
        let last = [InjectedFault::from(CaptureFault::Skipped)];
        assert_eq!(faults(&last).shown_at(99), Some(99));
    }

    #[test]
    fn a_plane_moves_by_parts_of_a_pixel() {
        // Linear in the place, so that interpolation is exact inside.
        let plane: Vec<f32> = (0..80)
            .map(|k| (k % 10) as f32 + 10.0 * (k / 10) as f32)
            .collect();
        let moved = moved(&plane, 10, [1.25, 2.5]);
        assert!((moved[33] - (plane[33] + 1.25 + 25.0)).abs() < 1e-4);
    }

    #[test]
    fn a_camera_that_exposes_for_the_mean_makes_all_means_alike() {
        let fault = [InjectedFault::from(CaptureFault::AutoExposure)];
        assert!((0.2 * faults(&fault).exposure(0.2, 0.8) - 0.8).abs() < 1e-12);
    }

    #[test]
    fn a_vivid_projector_keeps_black_and_white_and_bends_the_rest() {
        let fault = [InjectedFault::from(CaptureFault::Vivid)];
        let vivid = faults(&fault);
        assert!(
            vivid
                .projected([0.0; 3])
                .iter()
                .all(|light| light.abs() < 1e-12)
        );
        let white = vivid.projected([1.0; 3]);
        assert!(white.iter().all(|light| (light - 1.0).abs() < 1e-12));
        let red = vivid.projected([1.0, 0.0, 0.0]);
        assert!((red[0] - 0.7).abs() < 1e-12);
        assert!((vivid.dimmed(0.5) - 0.925).abs() < 1e-12);
    }
}
