//! Projector response: its light at several levels of each channel.

use super::ColourMixingMatrix;
use crate::format::calibration_role::RampChannel;
use iltm_picture::{Curve, DeviceResponse, ProjectorResponse};

/// Levels that a curve needs at least, full level among them.
const LEAST_LEVELS: usize = 4;

/// A fall of light from one level to the next above it, relative to full level,
/// that noise and drift do not make.
const FALL: f64 = 0.003;

/// How far white may be from red, green and blue together.
const ADDS_UP: f64 = 0.03;

/// Light that means nothing in a photograph of one primary, relative to what its
/// own channel sees: lamps flicker, projectors drift.
const STRAY: f64 = 0.001;

/// Light of the scene at one level.
#[derive(Clone, PartialEq, Debug)]
pub struct RampPoint {
    /// Channels of the projector that were lit.
    pub channel: RampChannel,
    /// Their 8-bit input.
    pub level: u8,
    /// Mean light of the lit pixels in each camera channel, black subtracted and
    /// drift removed, camera units.
    pub light: Vec<f64>,
}

/// Less light at a higher level.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fall {
    /// Channel of the projector.
    pub channel: RampChannel,
    /// The higher level.
    pub level: u8,
    /// Light that is missing against the level below, relative to full level.
    pub share: f64,
}

/// A projector's ramp.
#[derive(Clone, PartialEq, Debug)]
pub struct Ramp {
    /// What was measured, by channel and level.
    pub points: Vec<RampPoint>,
    /// The projector's response: one for all channels if the camera is grey or
    /// only white was shown to it, else one each. `None` if no channel has enough
    /// levels.
    pub response: Option<ProjectorResponse>,
    /// The largest fall, if any is more than noise.
    pub fall: Option<Fall>,
    /// How much brighter full white is than full red, green and blue together,
    /// relative to these.
    pub white_excess: Option<f64>,
    /// Light of each projector channel in each camera channel, for a colour camera.
    pub mixing: Option<ColourMixingMatrix>,
}

const PRIMARIES: [RampChannel; 3] = [RampChannel::Red, RampChannel::Green, RampChannel::Blue];

impl Ramp {
    /// The ramp that these points make; `None` without any.
    #[must_use]
    pub fn new(mut points: Vec<RampPoint>) -> Option<Self> {
        points.sort_by_key(|point| (point.channel, point.level));
        let channels = points.first()?.light.len();
        let points: Vec<RampPoint> = points
            .chunk_by(|a, b| (a.channel, a.level) == (b.channel, b.level))
            .map(mean)
            .collect();
        let full = |channel| {
            let of = points
                .iter()
                .find(|p| p.channel == channel && p.level == u8::MAX);
            of.map(|point| point.light.as_slice())
        };
        let white = full(RampChannel::White);
        let primaries = PRIMARIES.map(full);
        let white_excess = match (white, primaries) {
            (Some(white), [Some(red), Some(green), Some(blue)]) => {
                let sum = |light: &[f64]| light.iter().sum::<f64>();
                let together = sum(red) + sum(green) + sum(blue);
                (together > 0.0).then(|| sum(white) / together - 1.0)
            }
            _ => None,
        };
        let mixing = mixing(primaries, white);
        let response = response(&points, channels, mixing.as_ref());
        let fall = fall(&points);
        Some(Self {
            points,
            response,
            fall,
            white_excess,
            mixing,
        })
    }

    /// What the ramp says is wrong with the projector's mode, a sentence each.
    #[must_use]
    pub fn complaints(&self) -> Vec<String> {
        let mut complaints = Vec::new();
        if let Some(fall) = self.fall {
            complaints.push(format!(
                "the projector gets darker by {:.1} % where its input rises to {} (of 255): a \
                 dynamic iris, dynamic contrast or an automatic lamp mode changes its light from \
                 picture to picture; switch it off",
                100.0 * fall.share,
                fall.level
            ));
        }
        match self.white_excess {
            Some(excess) if excess > ADDS_UP => complaints.push(format!(
                "white is {:.0} % brighter than red, green and blue together: a white segment or a \
                 \"vivid\" or \"brilliant colour\" mode; choose the projector's sRGB, film or photo \
                 mode",
                100.0 * excess
            )),
            Some(excess) if excess < -ADDS_UP => complaints.push(format!(
                "white is {:.0} % darker than red, green and blue together: the projector limits \
                 its power or manages its colours; choose its sRGB, film or photo mode, and check \
                 that white is not saturated in the camera",
                -100.0 * excess
            )),
            _ => {}
        }
        complaints
    }
}

