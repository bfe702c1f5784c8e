//! Gate `response`: camera and projector respond as declared, and the projector's
//! colours and levels add up.

use super::super::Devices;
use super::super::calibration::{CameraFit, Ramp};
use super::{Evidence, Gate, GateName, Verdict};

/// How far photographs may be from adding up with the declared camera response, if
/// they would with another.
const CAMERA: (f64, f64) = (0.01, 0.03);

/// Steps of its 8-bit input that a projector may be from its declared response.
/// sRGB and a gamma of 2.2 are 8 apart, in the darks, where it is not seen.
const PROJECTOR: (f64, f64) = (4.0, 12.0);

/// How far white may be from red, green and blue together.
const WHITE: (f64, f64) = (0.03, 0.1);

/// Light that may be missing where the input rises, of full light.
const FALL: (f64, f64) = (0.003, 0.02);

/// One thing that was looked at.
struct Finding {
    number: f64,
    limits: (f64, f64),
    unit: &'static str,
    next_step: &'static str,
}

impl Finding {
    fn verdict(&self) -> Verdict {
        Verdict::of(self.number, self.limits.0, self.limits.1)
    }

    /// How much of its limit it takes.
    fn share(&self) -> f64 {
        self.number / self.limits.1
    }
}

/// Judges what was measured of camera and projector.
pub(crate) fn judge(devices: &Devices) -> Gate {
    let name = GateName::Response;
    let findings = [
        devices
            .camera_fit
            .as_ref()
            .filter(|fit| fit.tells())
            .map(camera),
        devices.projector_steps().map(projector),
        devices.ramp.as_ref().and_then(white),
        devices.ramp.as_ref().and_then(fall),
    ];
    let worst = findings.into_iter().flatten();
    let Some(worst) = worst.max_by(|a, b| a.share().total_cmp(&b.share())) else {
        let why = "nothing was photographed that tells how camera and projector respond";
        return Gate::not_judged(name, why);
    };
    let verdict = worst.verdict();
    let percent = if worst.unit == "%" { 100.0 } else { 1.0 };
    Gate {
        name,
        verdict,
        number: percent * worst.number,
        limit: percent * worst.limits.1,
        unit: worst.unit,
        what: devices.words().join("; "),
        next_step: if verdict == Verdict::Pass {
            ""
        } else {
            worst.next_step
        },
        evidence: evidence(devices.ramp.as_ref()),
    }
}

fn camera(fit: &CameraFit) -> Finding {
    Finding {
        // What adds up badly with any response is not the response's fault.
        number: if fit.contradicts() {
            fit.declared_misfit
        } else {
            0.0
        },
        limits: CAMERA,
        unit: "%",
        next_step: "Write the response that fits best as [camera] response into capture.toml, or \
             \"measure\".",
    }
}

fn projector(steps: f64) -> Finding {
    Finding {
        number: steps,
        limits: PROJECTOR,
        unit: "steps of 255",
        next_step: "Remove [projector] response from capture.toml, so that the measured one is \
             used, or check the projector's picture mode.",
    }
}

fn white(ramp: &Ramp) -> Option<Finding> {
    Some(Finding {
        number: ramp.white_excess?.abs(),
        limits: WHITE,
        unit: "%",
        next_step: "Choose the projector's sRGB, film or photo mode, switch \"vivid\" and \
             \"brilliant colour\" off, and take the photographs again.",
    })
}

fn fall(ramp: &Ramp) -> Option<Finding> {
    Some(Finding {
        number: ramp.fall?.share,
        limits: FALL,
        unit: "%",
        next_step: "Switch the projector's dynamic iris, dynamic contrast and lamp automatics off, \
             and take the photographs again.",
    })
}

/// Light by level of the ramp's first channel.
fn evidence(ramp: Option<&Ramp>) -> Evidence {
    let Some(ramp) = ramp else {
        return Evidence::None;
    };
    let channel = ramp.points.first().map(|point| point.channel);
    let own = ramp
        .points
        .iter()
        .filter(|point| Some(point.channel) == channel);
    let points = own.map(|point| (f64::from(point.level), point.light.iter().sum()));
    Evidence::Curve {
        x: "the projector's input, of 255",
        y: "light, camera units",
        points: points.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{CalibrationRole, RampChannel, Response, Settings};
    use super::*;
    use crate::capture::calibration::RampPoint;

    fn devices(response: Response, segment: f64, declared: Option<Response>) -> Devices {
        let mut settings = Settings::default();
        if let Some(declared) = declared {
            settings.projector.response = declared.into();
        }
        let mut devices = Devices::declared(&settings);
        let levels = RampChannel::ALL.into_iter().flat_map(|channel| {
            let level = move |k: u8| CalibrationRole::Ramp {
                channel,
                level: 17 * k,
            };
            (0..=15).map(level)
        });
        let points = levels.filter_map(|role| {
            let CalibrationRole::Ramp { channel, level } = role else {
                return None;
            };
            let own = response.light(f64::from(level) / 255.0);
            let extra = if channel == RampChannel::White {
                segment
            } else {
                0.0
            };
            let on = channel.input(1).map(f64::from);
            let light = on.map(|on| 0.5 * on * own * (1.0 + extra));
            Some(RampPoint {
                channel,
                level,
                light: light.to_vec(),
            })
        });
        devices.take_ramp(Ramp::new(points.collect()));
        devices
    }

    #[test]
    fn a_projector_as_declared_or_undeclared_passes() {
        for declared in [Some(Response::Gamma(2.2)), None] {
            let gate = judge(&devices(Response::Gamma(2.2), 0.0, declared));
            assert_eq!(gate.verdict, Verdict::Pass, "{gate}");
        }
        let nothing = judge(&Devices::declared(&Settings::default()));
        assert_eq!(nothing.verdict, Verdict::NotJudged);
    }

    #[test]
    fn a_projector_of_another_gamma_than_declared_fails_by_its_steps() {
        let gate = judge(&devices(
            Response::Gamma(2.2),
            0.0,
            Some(Response::Gamma(1.5)),
        ));
        assert_eq!((gate.verdict, gate.unit), (Verdict::Fail, "steps of 255"));
        // |l^(1/2.2) - l^(1/1.5)| is largest where both slopes agree, at l = 0.164:
        // 255 * (0.4399 - 0.2999) = 35.7.
        assert!((gate.number - 35.7).abs() < 0.5, "{}", gate.number);
        assert!(gate.next_step.contains("Remove"));
    }

    #[test]
    fn a_vivid_mode_fails_by_its_white() {
        let gate = judge(&devices(Response::Gamma(2.2), 0.3, None));
        assert_eq!((gate.verdict, gate.unit), (Verdict::Fail, "%"));
        assert!(
            (gate.number - 30.0).abs() < 1e-6 && gate.what.contains("vivid"),
            "{gate}"
        );
    }
}
