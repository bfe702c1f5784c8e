//! Gates between captures: of several projectors, whether one camera stood still in one light, and
//! each projector is there once, with one response; from several poses of the camera, whether exposure
//! and projectors stayed.

use super::movement;
use super::response::{MOST_STEPS, WARN_STEPS};
use crate::gate::{Gate, GateName, Verdict};
use crate::registration::black_shift::BlackShift;
use crate::registration::correspondence::PictureShift;
use iltm_picture::ProjectorResponse;
use iltm_picture::statistics::quantile;

/// Part of the light under black that one has less, from which it is worth a word.
const DARKER: f64 = 0.1;

/// Share of its white that another projector may show under black, with a word and at most: a table takes
/// it for light that is always there.
const SHOWN: f64 = 0.002;
const MOST_SHOWN: f64 = 0.01;

/// Share of a picture that others light too, from which it is worth a word.
const MOST_SHARED: f64 = 0.5;

/// Cells that two poses must both see to compare their light.
const LEAST_COMPARED: usize = 8;

/// How much of the light two poses may differ by, with a word and at most: the table would show it as a
/// step.
const POSES_DIFFER: f64 = 0.02;
const POSES_DIFFER_MOST: f64 = 0.05;

/// Pixels of the projector that pictures may lie from where they lay, with a word and at most: as a
/// verification.
const PICTURES_APART: f64 = 0.5;
const PICTURES_APART_MOST: f64 = 1.0;

const STAND_STILL: &str = "Fix the camera, let nobody touch it between the captures, and take the \
                           one that came after the bump again.";

const LEAVE_LIGHT: &str = "Make sure that nobody touched the camera. A little light in the room that \
                           stays shows it next time.";

/// The first capture and another one, by name.
pub(crate) struct Pair<'p> {
    pub(crate) first: &'p str,
    pub(crate) other: &'p str,
}

/// Judges whether the camera stood still, by photographs of black; `binning` is pixels of the file
/// along a pixel, and `cell` a cell's side in pixels of the file.
pub(crate) fn movement(
    pair: &Pair<'_>,
    (binning, cell): (usize, f64),
    black: Option<BlackShift>,
) -> Gate {
    let Pair { first, other } = pair;
    let name = GateName::Movement;
    let (warn, limit) = movement::limits(cell);
    let untold = || Gate {
        limit,
        unit: "pixels",
        what: format!(
            "whether the camera stood still between {first} and {other} is not known: their \
             photographs of black are too dark, too even, or lit differently"
        ),
        ..Gate::of_share(name, Verdict::Warn, (0.0, 0.0), LEAVE_LIGHT)
    };
    let Some(BlackShift { shift, unsure }) = black else {
        return untold();
    };
    let [size, unsure] = [shift[0].hypot(shift[1]), unsure].map(|pixels| binning as f64 * pixels);
    let sure = (size - unsure).max(0.0);
    let verdict = Verdict::of(sure, warn, limit);
    if verdict == Verdict::Pass && unsure > limit {
        return untold();
    }
    let what = match verdict {
        Verdict::Pass => format!("the camera stood still between {first} and {other}"),
        _ => format!("the camera moved by at least {sure:.2} pixels between {first} and {other}"),
    };
    Gate {
        number: sure,
        limit,
        unit: "pixels",
        what,
        ..Gate::of_share(name, verdict, (0.0, 0.0), STAND_STILL)
    }
}

/// Judges whether the light under black is the same. It tells changes of exposure, but the room's
/// light may change without harm, so that it refuses nothing.
pub(crate) fn black(pair: &Pair<'_>, brighter: Option<f64>) -> Gate {
    let Pair { first, other } = pair;
    let name = GateName::Drift;
    let Some(brighter) = brighter else {
        let why = format!("{first} or {other} has no light under black to compare");
        return Gate::not_judged(name, why);
    };
    let darker = 1.0 - brighter.min(brighter.recip());
    let verdict = Verdict::of(darker, DARKER, 1.0);
    let what = match verdict {
        Verdict::Pass => format!("{first} and {other} have the same light under black"),
        _ => format!(
            "{other} has {brighter:.2} times the light of {first} under black: the exposure, the \
             room's light, or what another projector showed has changed"
        ),
    };
    Gate {
        what,
        ..Gate::of_share(
            name,
            verdict,
            (darker, 1.0),
            "Make sure that exposure, aperture and ISO are the same in both, and that all other \
             projectors show black.",
        )
    }
}

