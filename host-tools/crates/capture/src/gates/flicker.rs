//! Gate `flicker`: brightness does not jump from photograph to photograph, nor from
//! row to row within one, and nothing else lights some of them.

use crate::cells::CellEvidence;
use crate::cells::drift::Steadiness;
use crate::cells::mains_banding::MainsBanding;
use crate::format::sequence::Sequence;
use crate::gate::{Evidence, Gate, GateName, Verdict, listed};
use iltm_picture::statistics::median;

/// Scatter of the brightness from which it is worth a word.
const WARN: f64 = 0.006;

/// Scatter of the brightness that spoils a table by as much.
const MOST: f64 = 0.015;

/// Judges the fast changes, by the light as read or by the light that single pixels tell,
/// whichever changes less: brightness that jumps does so under any curve.
pub(super) fn judge(sequence: &Sequence, cells: &CellEvidence) -> Gate {
    let read = (&cells.steadiness, cells.banding.as_ref());
    let number = |(steadiness, bands)| scatter(steadiness).max(striped(bands));
    let (steadiness, bands) = (cells.straightened.as_ref())
        .map(|(steadiness, bands)| (steadiness, bands.as_ref()))
        .filter(|other| number(*other) < number(read))
        .unwrap_or(read);
    let name = GateName::Flicker;
    let compared = !steadiness.models.is_empty();
    if !compared && bands.is_none() {
        return Gate::not_judged(
            name,
            "there are too few photographs to compare with each other",
        );
    }
    let offs = offs(steadiness);
    let (scatter, striped) = (scatter(steadiness), striped(bands));
    let number = scatter.max(striped);
    let disturbed = disturbed(sequence, &cells.steadiness);
    if let Some(gate) = disturbed.filter(|gate| gate.number > 100.0 * number || number < WARN) {
        return gate;
    }
    let verdict = Verdict::of(number, WARN, MOST);
    let what = match (verdict, bands) {
        (Verdict::Pass, _) if !compared => format!(
            "no bands above {:.2} % run across the photographs; too few were taken to compare their \
             brightness",
            100.0 * number
        ),
        (Verdict::Pass, _) => format!(
            "brightness jumps by {:.2} % from photograph to photograph",
            100.0 * number
        ),
        (
            _,
            Some(MainsBanding {
                cycles, amplitude, ..
            }),
        ) if striped > scatter => format!(
            "flicker: bands of {:.1} % run across the photographs, {cycles:.1} from top to bottom: \
             lamps on 50 or 60 Hz mains or the projector's colour wheel, seen by a rolling shutter",
            100.0 * amplitude
        ),
        _ => format!(
            "flicker: brightness jumps by {:.2} % from photograph to photograph: the exposure is no \
             multiple of the period of lamps (50 or 60 Hz) or projector, or is automatic",
            100.0 * scatter
        ),
    };
    let shots = steadiness.shots.iter().zip(&offs);
    let next_step = "Set a longer exposure that is a multiple of the projector's refresh period \
         and of the mains' (1/25 or 1/30 s and longer), switch lamps off, set the exposure by hand.";
    Gate {
        what,
        evidence: match bands {
            Some(bands) if striped > scatter && verdict != Verdict::Pass => Evidence::Curve {
                x: "bands from the top of the photographs to the bottom",
                y: "amplitude, % of the light",
                points: (bands.tried.iter())
                    .map(|(cycles, amplitude)| (*cycles, 100.0 * amplitude))
                    .collect(),
            },
            _ => Evidence::Photographs {
                what: "brightness against the slow curve, %",
                values: shots
                    .map(|(&shot, off)| (sequence.shots[shot].index, 100.0 * off))
                    .collect(),
                limit: Some(100.0 * MOST),
                from: None,
            },
        },
        ..Gate::of_share(name, verdict, (number, MOST), next_step)
    }
}

/// The gate where some photographs are disturbed; `None` where none is.
fn disturbed(sequence: &Sequence, steadiness: &Steadiness) -> Option<Gate> {
    let (misfits, least) = steadiness.misfits();
    let disturbed: Vec<&(usize, f64)> = misfits.iter().filter(|(_, off)| *off > least).collect();
    let most = disturbed.iter().map(|(_, off)| *off).reduce(f64::max)?;
    let squares: f64 = disturbed.iter().map(|(_, off)| off * off).sum();
    let number = (squares / misfits.len() as f64).sqrt();
    let photo = |(shot, _): &&(usize, f64)| sequence.shots[*shot].photo.display().to_string();
    let what = format!(
        "{} from what the others let expect, by up to {:.0} % of the light: another projector or a lamp was \
         on, or somebody stood in the light: {}",
        match disturbed.len() {
            1 => "1 photograph differs".to_owned(),
            several => format!("{several} photographs differ"),
        },
        100.0 * most,
        listed(disturbed.iter().map(photo), 4)
    );
    let index = |shot: &usize| sequence.shots[*shot].index;
    let values = misfits.iter().map(|(shot, off)| (index(shot), 100.0 * off));
    Some(Gate {
        what,
        evidence: Evidence::Photographs {
            what: "difference from what the others let expect, % of the light",
            values: values.collect(),
            limit: Some(100.0 * least),
            from: None,
        },
        ..Gate::of_share(
            GateName::Flicker,
            // Some are, however little that is.
            Verdict::of(number, 0.0, MOST),
            (number, MOST),
            "Keep all other projectors dark and other light out, and take those photographs again.",
        )
    })
}

/// Brightness off the slow curve, of each photograph.
fn offs(steadiness: &Steadiness) -> Vec<f64> {
    let both = steadiness.gains.iter().zip(&steadiness.slow);
    both.map(|(gain, slow)| gain / slow - 1.0).collect()
}

/// Standard deviation of what is off the slow curve, robust, without what the gains
/// themselves are uncertain by; 0 where photographs could not be compared.
fn scatter(steadiness: &Steadiness) -> f64 {
    if steadiness.models.is_empty() {
        return 0.0;
    }
    let middle = |values: Vec<f64>| median(values).unwrap_or(0.0);
    let off = offs(steadiness).iter().map(|off| off.abs()).collect();
    let spread = 1.4826 * middle(off);
    let own = middle(steadiness.errors.clone());
    (spread * spread - own * own).max(0.0).sqrt()
}

/// Root mean square of the bands: a sine's is its amplitude over the root of 2.
fn striped(bands: Option<&MainsBanding>) -> f64 {
    bands.map_or(0.0, |bands| bands.amplitude / 2.0_f64.sqrt())
}
