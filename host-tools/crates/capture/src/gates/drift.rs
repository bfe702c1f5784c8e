//! Gate `drift`: lamp, lens and daylight changed slowly, and by little.

use crate::cells::drift::{Drift, Steadiness};
use crate::format::sequence::Sequence;
use crate::gate::{Evidence, Gate, GateName, Verdict};
use std::fmt::Write;

/// Change over the session from which it is worth a word.
const WARN: f64 = 0.1;

/// Change over the session that a straight correction cannot be trusted with.
const MOST: f64 = 0.3;

/// Judges the slow changes.
pub(super) fn judge(sequence: &Sequence, steadiness: &Steadiness) -> Gate {
    let name = GateName::Drift;
    if steadiness.shots.len() < 2 {
        let why = "white was photographed once, and there are too few other photographs to tell \
             how the light changed";
        return Gate::not_judged(name, why);
    }
    let size = steadiness.size.max(0.0);
    let verdict = Verdict::of(size, WARN, MOST);
    let corrected = steadiness.drift != Drift::default();
    let mut what = if corrected {
        format!(
            "brightness drifted by {:.1} % over the session, which is corrected",
            100.0 * size
        )
    } else {
        format!("brightness is steady within {:.1} %", 100.0 * size)
    };
    if steadiness.dark > 0.02 {
        // Writing into a string cannot fail.
        let _ = write!(
            what,
            "; ambient light changed by {:.0} %",
            100.0 * steadiness.dark
        );
    }
    let darkest = steadiness
        .slow
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    let shots = steadiness.shots.iter().zip(&steadiness.gains);
    let next_step = "Let the projector warm up for 20 minutes, keep daylight out, and take the \
         capture again.";
    Gate {
        what,
        evidence: Evidence::Photographs {
            what: "brightness against the session's mean, %",
            values: shots
                .map(|(&shot, gain)| (sequence.shots[shot].index, 100.0 * (gain - 1.0)))
                .collect(),
            // So much above the darkest is too much.
            limit: Some(100.0 * (darkest - 1.0 + MOST)),
            from: None,
        },
        ..Gate::of_share(GateName::Drift, verdict, (size, MOST), next_step)
    }
}
