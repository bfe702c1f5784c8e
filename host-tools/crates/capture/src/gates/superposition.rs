//! Gate `superposition`: a pattern and its inverse together are as bright as white
//! and black together.

use crate::cells::nonlinearity::Nonlinearity;
use crate::cells::superposition::{CELLS, NOTABLE, Sums};
use crate::format::sequence::Sequence;
use crate::gate::{Evidence, Gate, GateName, Verdict};

/// A table errs by about as much as light does not add up. Photographs of cameras
/// with a curve that nobody declared are off by 14 to 24 %.
const MOST: f64 = 0.03;

/// Judges how well light adds up, and why not.
///
/// Without inverses there is only `excess`: how much brighter other photographs are
/// than white lets expect.
pub(super) fn judge(
    sequence: &Sequence,
    sums: Option<&Sums>,
    cause: Option<Nonlinearity>,
    excess: Option<f64>,
) -> Gate {
    let name = GateName::Superposition;
    let Some(sums) = sums else {
        return without_inverses(excess);
    };
    let number = sums.number();
    let verdict = Verdict::of(number, NOTABLE, MOST);
    let what = match verdict {
        Verdict::Pass => format!(
            "patterns and their inverses add up to white but for {:.2} %",
            100.0 * number
        ),
        _ => format!(
            "light does not add up: patterns and their inverses together are {:+.1} % off white \
             and black together ({:.1} % from cell to cell): {}",
            100.0 * sums.overall,
            100.0 * sums.spread,
            words(cause)
        ),
    };
    let values = sums.cells.iter().map(|excess| 100.0 * excess);
    Gate {
        what,
        evidence: Evidence::cells(
            "pattern and inverse against white and black, %",
            sequence.grid,
            values.collect(),
            100.0 * CELLS * MOST,
        ),
        ..Gate::of_share(name, verdict, (number, MOST), next_step(cause))
    }
}

/// The gate of a capture without inverses.
fn without_inverses(excess: Option<f64>) -> Gate {
    let name = GateName::Superposition;
    let Some(excess) = excess else {
        let why = "no pattern was photographed together with its inverse";
        return Gate::not_judged(name, why);
    };
    let verdict = Verdict::of(excess.abs(), NOTABLE, MOST);
    Gate {
        what: format!(
            "patterns are {:+.1} % brighter than white lets expect (there are no inverses to add up)",
            100.0 * excess
        ),
        ..Gate::of_share(name, verdict, (excess.abs(), MOST), next_step(None))
    }
}

/// The likely cause in words.
fn words(cause: Option<Nonlinearity>) -> String {
    match cause {
        Some(Nonlinearity::Curve { gamma }) => format!(
            "they would add up if the light were raised to the power {gamma:.2}, so that the \
             camera's gamma is not the declared one"
        ),
        Some(Nonlinearity::CurveOrExposure { gamma }) => format!(
            "they would add up if the light were raised to the power {gamma:.2} (the camera's gamma \
             is not the declared one), and as well if automatic exposure or a \"vivid\" mode made \
             pictures {}: these photographs cannot tell which",
            if gamma > 1.0 { "brighter" } else { "darker" }
        ),
        Some(Nonlinearity::Exposure) => {
            "all cells and ambient light by the same factor, so that the \
             camera's automatic exposure follows the picture"
                .to_owned()
        }
        Some(Nonlinearity::Projector) => {
            "all cells by the same factor and ambient light not, so that the \
             projector's dynamic contrast, iris or \"vivid\" mode follows the picture"
                .to_owned()
        }
        Some(Nonlinearity::Either) => {
            "all cells by the same factor, so that the camera's automatic \
             exposure or the projector's \"vivid\" mode or dynamic contrast follows the picture"
                .to_owned()
        }
        Some(Nonlinearity::Unknown) | None => {
            "no one gamma and no one exposure explains it; the light changes in other ways"
                .to_owned()
        }
    }
}

fn next_step(cause: Option<Nonlinearity>) -> &'static str {
    match cause {
        Some(Nonlinearity::Curve { .. }) => {
            "State the camera's response in capture.toml ([camera] response = \"srgb\" for camera \
             JPEGs, a gamma number, or \"measure\") and check again; no new photographs are needed."
        }
        Some(Nonlinearity::Exposure) => {
            "Set exposure, gain (ISO) and white balance by hand, and take the capture again."
        }
        Some(Nonlinearity::Projector) => {
            "Choose the projector's sRGB, film or photo mode, switch off dynamic contrast, iris and \
             eco modes, and take the capture again."
        }
        _ => {
            "Set exposure, gain (ISO) and white balance by hand, switch off the projector's dynamic \
             modes, keep other light out, and take the capture again; if the camera's values are \
             curved, state [camera] response in capture.toml."
        }
    }
}