/// The mean of points of one channel and level.
fn mean(points: &[RampPoint]) -> RampPoint {
    let share = 1.0 / points.len() as f64;
    let mut light = vec![0.0; points[0].light.len()];
    for point in points {
        for (sum, light) in light.iter_mut().zip(&point.light) {
            *sum += share * light;
        }
    }
    RampPoint {
        light,
        ..points[0].clone()
    }
}

fn mixing(primaries: [Option<&[f64]>; 3], white: Option<&[f64]>) -> Option<ColourMixingMatrix> {
    let of_camera = |light: &[f64]| <[f64; 3]>::try_from(light).ok();
    let [Some(red), Some(green), Some(blue)] = primaries.map(|light| of_camera(light?)) else {
        return None;
    };
    let light = [0, 1, 2].map(|camera| [red[camera], green[camera], blue[camera]]);
    let brightest = red[0].max(green[1]).max(blue[2]);
    ColourMixingMatrix::new(light, STRAY * brightest, white.and_then(of_camera))
}

/// Levels and light of one channel as one camera, weighted towards the camera
/// channels that see it best, sees it.
fn series(points: &[RampPoint], channel: RampChannel, of: Option<usize>) -> Vec<(f64, f64)> {
    let own: Vec<&RampPoint> = points.iter().filter(|p| p.channel == channel).collect();
    let Some(top) = own.last() else {
        return Vec::new();
    };
    let light = |point: &RampPoint| match of {
        Some(camera) => point.light[camera],
        None => point.light.iter().zip(&top.light).map(|(a, b)| a * b).sum(),
    };
    own.iter()
        .map(|point| (f64::from(point.level), light(point)))
        .collect()
}

/// The curve of a series; black, which is subtracted, is its level 0.
fn curve(mut series: Vec<(f64, f64)>) -> Option<DeviceResponse> {
    let top = series.last()?.0;
    if series.len() < LEAST_LEVELS || top < f64::from(u8::MAX) {
        return None;
    }
    if series[0].0 > 0.0 {
        series.insert(0, (0.0, 0.0));
    }
    Curve::new(&series).map(DeviceResponse::Measured)
}

fn response(
    points: &[RampPoint],
    channels: usize,
    mixing: Option<&ColourMixingMatrix>,
) -> Option<ProjectorResponse> {
    let white = || series(points, RampChannel::White, None);
    let primaries = || PRIMARIES.map(|channel| curve(series(points, channel, None)));
    if channels == 3 {
        if let [Some(red), Some(green), Some(blue)] = primaries() {
            return ProjectorResponse::of_channels(vec![red, green, blue]);
        }
        // White alone, in each camera channel: its own colour's, if the camera
        // hardly mixes them.
        if mixing.is_none_or(|mixing| !mixing.matters()) {
            let own = [0, 1, 2].map(|c| curve(series(points, RampChannel::White, Some(c))));
            if let [Some(red), Some(green), Some(blue)] = own {
                return ProjectorResponse::of_channels(vec![red, green, blue]);
            }
        }
    }
    curve(white()).map(ProjectorResponse::from)
}

