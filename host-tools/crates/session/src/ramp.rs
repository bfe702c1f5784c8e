//! Even light of many levels in each channel: how projector and camera respond.

use iltm_capture::{CalibrationRole, RampChannel};
use iltm_picture::{Picture, Samples};
use iltm_runtime::{FrameSize, Grid};

/// Input values that a ramp of `levels` levels has, as far apart as can be: first
/// 0, last 255.
///
/// ```
/// # use iltm_session::ramp_levels;
/// assert_eq!(ramp_levels(5), [0, 64, 128, 191, 255]);
/// ```
#[must_use]
pub fn ramp_levels(levels: u16) -> Vec<u8> {
    let last = f64::from(levels.max(2) - 1);
    let mut values: Vec<u8> = (0..levels)
        .map(|step| (255.0 * f64::from(step) / last).round() as u8)
        .collect();
    values.dedup();
    values
}

/// All roles of the ramps: white first, then each channel alone, dark to bright.
/// Black is shown once, as the first level of white.
pub(super) fn roles(levels: u16) -> Vec<CalibrationRole> {
    let levels = ramp_levels(levels);
    let of_channel = |channel: RampChannel| {
        let shown = levels.iter().copied();
        shown
            .filter(move |level| *level > 0 || channel == RampChannel::White)
            .map(move |level| CalibrationRole::Ramp { channel, level })
    };
    RampChannel::ALL.into_iter().flat_map(of_channel).collect()
}

/// One pixel a cell, all of `input`; grey where its channels are alike.
pub(super) fn even(grid: Grid, input: [u8; 3]) -> Option<Picture> {
    let [red, green, blue] = input;
    let samples = if red == green && green == blue {
        vec![red; grid.cells()]
    } else {
        input.repeat(grid.cells())
    };
    Picture::new(FrameSize::of_grid(grid), Samples::Eight(samples))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_rise_from_black_to_white_without_repetition() {
        for levels in 2..=400 {
            let values = ramp_levels(levels);
            assert_eq!((values[0], values[values.len() - 1]), (0, 255));
            assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "{levels}");
            assert_eq!(values.len(), usize::from(levels.min(256)));
        }
        assert!(ramp_levels(0).is_empty());
    }

    #[test]
    fn black_is_shown_once_and_each_channel_reaches_full() {
        let roles = roles(9);
        assert_eq!(roles.len(), 9 + 3 * 8);
        let ramp = |channel, level| CalibrationRole::Ramp { channel, level };
        for channel in RampChannel::ALL {
            assert!(roles.contains(&ramp(channel, 255)));
            assert_eq!(
                roles.contains(&ramp(channel, 0)),
                channel == RampChannel::White
            );
        }
    }
}