/// Says that the second capture's projector showed so much of its white while the first one's was
/// photographed; `None` if it is too little to matter.
pub(crate) fn not_dark(pair: &Pair<'_>, share: f64) -> Option<Gate> {
    let Pair { first, other } = pair;
    let verdict = Verdict::of(share, SHOWN, MOST_SHOWN);
    let next_step = "Show black on all other projectors, and take that capture again.";
    (verdict != Verdict::Pass).then(|| Gate {
        what: format!(
            "the projector of {other} was not dark while {first} was photographed: under black it lights the \
             scene by {:.1} % of its white",
            100.0 * share
        ),
        ..Gate::of_share(GateName::Drift, verdict, (share, MOST_SHOWN), next_step)
    })
}

/// Judges whether two projectors show the same light for a code: a table has one response for all.
/// Responses are those that are known.
pub(crate) fn response(pair: &Pair<'_>, of: [Option<&ProjectorResponse>; 2]) -> Gate {
    let Pair { first, other } = pair;
    let [Some(one), Some(two)] = of else {
        let why = format!("{first} or {other} does not tell the projector's response");
        return Gate::not_judged(GateName::Response, why);
    };
    let channels = one.channels().len().max(two.channels().len());
    let steps = (0..channels).map(|channel| one.channel(channel).steps_from(two.channel(channel)));
    let steps = steps.fold(0.0, f64::max);
    let verdict = Verdict::of(steps, WARN_STEPS, MOST_STEPS);
    let what = match verdict {
        Verdict::Pass => format!("{first} and {other} have one response of the projector"),
        _ => format!(
            "the projector of {other} has another response than that of {first}: {steps:.1} steps of \
             255 (its gamma)"
        ),
    };
    Gate {
        number: steps,
        limit: MOST_STEPS,
        unit: "steps",
        what,
        ..Gate::of_share(
            GateName::Response,
            verdict,
            (0.0, 0.0),
            "Set all projectors to one picture mode and gamma, and take that capture again.",
        )
    }
}

/// Judges whether two captures are of two projectors. `same` is the part of the pixels that both
/// know which see the same place in both pictures.
pub(crate) fn same_projector(pair: &Pair<'_>, same: f64) -> Option<Gate> {
    let Pair { first, other } = pair;
    let next_step = "Check the cables and that the computer does not mirror its displays, and take \
                     the capture again with the other projector alone. Projectors that show one \
                     picture on purpose need one capture, with all of them on.";
    (same > MOST_SHARED).then(|| Gate {
        what: format!(
            "{first} and {other} show one picture: the same projector, or mirrored displays"
        ),
        ..Gate::of_share(
            GateName::Coverage,
            Verdict::Fail,
            (same, MOST_SHARED),
            next_step,
        )
    })
}

/// Judges how much of a picture other projectors light too.
pub(crate) fn shared(name: &str, shared: f64) -> Option<Gate> {
    let next_step = "Turn the projectors further apart if they can be: what two light is only as \
                     bright as one.";
    (shared > MOST_SHARED).then(|| Gate {
        what: format!(
            "{:.0} % of the picture of {name} is lit by others too",
            100.0 * shared
        ),
        ..Gate::of_share(GateName::Coverage, Verdict::Warn, (shared, 1.0), next_step)
    })
}

