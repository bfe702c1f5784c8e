//! Gate `movement`: camera, projector and scene stood still.

use crate::format::sequence::Sequence;
use crate::gate::{Evidence, Gate, GateName, Verdict};
use crate::registration::movement::Moved;
use iltm_picture::statistics::median;

/// Shift from which it is worth a word, in parts of a cell's side.
const WARN: f64 = 0.03;

/// Shift that puts other pixels into a cell, in parts of its side.
const MOST: f64 = 0.06;

/// Shift that is always allowed, in pixels.
const FLOOR: f64 = 0.15;

/// How many times the shifts' own scatter a step must be: far light tilts the borders of
/// wide stripes, on curved scenes by half a pixel, each another way. Twice the limit is a bump whatever the scatter.
const SURE: f64 = 4.0;

/// Photographs on one side of a step that are few.
const FEW: usize = 10;

const NEXT_STEP: &str = "Fix tripod, projector and scene, use a remote release, and take the \
                         capture again; photographs from before and after a bump do not belong \
                         together.";

/// Shifts from which a remark and a refusal are made, in pixels, by a cell's side.
pub(super) fn limits(cell: f64) -> (f64, f64) {
    ((WARN * cell).max(FLOOR), (MOST * cell).max(2.0 * FLOOR))
}

/// Judges how far white moved: a bump with few patterns on one side of it is no step in their shifts.
/// A curve that nobody declared moves outlines of a sum a little: beside stripes, twice the limits
/// count.
fn white(sequence: &Sequence, moved: &Moved) -> Option<Gate> {
    let white = moved.white.as_ref()?;
    let size = white.off.iter().map(|off| off.1).fold(0.0, f64::max);
    let sure = if white.step.is_some() { 1.0 } else { 2.0 };
    let (warn, limit) = limits(moved.cell);
    let (warn, limit) = (sure * warn, sure * limit);
    let photo = |at: usize| sequence.shots[white.off[at].0].photo.display();
    let between = match white.step {
        Some(step) => format!("{} and {}, both of white", photo(step - 1), photo(step)),
        None => format!("white, {}, and the patterns", photo(0)),
    };
    let what = format!(
        "camera, projector or scene moved by at least {size:.2} pixels (a cell is {:.0} wide) between \
         {between}",
        moved.cell,
    );
    let index = |at: usize| sequence.shots[white.off[at].0].index;
    let values = white.off.iter().enumerate();
    Some(Gate {
        number: size,
        limit,
        unit: "pixels",
        what,
        evidence: Evidence::Photographs {
            what: match white.step {
                Some(_) => "shift of white against its first photograph, pixels",
                None => "shift of white against the patterns, pixels",
            },
            values: values.map(|(at, off)| (index(at), off.1)).collect(),
            limit: Some(limit),
            from: white.step.map(index),
        },
        ..Gate::of_share(
            GateName::Movement,
            Verdict::of(size, warn, limit),
            (0.0, 0.0),
            NEXT_STEP,
        )
    })
}

/// Judges what was found.
pub(super) fn judge(sequence: &Sequence, moved: Option<&Moved>) -> Gate {
    let name = GateName::Movement;
    let bump = moved.and_then(|moved| Some((moved, moved.bump.as_ref()?)));
    let Some((moved, bump)) = bump else {
        return Gate::not_judged(name, "too few photographs or edges to see movement by");
    };
    let (warn, limit) = limits(moved.cell);
    let sure = (SURE * bump.scatter).min(2.0 * limit);
    // Wide stripes and random patterns do not lie alike: a few at one end are no bump yet.
    let side = bump.before.min(moved.shifts.len() - bump.before);
    let sure = if side < FEW { 3.0 * limit } else { sure };
    let (warn, limit) = (warn.max(sure), limit.max(sure));
    let verdict = Verdict::of(bump.size, warn, limit);
    if let Some(white) = white(sequence, moved).filter(|white| white.verdict > verdict) {
        return white;
    }
    let photo = |at: usize| sequence.shots[moved.shifts[at].0].photo.display();
    let what = match verdict {
        Verdict::Pass => format!(
            "nothing moved: the picture's position makes no step above {:.2} pixels",
            bump.size
        ),
        _ => format!(
            "camera, projector or scene moved by at least {:.2} pixels (a cell is {:.0} wide) between {} \
             and {}",
            bump.size,
            moved.cell,
            photo(bump.before - 1),
            photo(bump.before)
        ),
    };
    // Against those before the step, so that what comes after it lies beyond the limit.
    let before = |axis: usize| {
        let of = moved.shifts[..bump.before].iter();
        median(of.map(|(_, shift)| shift[axis]).collect()).unwrap_or(0.0)
    };
    let still = [before(0), before(1)];
    let index = |at: usize| sequence.shots[moved.shifts[at].0].index;
    let values = (moved.shifts.iter().enumerate())
        .map(|(at, (_, [x, y]))| (index(at), (x - still[0]).hypot(y - still[1])));
    Gate {
        number: bump.size,
        limit,
        unit: "pixels",
        what,
        evidence: Evidence::Photographs {
            what: "shift against the first photographs, pixels",
            values: values.collect(),
            limit: Some(limit),
            from: (verdict != Verdict::Pass).then(|| index(bump.before)),
        },
        ..Gate::of_share(name, verdict, (0.0, 0.0), NEXT_STEP)
    }
}
