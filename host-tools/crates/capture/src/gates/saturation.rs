//! Gate `saturation`: white is below the camera's limit, and below that of
//! whatever came between sensor and file.

use crate::cells::cell_pixels::{LeftOut, Why};
use crate::gate::{Gate, GateName, Verdict};
use crate::photographs::clipping::Clipped;

/// Share of the lit pixels or of the cells from which clipping is worth a word.
const WARN: f64 = 0.01;

/// Share of the lit pixels that may be clipped.
const MOST_PIXELS: f64 = 0.1;

/// Share of the cells that may be clipped.
const MOST_CELLS: f64 = 0.05;

/// Judges what was found, and the cells that were lost by it.
pub(crate) fn judge(clipped: &Clipped, left_out: &[LeftOut], live: usize) -> Gate {
    // Where white is clipped nowhere, what cells are lost by are photographs of other patterns.
    let is_saturated =
        |out: &&LeftOut| clipped.count > 0 && matches!(out.why, Why::Saturated { .. });
    let lost = left_out.iter().filter(is_saturated).count();
    let pixels = clipped.count as f64 / clipped.lit.max(1) as f64;
    let cells = lost as f64 / (live + lost).max(1) as f64;
    let verdict = Verdict::of(pixels, WARN, MOST_PIXELS).max(Verdict::of(cells, WARN, MOST_CELLS));
    let ceiling = clipped.ceiling.map_or_else(
        || "the camera's full scale".to_owned(),
        |value| {
            format!(
                "a ceiling at {:.0} % of full scale, above which light is cut off",
                100.0 * value
            )
        },
    );
    let what = if clipped.count == 0 {
        "white is clipped nowhere".to_owned()
    } else {
        format!(
            "white is overexposed: {} of {} lit pixels are clipped at {ceiling}, and {lost} of {} \
             cells are lost by it",
            clipped.count,
            clipped.lit,
            live + lost
        )
    };
    // Whichever is closer to its limit.
    let (number, limit) = if cells / MOST_CELLS > pixels / MOST_PIXELS {
        (cells, MOST_CELLS)
    } else {
        (pixels, MOST_PIXELS)
    };
    let next_step =
        "Take the capture again with a shorter exposure: white at about 80 % of full scale.";
    Gate {
        what,
        ..Gate::of_share(GateName::Saturation, verdict, (number, limit), next_step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(count: usize, lost: usize) -> Gate {
        let clipped = Clipped {
            lit: 1_000,
            count,
            ceiling: None,
        };
        let why = Why::Saturated {
            saturated: 9,
            pixels: 10,
        };
        let left_out: Vec<LeftOut> = (0..lost).map(|cell| LeftOut { cell, why }).collect();
        judge(&clipped, &left_out, 200 - lost)
    }

    #[test]
    fn pixels_or_cells_are_said_whichever_is_closer_to_its_limit() {
        let said = |gate: &Gate| (gate.verdict, gate.number.round(), gate.limit.round());
        assert_eq!(said(&judged(50, 2)), (Verdict::Warn, 5.0, 10.0));
        assert_eq!(said(&judged(50, 8)), (Verdict::Warn, 4.0, 5.0));
        assert_eq!(said(&judged(50, 12)), (Verdict::Fail, 6.0, 5.0));
        assert_eq!(said(&judged(110, 0)), (Verdict::Fail, 11.0, 10.0));
        assert_eq!(said(&judged(5, 0)), (Verdict::Pass, 1.0, 10.0));
        // Photographs of other patterns lose cells where nothing is clipped.
        assert_eq!(said(&judged(0, 40)), (Verdict::Pass, 0.0, 10.0));
        assert!(judged(50, 8).what.contains("8 of 200 cells are lost"));
    }
}
