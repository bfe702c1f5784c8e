//! Gate `response`: the declared responses are those of the devices, and the
//! projector shows a colour as the sum of its primaries.

use crate::cells::nonlinearity::Nonlinearity;
use crate::devices::{CameraFit, Devices};
use crate::format::calibration_role::RampChannel;
use crate::gate::{Evidence, Gate, GateName, Verdict};

/// Misfit of the declared camera response beyond that of the best one.
const WARN: f64 = 0.004;
const MOST: f64 = 0.006;

/// Steps of 255 that the projector's measured response may be off the declared one, or another
/// projector's.
pub(super) const WARN_STEPS: f64 = 2.5;
pub(super) const MOST_STEPS: f64 = 8.0;

/// Judges what was measured of the devices; `cause` is why light does not add up.
pub(super) fn judge(devices: &Devices, cause: Option<Nonlinearity>) -> Gate {
    let name = GateName::Response;
    // A camera that exposes for the picture looks like one with another curve.
    let curved = matches!(
        cause,
        None | Some(
            Nonlinearity::Curve { .. }
                | Nonlinearity::CurveOrExposure { .. }
                | Nonlinearity::Unknown
        )
    );
    let camera = devices
        .camera_fit
        .as_ref()
        .filter(|fit| curved && fit.contradicts());
    let steps = devices.projector_steps();
    // A camera whose curve is not the declared one, or that exposes for the picture, sees
    // colours that do not add up whatever the projector does.
    let blamed = camera.is_some()
        || matches!(
            cause,
            Some(Nonlinearity::Curve { .. } | Nonlinearity::Exposure)
        );
    let complaints = match &devices.ramp {
        Some(ramp) if !blamed => ramp.complaints(),
        _ => Vec::new(),
    };
    let gate = |verdict, number, limit, unit, what, next_step| Gate {
        name,
        verdict,
        number,
        limit,
        unit,
        what,
        next_step,
        evidence: evidence(devices),
    };
    let beyond = |fit: &CameraFit| (fit.declared_misfit - fit.best_misfit).max(0.0);
    let camera_verdict = camera.map(|fit| Verdict::of(beyond(fit), WARN, MOST));
    let steps_verdict = steps.map(|steps| Verdict::of(steps, WARN_STEPS, MOST_STEPS));
    if let Some(complaint) = complaints.first() {
        let darker = (devices.ramp.as_ref())
            .is_some_and(|ramp| ramp.fall.is_none() && ramp.white_excess < Some(0.0));
        let tells = devices.camera_fit.as_ref().is_some_and(CameraFit::tells);
        let next_step = if darker {
            "Check first that [camera] response in capture.toml is the camera's: a curve that is \
             not declared makes white darker than its parts. If it is, choose the projector's sRGB, \
             film or photo mode, switch off dynamic contrast, iris, brilliant colour and eco modes, \
             and take the capture again."
        } else if tells {
            "Choose the projector's sRGB, film or photo mode, switch off dynamic contrast, iris, \
             brilliant colour and eco modes, and take the capture again."
        } else {
            "Check first that [camera] response in capture.toml is the camera's: these photographs \
             do not tell it. If it is, choose the projector's sRGB, film or photo mode, switch off \
             dynamic contrast, iris, brilliant colour and eco modes, and take the capture again."
        };
        let number = complaints.len() as f64;
        let what = complaint.clone();
        return gate(Verdict::Fail, number, 0.0, "complaints", what, next_step);
    }
    if let (Some(fit), Some(verdict @ (Verdict::Warn | Verdict::Fail))) = (camera, camera_verdict) {
        let what = format!(
            "the camera's gamma is not the declared one: {}",
            fit.words()
        );
        let next_step = "Write the measured response into capture.toml ([camera] response), or \
             \"measure\", and check again; photographs need not be taken again.";
        let number = 100.0 * beyond(fit);
        return gate(verdict, number, 100.0 * MOST, "%", what, next_step);
    }
    if let (Some(steps), Some(verdict)) = (steps, steps_verdict) {
        let what = format!(
            "the projector's measured response is {steps:.1} steps of 255 off the declared one \
             (its gamma)"
        );
        let next_step = match verdict {
            Verdict::Pass => "",
            _ => {
                "Write [projector] response = \"measure\" into capture.toml, or set the projector's \
                 gamma to the declared one."
            }
        };
        return gate(verdict, steps, MOST_STEPS, "steps", what, next_step);
    }
    match &devices.camera_fit {
        Some(fit) if !fit.would_notice() => Gate::not_judged(name, fit.words()),
        Some(fit) => {
            let number = 100.0 * beyond(fit);
            gate(Verdict::Pass, number, 100.0 * MOST, "%", fit.words(), "")
        }
        None => Gate::not_judged(name, "there are no photographs to measure the responses by"),
    }
}

/// The ramp of white.
fn evidence(devices: &Devices) -> Evidence {
    let Some(ramp) = &devices.ramp else {
        return Evidence::None;
    };
    let white = (ramp.points.iter()).filter(|point| point.channel == RampChannel::White);
    let points: Vec<(f64, f64)> = white
        .map(|point| (f64::from(point.level), point.light.iter().sum()))
        .collect();
    Evidence::Curve {
        x: "projector input, of 255",
        y: "light of white",
        points,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::Ramp;
    use crate::{Fall, Settings};

    #[test]
    fn a_camera_is_suspected_only_where_white_is_darker_and_nothing_falls() {
        let ramp = |fall: bool, white_excess: f64| Ramp {
            points: Vec::new(),
            response: None,
            fall: fall.then_some(Fall {
                channel: RampChannel::White,
                level: 200,
                share: 0.2,
            }),
            white_excess: Some(white_excess),
            mixing: None,
        };
        let suspected = |ramp: Ramp| {
            let devices = Devices {
                ramp: Some(ramp),
                ..Devices::declared(&Settings::default())
            };
            let gate = judge(&devices, None);
            assert_eq!(gate.verdict, Verdict::Fail, "{}", gate.what);
            gate.next_step.contains("makes white darker")
        };
        assert!(suspected(ramp(false, -0.2)));
        assert!(!suspected(ramp(false, 0.2)));
        assert!(!suspected(ramp(true, -0.2)));
        assert!(!suspected(ramp(true, 0.2)));
    }
}
