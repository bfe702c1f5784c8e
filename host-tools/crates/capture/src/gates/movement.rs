//! Gate `movement`: camera, projector and scene stood still.

use crate::format::sequence::Sequence;
use crate::gate::{Evidence, Gate, GateName, Verdict};
use crate::registration::movement::Moved;

/// Shift from which it is worth a word, in parts of a cell's side.
const WARN: f64 = 0.03;

/// Shift that puts other pixels into a cell, in parts of its side.
const MOST: f64 = 0.06;

/// Shift that is always allowed, in pixels.
const FLOOR: f64 = 0.15;

/// How many times the shifts' own scatter a step must be: far light tilts the borders of
/// wide stripes, on curved scenes by half a pixel, each another way. Twice the limit is a bump whatever the scatter.
const SURE: f64 = 4.0;

/// Judges what was found.
pub(super) fn judge(sequence: &Sequence, moved: Option<&Moved>) -> Gate {
    let name = GateName::Movement;
    let bump = moved.and_then(|moved| Some((moved, moved.bump.as_ref()?)));
    let Some((moved, bump)) = bump else {
        return Gate::not_judged(name, "too few photographs or edges to see movement by");
    };
    let (warn, limit) = (
        (WARN * moved.cell).max(FLOOR),
        (MOST * moved.cell).max(2.0 * FLOOR),
    );
    let sure = (SURE * bump.scatter).min(2.0 * limit);
    let (warn, limit) = (warn.max(sure), limit.max(sure));
    let verdict = Verdict::of(bump.size, warn, limit);
    let photo = |at: usize| sequence.shots[moved.shifts[at].0].photo.display();
    let what = match verdict {
        Verdict::Pass => format!(
            "nothing moved: photographs lie on each other within {:.2} pixels",
            bump.size
        ),
        _ => format!(
            "camera, projector or scene moved by {:.2} pixels (a cell is {:.0} wide) between {} \
             and {}",
            bump.size,
            moved.cell,
            photo(bump.before - 1),
            photo(bump.before)
        ),
    };
    let values = moved.shifts.iter().map(|&(shot, [x, y])| {
        let index = sequence.shots[shot].index;
        (index, x.hypot(y))
    });
    let next_step = "Fix tripod, projector and scene, use a remote release, and take the capture \
         again; photographs from before and after a bump do not belong together.";
    Gate {
        number: bump.size,
        limit,
        unit: "pixels",
        what,
        evidence: Evidence::Photographs {
            what: "shift against the session's mean, pixels",
            values: values.collect(),
            limit: None,
        },
        ..Gate::of_share(name, verdict, (0.0, 0.0), next_step)
    }
}
