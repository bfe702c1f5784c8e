//! Outcome: a table keeps its promise, breaks it, or the photographs cannot tell.
//!
//! The photographs are judged before the table: a capture's gates look at those of the code.
//! A table passes only on photographs that every gate accepts. It fails where the error is
//! larger than everything that the photographs' own faults explain. Between the two, nobody
//! knows.

use super::{Bound, Curve, Drift, PixelVerdict};
use iltm_capture::{CellReadings, Gate, GateName, Nonlinearity, PictureShift};
use strum::IntoStaticStr;

/// What a verification says of a table.
#[derive(Clone, Copy, PartialEq, Eq, Debug, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Outcome {
    /// The error on the wall is within what the table promises.
    Passed,
    /// It is not.
    Failed,
    /// These photographs cannot tell.
    Inconclusive,
}

/// Why a table did not pass.
#[derive(Clone, Copy, PartialEq, Eq, Debug, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Cause {
    /// Camera, projector or scene moved between the photographs.
    Moved,
    /// Photographs show the patterns of other lines.
    Order,
    /// White is beyond the camera's full scale.
    Clipped,
    /// Brightness jumps from photograph to photograph or runs across them in bands.
    Flicker,
    /// Brightness changed over the session.
    Drift,
    /// The camera exposes each photograph for its own brightness.
    AutoExposure,
    /// The camera's values follow another curve than is declared.
    CameraResponse,
    /// A curve explains the error: the camera's, or the projector's.
    Response,
    /// Light does not add up, and nothing says why.
    Superposition,
    /// Photographs of the same picture differ among themselves.
    Noise,
    /// White looks different from cell to cell than the table expects, by no more than another
    /// place of the camera explains.
    Viewpoint,
    /// The projector's light follows the picture.
    DynamicProjector,
    /// Player, device and projector do something else than to compensate the slides once.
    Chain,
    /// White is another than when the table was made: projector, scene, or another table.
    Scene,
    /// The picture lies elsewhere on the wall than when the table was made.
    Nudged,
    /// Two projectors show each other's pictures.
    Exchanged,
    /// White is as it was from cell to cell, and not within the cells: paint, dirt, or a screen that
    /// hangs otherwise.
    Texture,
    /// The colours of white are others than when the table was made.
    Colour,
    /// White is as it was, and the images are not: the projector's response, or a bad table.
    ProjectorResponse,
    /// The table does not tell how bright white should be.
    Unknown,
}

impl Outcome {
    /// Its name for programs.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// In words, a sentence without its point.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Passed => "The table keeps its promise",
            Self::Failed => "The table does not keep its promise",
            Self::Inconclusive => "These photographs cannot tell",
        }
    }
}

impl Cause {
    /// Its name for programs.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether photographs with it cannot even be told from each other.
    pub(super) const fn spoils_pictures(self) -> bool {
        matches!(self, Self::Moved | Self::Order | Self::Clipped)
    }