/// The largest fall that is more than noise.
fn fall(points: &[RampPoint]) -> Option<Fall> {
    let of = |channel: RampChannel| {
        let series = series(points, channel, None);
        let top = series.iter().map(|point| point.1).fold(0.0, f64::max);
        let fall = |two: &[(f64, f64)]| Fall {
            channel,
            level: two[1].0 as u8,
            share: (two[0].1 - two[1].1) / top,
        };
        series.windows(2).map(fall).collect::<Vec<_>>()
    };
    let falls = RampChannel::ALL.into_iter().flat_map(of);
    falls
        .filter(|fall| fall.share > FALL)
        .max_by(|a, b| a.share.total_cmp(&b.share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Response;

    /// A projector of three responses seen by a camera that mixes, with a white
    /// segment.
    fn points(segment: f64) -> Vec<RampPoint> {
        let of = [
            Response::Gamma(2.0),
            Response::Gamma(2.2),
            Response::Gamma(2.4),
        ];
        let mix = [[0.7, 0.1, 0.0], [0.05, 0.6, 0.05], [0.0, 0.1, 0.5]];
        let mut points = Vec::new();
        for channel in RampChannel::ALL {
            for level in (0..=255_u8).step_by(15) {
                let input = channel.input(level).map(|code| f64::from(code) / 255.0);
                let extra = if channel == RampChannel::White {
                    segment
                } else {
                    0.0
                };
                let primary = [0, 1, 2].map(|p| of[p].light(input[p]) * (1.0 + extra));
                let seen = mix.map(|row| row.iter().zip(primary).map(|(m, l)| m * l).sum());
                points.push(RampPoint {
                    channel,
                    level,
                    light: seen.to_vec(),
                });
            }
        }
        points
    }

    #[test]
    fn each_channels_response_is_found_through_a_camera_that_mixes_them() {
        let ramp = Ramp::new(points(0.0)).unwrap();
        let response = ramp.response.as_ref().unwrap();
        for (channel, gamma) in [2.0, 2.2, 2.4].into_iter().enumerate() {
            let truth = DeviceResponse::from(Response::Gamma(gamma));
            let steps = truth.steps_from(response.channel(channel));
            assert!(steps < 0.3, "{gamma}: {steps}");
        }
        assert!(ramp.white_excess.unwrap().abs() < 1e-9);
        assert!(ramp.complaints().is_empty());
        let mixing = ramp.mixing.unwrap();
        assert!((mixing.matrix[0][1] - 0.1 / 0.6).abs() < 1e-9);
    }

    #[test]
    fn a_white_segment_is_told_by_its_share() {
        let ramp = Ramp::new(points(0.4)).unwrap();
        assert!((ramp.white_excess.unwrap() - 0.4).abs() < 1e-9);
        let complaint = ramp.complaints().remove(0);
        assert!(
            complaint.contains("40 % brighter") && complaint.contains("vivid"),
            "{complaint}"
        );
    }

    #[test]
    fn a_ramp_that_falls_is_told_and_still_gives_a_rising_curve() {
        let mut points = points(0.0);
        for point in &mut points {
            if point.channel == RampChannel::Green && point.level > 200 {
                point.light.iter_mut().for_each(|light| *light *= 0.6);
            }
        }
        let ramp = Ramp::new(points).unwrap();
        let fall = ramp.fall.unwrap();
        assert_eq!((fall.channel, fall.level), (RampChannel::Green, 210));
        assert!(ramp.complaints()[0].contains("dynamic iris"));
        let green = ramp.response.unwrap().channel(1).clone();
        let light: Vec<f64> = (0..=255)
            .map(|v| green.light(f64::from(v) / 255.0))
            .collect();
        assert!(light.is_sorted());
    }

    #[test]
    fn a_grey_camera_gives_one_response_and_too_few_levels_none() {
        let grey = |level: u8| RampPoint {
            channel: RampChannel::White,
            level,
            light: vec![Response::Srgb.light(f64::from(level) / 255.0)],
        };
        let ramp = Ramp::new((0..=255).step_by(17).map(grey).collect()).unwrap();
        let response = ramp.response.unwrap();
        assert_eq!(response.channels().len(), 1);
        let truth = DeviceResponse::from(Response::Srgb);
        assert!(truth.steps_from(response.channel(0)) < 1.0);
        assert_eq!((ramp.mixing, ramp.white_excess), (None, None));
        assert_eq!(
            Ramp::new(vec![grey(128), grey(255)]).unwrap().response,
            None
        );
        assert_eq!(
            Ramp::new((0..=240).step_by(16).map(grey).collect())
                .unwrap()
                .response,
            None
        );
        assert_eq!(Ramp::new(Vec::new()), None);
    }
}