/// Judges whether two poses of the camera have the same exposure, by the light of cells that both see, of
/// each relative to the first pose's.
pub(crate) fn light_of_poses(pair: &Pair<'_>, mut light: Vec<f64>) -> Gate {
    let Pair { first, other } = pair;
    let name = GateName::Drift;
    let compared = light.len();
    if compared < LEAST_COMPARED {
        let why = format!(
            "{first} and {other} see {compared} cells in common, too few to compare their light"
        );
        return Gate::not_judged(name, why);
    }
    let [low, usual, high] =
        [0.1, 0.5, 0.9].map(|share| quantile(&mut light, share).unwrap_or(1.0));
    let differs = (usual - 1.0).abs();
    let verdict = Verdict::of(differs, POSES_DIFFER, POSES_DIFFER_MOST);
    let what = format!(
        "from {other}, the {compared} cells that both see are {:.1} % as bright as from {first}, 8 of 10 \
         from {:.1} to {:.1} %",
        100.0 * usual,
        100.0 * low,
        100.0 * high
    );
    Gate {
        what,
        ..Gate::of_share(
            name,
            verdict,
            (differs, POSES_DIFFER_MOST),
            "Photograph from all places with one exposure, aperture, ISO and white balance, shortly after \
             one another; a wall that shines looks otherwise from elsewhere.",
        )
    }
}

/// Judges whether projectors stayed from pose to pose, by where their pictures lie against each other.
pub(crate) fn pictures_of_poses(pair: &Pair<'_>, shifts: &[PictureShift]) -> Gate {
    let Pair { first, other } = pair;
    let name = GateName::Movement;
    let farthest = shifts.iter().max_by(|a, b| a.pixels.total_cmp(&b.pixels));
    let Some(farthest) = farthest else {
        let why = format!(
            "whether projectors moved between {first} and {other} is not known: no place that two \
             projectors light is seen from both"
        );
        return Gate::not_judged(name, why);
    };
    let verdict = Verdict::of(farthest.pixels, PICTURES_APART, PICTURES_APART_MOST);
    let [one, two] = farthest.projectors.map(|projector| projector + 1);
    let what = if farthest.pixels.is_finite() {
        format!(
            "the pictures of projectors {one} and {two} lie {:.1} pixels from where they lay in {first} \
             when {other} was taken",
            farthest.pixels
        )
    } else {
        format!(
            "the pictures of projectors {one} and {two} lay elsewhere against each other when {other} was \
             taken than in {first}"
        )
    };
    Gate {
        number: farthest.pixels.min(f64::from(u16::MAX)),
        limit: PICTURES_APART_MOST,
        unit: "pixels",
        what,
        ..Gate::of_share(
            name,
            verdict,
            (0.0, 0.0),
            "Photograph all poses again without touching a projector in between.",
        )
    }
}