    /// What to do about it, a sentence or two.
    #[must_use]
    pub const fn next_step(self) -> &'static str {
        match self {
            Self::Moved => {
                "Fix tripod, projector and scene, use a remote release, and take all photographs \
                 again."
            }
            Self::Order => "Put the photographs in the order of verify.csv, or take them again.",
            Self::Clipped => {
                "Take the photographs again with a shorter exposure: white at about 80 % of full \
                 scale."
            }
            Self::Flicker => {
                "Set a longer exposure that is a multiple of the projector's refresh period and of \
                 the mains' (1/25 or 1/30 s and longer), switch lamps off, and photograph again."
            }
            Self::Drift => {
                "Let the projector warm up for 20 minutes, keep daylight out, and photograph again."
            }
            Self::AutoExposure => {
                "Set exposure, gain (ISO) and white balance by hand, and photograph again."
            }
            Self::CameraResponse | Self::Response => {
                "State the camera's response in capture.toml ([camera] response = \"srgb\" for camera \
                 JPEGs, a gamma number, or \"measure\") and verify again; no new photographs are \
                 needed."
            }
            Self::Superposition => {
                "Set exposure, gain (ISO) and white balance by hand, switch off the projector's \
                 dynamic modes, keep other light out, and photograph again."
            }
            Self::Noise => {
                "Fix tripod, projector and scene, use a remote release, keep other light out, expose \
                 until white reaches 80 % of full scale at the least gain (ISO), and photograph again."
            }
            Self::Viewpoint => {
                "Put the camera where it stood for the table's own photographs, and photograph \
                 again."
            }
            Self::DynamicProjector => {
                "Choose the projector's sRGB, film or photo mode, switch off dynamic contrast, iris \
                 and eco modes, and photograph again."
            }
            Self::Chain => {
                "Set player, device and projector so that exactly one of them compensates, and no \
                 one after it scales, shifts or mirrors the picture; then photograph again."
            }
            Self::Nudged => {
                "Put the projector back, or its lens shift, keystone and zoom, until the picture lies \
                 where it lay, and verify again; or take a new capture and solve it."
            }
            Self::Exchanged => {
                "Exchange their cables, or their displays in the computer's settings, and photograph \
                 again."
            }
            Self::Texture => {
                "Look at the page's map of the pixels' errors for what has changed on the wall. If it \
                 stays, take a new capture and solve it, or let `iltm refine` feed these photographs \
                 back."
            }
            Self::Scene | Self::Colour | Self::ProjectorResponse | Self::Unknown => {
                "Put the projector back as it was when the table was made and verify again; if it is \
                 as it was, take a new capture and solve it."
            }
        }
    }
}

/// A gate that refuses the photographs, as a cause.
fn blamed(gate: &Gate, nonlinearity: Option<Nonlinearity>) -> Option<Cause> {
    let cause = match gate.name {
        GateName::Movement => Cause::Moved,
        GateName::Order => Cause::Order,
        GateName::Saturation => Cause::Clipped,
        GateName::Flicker => Cause::Flicker,
        GateName::Drift => Cause::Drift,
        GateName::Response => Cause::CameraResponse,
        GateName::Superposition => match nonlinearity {
            Some(Nonlinearity::Curve { .. }) => Cause::CameraResponse,
            Some(Nonlinearity::Exposure) => Cause::AutoExposure,
            Some(Nonlinearity::Projector) => Cause::DynamicProjector,
            Some(
                Nonlinearity::Either | Nonlinearity::CurveOrExposure { .. } | Nonlinearity::Unknown,
            )
            | None => Cause::Superposition,
        },
        // What these measure is in the noise of the photographs and the cells that are compared.
        GateName::Complete | GateName::Format | GateName::Coverage | GateName::Noise => {
            return None;
        }
    };
    gate.fails().then_some(cause)
}

/// The first cause for which the photographs cannot be believed, and its gate.
#[must_use]
pub fn refused(readings: &CellReadings) -> Option<(Cause, &Gate)> {
    let of_gate = |gate| Some((blamed(gate, readings.cause)?, gate));
    readings.gates.iter().find_map(of_gate)
}

/// Part of an error that a curve must leave at most to be its cause.
const EXPLAINED: f64 = 0.7;

/// Powers of light up to this one, or its inverse, cannot be seen where patterns and their
/// inverses add up.
const UNSEEN: f64 = 1.15;

/// What follows from an error with compensation.
pub(super) fn decide(
    error: f64,
    bound: &Bound,
    (readings, drift, curve): (&CellReadings, &Drift, Curve),
) -> (Outcome, Option<Cause>) {
    let refused = refused(readings).map(|(cause, _)| cause);
    let fits = error <= bound.limit;
    let bent = error > bound.promise && curve.left < EXPLAINED * error && curve.left <= bound.limit;
    match refused {
        Some(Cause::DynamicProjector) => (Outcome::Failed, refused),
        // Light adds up once it is bent back, and the error is gone with that.
        Some(Cause::Superposition) if bent => (Outcome::Inconclusive, Some(Cause::CameraResponse)),
        // Brightness that follows the picture is one factor a photograph, which errors leave out.
        Some(Cause::Superposition) if error > bound.doubt => {
            (Outcome::Failed, Some(changed(bound, drift)))
        }
        Some(_) => (Outcome::Inconclusive, refused),
        None if bent && (fits || curve.power.ln().abs() < UNSEEN.ln()) => {
            (Outcome::Inconclusive, Some(Cause::Response))
        }
        None if error > bound.doubt => (Outcome::Failed, Some(changed(bound, drift))),
        // Photographs that differ by many times what is promised tell nothing, however small
        // the error is.
        None if fits => match bound.unsure() {
            None => (Outcome::Passed, None),
            why => (Outcome::Inconclusive, why),
        },
        None => (Outcome::Inconclusive, Some(bound.worst())),
    }
}

