//! Gates: what a capture must show before it is solved, each with a number, a limit, a
//! sentence and a next step. They judge what the phases found and measure nothing.
//!
//! | gate | question | file |
//! |---|---|---|
//! | `complete` | is every photograph there, once? | `files.rs` |
//! | `format` | have all one size, and values that mean light? | `files.rs` |
//! | `saturation` | is white below the camera's limit? | `saturation.rs` |
//! | `order` | does every photograph show its own pattern? | `order.rs` |
//! | `coverage` | which cells does the camera see? | `coverage.rs` |
//! | `movement` | did camera, projector and scene stand still? | `movement.rs` |
//! | `drift` | did lamp or lens change slowly? | `drift.rs` |
//! | `flicker` | does brightness jump from photograph to photograph, or row to row? | `flicker.rs` |
//! | `superposition` | does light add up? | `superposition.rs` |
//! | `response` | which curve makes it add up best? | `response.rs` |
//! | `noise` | how much of the result will be the camera's noise? | `noise.rs` |
//!
//! Between captures of several projectors, and between poses of the camera, `between.rs` asks `coverage`,
//! `movement` and `drift` once
//! more.
//!
//! A gate that fails refuses the capture; one that warns does not. What a gate was
//! judged from goes along as [`Evidence`], for whoever draws it.

pub(crate) mod between;
mod coverage;
mod drift;
pub(crate) mod files;
mod flicker;
mod movement;
mod noise;
pub(crate) mod order;
mod response;
pub(crate) mod saturation;
mod superposition;

use crate::cells::nonlinearity::{CurveOfPixels, Nonlinearity};
use crate::evidence::CaptureEvidence;
use crate::format::sequence::Sequence;
use crate::gate::{Gate, GateName};

/// Judges all that the phases found.
pub(crate) fn judge(sequence: &Sequence, found: &CaptureEvidence) -> Vec<Gate> {
    let (file, bits) = found.files;
    let pixels = &found.pixels;
    let counts = pixels.counts();
    let live = pixels.live.iter().filter(|live| **live).count();
    let mut gates = vec![
        files::judge_format(file, bits, found.response_stated),
        saturation::judge(&found.clipped, &pixels.left_out, live),
        order::judge(&sequence.shots, found.order.as_ref()).or_out_of_view(live),
        coverage::judge(sequence, &pixels.live, &counts, &pixels.left_out),
    ];
    if let Some(cells) = &found.cells {
        let curve = CurveOfPixels::of(found.devices.camera_fit.as_ref());
        let cause = cells.nonlinearity.map(|cause| cause.given(curve));
        let steadiness = &cells.steadiness;
        let sums = cells.sums.as_ref();
        gates.extend([
            movement::judge(sequence, found.moved.as_ref()),
            drift::judge(sequence, steadiness),
            flicker::judge(sequence, cells),
            superposition::judge(sequence, sums, cause, steadiness.excess),
            noise::judge(sequence.grid, &cells.channels, &pixels.live, &counts),
            response::judge(&found.devices, cause),
        ]);
    }
    gates
}

/// Puts gates in order and takes back what only follows from a gate that fails
/// before: numbers of photographs that show other patterns mean nothing.
pub(crate) fn settle(gates: &mut [Gate], cause: Option<Nonlinearity>) {
    gates.sort_by_key(|gate| gate.name);
    let fails = |name: GateName| gates.iter().any(|gate| gate.name == name && gate.fails());
    let (order, movement) = (fails(GateName::Order), fails(GateName::Movement));
    let superposition = fails(GateName::Superposition);
    let known = cause.is_some_and(Nonlinearity::is_known) && superposition;
    let flicker = fails(GateName::Flicker);
    let number = |name: GateName| {
        let gate = gates.iter().find(|gate| gate.name == name);
        gate.map_or(0.0, |gate| gate.number)
    };
    // Dark photographs are copies of each other where all patterns are shifted.
    let shifted = order && number(GateName::Order) > 2.0 * number(GateName::Complete);
    for gate in gates {
        let because = match gate.name {
            GateName::Complete if shifted && gate.fails() => Some(GateName::Order),
            GateName::Order | GateName::Complete | GateName::Format | GateName::Saturation => None,
            _ if order => Some(GateName::Order),
            GateName::Movement | GateName::Coverage => None,
            _ if movement => Some(GateName::Movement),
            GateName::Flicker | GateName::Drift | GateName::Noise if known => {
                Some(GateName::Superposition)
            }
            GateName::Superposition | GateName::Response | GateName::Noise if !known && flicker => {
                Some(GateName::Flicker)
            }
            GateName::Response if superposition => Some(GateName::Superposition),
            _ => None,
        };
        if let Some(because) = because {
            let why = format!("cannot be judged before `{because}` passes");
            *gate = Gate::not_judged(gate.name, why);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::Verdict;

    fn failing(name: GateName, number: f64) -> Gate {
        let gate = Gate::of_share(name, Verdict::Fail, (0.0, 0.0), "Do it again.");
        Gate { number, ..gate }
    }

    /// Names of the gates that still fail once they are settled.
    fn left(mut gates: Vec<Gate>, cause: Option<Nonlinearity>) -> Vec<GateName> {
        settle(&mut gates, cause);
        let failing = gates.iter().filter(|gate| gate.fails());
        failing.map(|gate| gate.name).collect()
    }

    #[test]
    fn copies_follow_from_shifted_patterns_where_these_are_more_than_twice_as_many() {
        let both = |order| {
            vec![
                failing(GateName::Order, order),
                failing(GateName::Complete, 1.0),
            ]
        };
        assert_eq!(left(both(3.0), None), [GateName::Order]);
        assert_eq!(left(both(2.0), None), [GateName::Complete, GateName::Order]);
    }

    #[test]
    fn what_follows_from_another_gate_waits_for_it() {
        use GateName as G;
        let all = |names: &[GateName]| names.iter().map(|name| failing(*name, 1.0)).collect();
        let known = Some(Nonlinearity::Exposure);
        assert_eq!(
            left(all(&[G::Movement, G::Flicker, G::Noise]), None),
            [G::Movement]
        );
        assert_eq!(
            left(all(&[G::Flicker, G::Superposition]), known),
            [G::Superposition]
        );
        assert_eq!(
            left(all(&[G::Flicker, G::Superposition]), None),
            [G::Flicker]
        );
        assert_eq!(
            left(all(&[G::Response, G::Superposition]), None),
            [G::Superposition]
        );
        assert_eq!(
            left(all(&[G::Order, G::Saturation]), None),
            [G::Saturation, G::Order]
        );
        assert_eq!(left(all(&[G::Coverage, G::Order]), None), [G::Order]);
    }
}