/// Says that a pose sees no cell of a projector.
pub(crate) fn out_of_view(capture: &str) -> Gate {
    Gate {
        what: format!(
            "{capture}: the camera sees no cell of this projector, only its light on other walls; whether \
             these photographs show their patterns is not known"
        ),
        ..Gate::of_share(
            GateName::Coverage,
            Verdict::Warn,
            (1.0, 1.0),
            "Where the picture should be in view, check that capture by itself: `iltm check`.",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Response;

    const PAIR: Pair<'_> = Pair {
        first: "left",
        other: "right",
    };

    fn verdict(shift: [f64; 2], unsure: f64, brighter: f64) -> (Verdict, Verdict) {
        let found = Some(BlackShift { shift, unsure });
        // Cells of 10 pixels of the file: limits are .3 and .6 of them.
        let stood = movement(&PAIR, (2, 10.0), found);
        (stood.verdict, black(&PAIR, Some(brighter)).verdict)
    }

    #[test]
    fn a_camera_that_surely_moved_refuses_and_one_that_may_have_is_said() {
        use Verdict::{Fail, Pass, Warn};
        assert_eq!(verdict([0.1, 0.0], 0.02, 1.0), (Pass, Pass));
        // Of two pixels of the file each: .4 at least, then .64.
        assert_eq!(verdict([0.15, 0.2], 0.05, 1.0), (Warn, Pass));
        assert_eq!(verdict([0.0, -0.35], 0.03, 1.0), (Fail, Pass));
        // Surely not more than nothing, but perhaps much.
        assert_eq!(verdict([0.0, 0.2], 0.4, 1.0), (Warn, Pass));
        for brighter in [1.15, 0.85, 50.0, 0.01] {
            assert_eq!(verdict([0.0; 2], 0.02, brighter), (Pass, Warn));
        }
        assert_eq!(verdict([0.0; 2], 0.02, 1.08), (Pass, Pass));
        let unknown = movement(&PAIR, (1, 10.0), None);
        assert!(unknown.what.contains("left and right is not known"));
        assert_eq!(unknown.verdict, Warn);
        assert_eq!(black(&PAIR, None).verdict, Verdict::NotJudged);
    }

    #[test]
    fn a_projector_that_shows_a_little_is_said_and_more_refuses() {
        let verdict = |share| not_dark(&PAIR, share).map(|gate| gate.verdict);
        assert_eq!((verdict(-0.3), verdict(0.002)), (None, None));
        assert_eq!(verdict(0.003), Some(Verdict::Warn));
        assert_eq!(verdict(0.011), Some(Verdict::Fail));
        let what = not_dark(&PAIR, 0.5).unwrap().what;
        assert!(
            what.starts_with("the projector of right was not dark while left"),
            "{what}"
        );
    }

    #[test]
    fn a_projector_with_another_gamma_is_named() {
        let verdict = |gamma| {
            let responses = [2.2, gamma].map(|gamma| Response::Gamma(gamma).into());
            let gate = response(&PAIR, [Some(&responses[0]), Some(&responses[1])]);
            assert_eq!(
                gate.what.contains("another response"),
                gate.verdict != Verdict::Pass
            );
            gate.verdict
        };
        assert_eq!(verdict(2.2), Verdict::Pass);
        assert_eq!(verdict(2.22), Verdict::Pass);
        assert_eq!(verdict(2.3), Verdict::Warn);
        assert_eq!(verdict(2.6), Verdict::Fail);
        assert_eq!(verdict(1.9), Verdict::Fail);
        let known = Response::Srgb.into();
        for of in [[None, None], [Some(&known), None], [None, Some(&known)]] {
            assert_eq!(response(&PAIR, of).verdict, Verdict::NotJudged);
        }
    }

    #[test]
    fn one_picture_in_two_captures_is_refused_and_a_large_overlap_is_said() {
        let same = |part| same_projector(&PAIR, part).map(|gate| gate.verdict);
        assert_eq!((same(0.5), same(0.6)), (None, Some(Verdict::Fail)));
        let shared = |part| shared("left", part).map(|gate| gate.verdict);
        assert_eq!((shared(0.5), shared(0.6)), (None, Some(Verdict::Warn)));
    }

    fn shift(pixels: f64) -> PictureShift {
        PictureShift {
            projectors: [0, 1],
            pixels,
            shift: [pixels, 0.0],
        }
    }

    #[test]
    fn poses_of_another_exposure_or_with_a_projector_that_moved_are_told() {
        use Verdict::{Fail, NotJudged, Pass, Warn};
        let light = |usual: f64, cells: usize| {
            let spread = (0..cells).map(|cell| usual + 0.02 * (cell % 3) as f64 - 0.02);
            light_of_poses(&PAIR, spread.collect())
        };
        let verdicts = [
            (1.0, 9),
            (0.985, 9),
            (0.975, 9),
            (0.94, 9),
            (1.06, 9),
            (0.5, 7),
        ];
        let verdicts = verdicts.map(|(usual, cells)| light(usual, cells).verdict);
        assert_eq!(verdicts, [Pass, Pass, Warn, Fail, Fail, NotJudged]);
        let what = light(0.94, 9).what;
        assert!(what.contains("right") && what.contains("94.0 %"), "{what}");
        let pictures = |pixels: &[f64]| {
            let shifts: Vec<PictureShift> = pixels.iter().map(|pixels| shift(*pixels)).collect();
            pictures_of_poses(&PAIR, &shifts).verdict
        };
        assert_eq!(pictures(&[]), NotJudged);
        assert_eq!(pictures(&[0.1, 0.4]), Pass);
        assert_eq!(pictures(&[0.1, 0.7]), Warn);
        assert_eq!(pictures(&[1.2, 0.1]), Fail);
        assert_eq!(pictures(&[f64::INFINITY]), Fail);
    }
}