/// What follows from an error at pixels where cells have said this.
pub(super) fn decide_by_pixels(
    pixels: &PixelVerdict,
    (outcome, cause): (Outcome, Option<Cause>),
) -> (Outcome, Option<Cause>) {
    let (Some(fixed), Some(bound)) = (&pixels.fixed, &pixels.bound) else {
        return (outcome, cause);
    };
    if fixed.error <= bound.limit {
        return (outcome, cause);
    }
    match (outcome, cause) {
        (Outcome::Passed, _) | (Outcome::Failed, Some(Cause::Scene | Cause::ProjectorResponse))
            if fixed.shift.is_some() =>
        {
            (Outcome::Failed, Some(Cause::Nudged))
        }
        (Outcome::Passed, _) if fixed.error > bound.doubt => {
            (Outcome::Failed, Some(Cause::Texture))
        }
        (Outcome::Passed, _) => (Outcome::Inconclusive, Some(Cause::Texture)),
        found => found,
    }
}

/// Pixels that pictures which overlap may lie from where they lay against each other: at one pixel, a
/// line as wide as that is seen twice.
pub(super) const MOST_SHIFTED: f64 = 1.0;

/// What follows from pictures that moved against each other where cells have said this. From where the
/// camera stands does not matter to it.
pub(super) fn decide_by_shifts(
    (shifts, exchanged): (&[PictureShift], bool),
    (outcome, cause): (Outcome, Option<Cause>),
) -> (Outcome, Option<Cause>) {
    let moved = shifts.iter().any(|shift| shift.pixels > MOST_SHIFTED);
    let told = match outcome {
        Outcome::Passed | Outcome::Failed => true,
        Outcome::Inconclusive => cause == Some(Cause::Viewpoint),
    };
    // A changed colour is no matter of places.
    match cause {
        _ if told && exchanged => (Outcome::Failed, Some(Cause::Exchanged)),
        None | Some(Cause::Viewpoint | Cause::Scene | Cause::ProjectorResponse)
            if told && moved =>
        {
            (Outcome::Failed, Some(Cause::Nudged))
        }
        _ => (outcome, cause),
    }
}

/// Part of which the levels of white's colours may differ.
const SAME_COLOUR: f64 = 0.03;

/// How far apart the colours of white lie from those that the table expects.
pub(super) fn colour(level: &[f64]) -> f64 {
    let most = level.iter().fold(0.0_f64, |a, b| a.max(*b));
    let least = level.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    most / least.max(1e-12) - 1.0
}

/// What is not as it was when the table was made.
fn changed(bound: &Bound, drift: &Drift) -> Cause {
    match &drift.white {
        None => Cause::Unknown,
        Some(white) if white.shared() > bound.limit => Cause::Scene,
        Some(white) if colour(&white.level) > SAME_COLOUR => Cause::Colour,
        Some(_) => Cause::ProjectorResponse,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::{FixedPattern, PixelBound, WhiteChange};

    #[test]
    fn what_all_images_share_decides_where_cells_pass_and_names_what_they_found() {
        let decide = |error: f64, shift, found| {
            let pixels = PixelVerdict {
                images: Vec::new(),
                error: [0.3, 0.05],
                noise: 0.0,
                errors: Vec::new(),
                white: Vec::new(),
                fixed: Some(FixedPattern { error, shift }),
                bound: Some(PixelBound {
                    promise: 0.02,
                    limit: 0.03,
                    doubt: 0.032,
                }),
            };
            decide_by_pixels(&pixels, found)
        };
        let passed = (Outcome::Passed, None);
        let shift = Some([0.5, 0.0]);
        assert_eq!(decide(0.0299, shift, passed), passed);
        let unsure = (Outcome::Inconclusive, Some(Cause::Texture));
        assert_eq!(decide(0.0301, None, passed), unsure);
        let failed = |cause| (Outcome::Failed, Some(cause));
        assert_eq!(decide(0.0301, shift, passed), failed(Cause::Nudged));
        assert_eq!(decide(0.0321, None, passed), failed(Cause::Texture));
        assert_eq!(decide(0.0321, shift, passed), failed(Cause::Nudged));
        assert_eq!(
            decide(0.1, shift, failed(Cause::Scene)),
            failed(Cause::Nudged)
        );
        for found in [failed(Cause::Scene), failed(Cause::Colour)] {
            assert_eq!(decide(0.1, None, found), found);
        }
        assert_eq!(
            decide(0.02, shift, failed(Cause::Scene)),
            failed(Cause::Scene)
        );
        let noisy = (Outcome::Inconclusive, Some(Cause::Noise));
        assert_eq!(decide(0.1, shift, noisy), noisy);
    }

    #[test]
    fn pictures_that_moved_against_each_other_by_more_than_a_pixel_fail() {
        let shifted = |pixels: f64, found| {
            let shift = |pixels| PictureShift {
                projectors: [0, 1],
                pixels,
                shift: [pixels, 0.0],
            };
            decide_by_shifts((&[shift(0.1), shift(pixels)], false), found)
        };
        let passed = (Outcome::Passed, None);
        let nudged = (Outcome::Failed, Some(Cause::Nudged));
        assert_eq!(shifted(0.99, passed), passed);
        assert_eq!(shifted(1.01, passed), nudged);
        let scene = (Outcome::Failed, Some(Cause::Scene));
        assert_eq!(shifted(0.5, scene), scene);
        assert_eq!(shifted(5.0, scene), nudged);
        let viewpoint = (Outcome::Inconclusive, Some(Cause::Viewpoint));
        assert_eq!(shifted(1.01, viewpoint), nudged);
        assert_eq!(shifted(0.99, viewpoint), viewpoint);
        // Photographs that cannot be compared tell no places either.
        let moved = (Outcome::Inconclusive, Some(Cause::Moved));
        assert_eq!(shifted(5.0, moved), moved);
        assert_eq!(decide_by_shifts((&[], false), passed), passed);
        let exchanged = (Outcome::Failed, Some(Cause::Exchanged));
        for found in [passed, scene, viewpoint] {
            assert_eq!(decide_by_shifts((&[], true), found), exchanged);
        }
    }

    #[test]
    fn what_changed_is_the_scene_then_a_colour_then_the_response() {
        let bound = Bound {
            limit: 0.02,
            given: false,
            predicted: None,
            range: None,
            noise: None,
            viewpoint: 0.0,
            counted: [0.0; 2],
            promise: 0.01,
            added: 0.0,
            expected: None,
            doubt: 0.02,
        };
        let cause = |shape: f64, level: [f64; 3]| {
            let white = WhiteChange {
                level: level.to_vec(),
                shape,
                alone: 0.005,
                cells: Vec::new(),
            };
            let drift = Drift {
                white: Some(white),
                session: 0.0,
            };
            changed(&bound, &drift)
        };
        assert_eq!(cause(0.05, [1.0, 1.0, 0.9]), Cause::Scene);
        assert_eq!(cause(0.02, [1.0, 1.0, 0.9]), Cause::Colour);
        assert_eq!(cause(0.02, [1.0, 1.0, 0.98]), Cause::ProjectorResponse);
        let unknown = Drift {
            white: None,
            session: 0.0,
        };
        assert_eq!(changed(&bound, &unknown), Cause::Unknown);
    }
}
