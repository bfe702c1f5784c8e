//! Latency: how long a change of the picture takes to be seen in a photograph.
//!
//! Two things delay it. The projector shows a picture some frames after it got it:
//! waiting helps. A camera that streams hands out pictures that it took earlier, so
//! that the first photographs after a change show what was before, however long one
//! waits: those have to be thrown away.

use super::SessionError;
use super::shell;
use std::time::{Duration, Instant};

/// Photographs of black at the start: more than a camera keeps back.
const FIRST: usize = 5;

/// Photographs that a change may take to be seen.
const MOST: usize = 20;

/// Longest that a change may take to be seen.
const LONGEST: Duration = Duration::from_secs(15);

/// Longest pause between two photographs of a change.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// Part of the step from black to white that may be lacking: lamps flicker.
const LACKING: f64 = 0.05;

/// Step from black to white, of full scale in the photograph's mean, that is surely
/// one: the projection may fill a small part of the picture only.
const LEAST_STEP: f64 = 0.004;

/// Added to what was measured, as a share and as a time: frames of the projector's
/// and luck.
const MARGIN: f64 = 0.25;
const MARGIN_TIME: Duration = Duration::from_millis(50);

/// What to do after each change of the picture.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Latency {
    /// Wait so long.
    pub wait: Duration,
    /// Then throw so many photographs away.
    pub discard: usize,
}

/// White, or black.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flash {
    /// Every cell lit.
    White,
    /// No cell lit.
    Black,
}

/// What the measurement needs of projector and camera.
pub trait LatencyProbe {
    /// Shows white or black.
    ///
    /// # Errors
    /// What showing gives.
    fn show(&mut self, flash: Flash) -> Result<(), SessionError>;

    /// Takes a photograph and gives its mean, of full scale.
    ///
    /// # Errors
    /// What photographing gives.
    fn level(&mut self) -> Result<f64, SessionError>;
}

/// Flashes white and black, and photographs until each change is there.
///
/// # Errors
/// [`SessionError::Latency`] if white and black look alike or photographs do not
/// settle, or what showing and photographing give.
pub fn measure(
    rig: &mut dyn LatencyProbe,
    stop: &dyn Fn() -> bool,
) -> Result<Latency, SessionError> {
    rig.show(Flash::Black)?;
    let mut black = 0.0;
    for _ in 0..FIRST {
        pause(LONGEST_PAUSE / 4, stop)?;
        black = rig.level()?;
    }
    let (white, seen) = rise(rig, black, stop)?;
    let there = |level: f64, flash: Flash| {
        let lacking = match flash {
            Flash::White => white - level,
            Flash::Black => level - black,
        };
        lacking <= LACKING * (white - black)
    };
    let mut latency = Latency {
        wait: with_margin(seen),
        discard: 0,
    };
    // A camera that keeps pictures back makes the first wait too long at the worst;
    // what tells it is that waiting is not enough.
    let mut flash = Flash::Black;
    let mut good = 0;
    for _ in 0..MOST {
        rig.show(flash)?;
        pause(latency.wait, stop)?;
        for _ in 0..latency.discard {
            rig.level()?;
        }
        let mut more = 0;
        while !there(rig.level()?, flash) {
            more += 1;
            if more > MOST {
                let reason = "photographs after a change go on differing".to_owned();
                return Err(SessionError::Latency { reason });
            }
        }
        latency.discard += more;
        good = if more == 0 { good + 1 } else { 0 };
        // Both ways.
        if good == 2 {
            return Ok(latency);
        }
        flash = match flash {
            Flash::White => Flash::Black,
            Flash::Black => Flash::White,
        };
    }
    let reason = format!("it was another one in each of {MOST} flashes");
    Err(SessionError::Latency { reason })
}

/// Shows white and photographs at growing delays until it stands: its level, and
/// after what time the first photograph was begun that shows all of it.
fn rise(
    rig: &mut dyn LatencyProbe,
    black: f64,
    stop: &dyn Fn() -> bool,
) -> Result<(f64, Duration), SessionError> {
    rig.show(Flash::White)?;
    let shown = Instant::now();
    let mut taken: Vec<(Duration, f64)> = Vec::new();
    let mut space = Duration::from_millis(20);
    while taken.len() < MOST && shown.elapsed() < LONGEST {
        let begun = shown.elapsed();
        taken.push((begun, rig.level()?));
        if let [.., (_, before), (_, last)] = taken[..]
            && last - black > LEAST_STEP
            && (last - before).abs() < LACKING * (last - black)
        {
            let least = last - LACKING * (last - black);
            let first = taken.iter().find(|(_, level)| *level >= least);
            return Ok((last, first.map_or(begun, |(begun, _)| *begun)));
        }
        pause(space, stop)?;
        space = (space * 3 / 2).min(LONGEST_PAUSE);
    }
    let levels = taken.iter().map(|(_, level)| *level);
    let (least, most) = levels.fold((1.0_f64, 0.0_f64), |(least, most), level| {
        (least.min(level), most.max(level))
    });
    let (count, percent) = (taken.len(), |level: f64| 100.0 * level);
    let reason = if most - black > LEAST_STEP {
        format!(
            "{count} photographs of white go on differing, their means from {:.1} to {:.1} % of \
             full scale",
            percent(least),
            percent(most)
        )
    } else {
        format!(
            "white and black look alike: after {count} photographs of white their mean is {:.1} % \
             of full scale, with black {:.1} %",
            percent(most),
            percent(black)
        )
    };
    Err(SessionError::Latency { reason })
}

fn with_margin(seen: Duration) -> Duration {
    seen.mul_f64(1.0 + MARGIN) + MARGIN_TIME
}

fn pause(time: Duration, stop: &dyn Fn() -> bool) -> Result<(), SessionError> {
    if shell::wait(time, stop) {
        Ok(())
    } else {
        Err(SessionError::Stopped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;

    /// A projector that shows a picture `late` after it got it, and a camera that
    /// hands out the picture before the last `kept` ones.
    struct Fake {
        shown: Vec<(Instant, f64)>,
        late: Duration,
        kept: VecDeque<f64>,
        photographs: usize,
    }

    impl Fake {
        fn new(late: u64, kept: usize) -> Self {
            Self {
                shown: vec![(Instant::now(), 0.5)],
                late: Duration::from_millis(late),
                kept: vec![0.5; kept].into(),
                photographs: 0,
            }
        }
    }

    impl LatencyProbe for Fake {
        fn show(&mut self, flash: Flash) -> Result<(), SessionError> {
            let level = match flash {
                Flash::White => 0.3,
                Flash::Black => 0.01,
            };
            self.shown.push((Instant::now() + self.late, level));
            Ok(())
        }

        fn level(&mut self) -> Result<f64, SessionError> {
            self.photographs += 1;
            let now = Instant::now();
            let seen = self.shown.iter().rev().find(|(from, _)| *from <= now);
            self.kept.extend(seen.map(|(_, level)| *level));
            Ok(self.kept.pop_front().unwrap_or(0.0))
        }
    }

    #[test]
    fn photographs_that_a_camera_keeps_back_are_counted() {
        for kept in 0..4 {
            let mut fake = Fake::new(0, kept);
            let latency = measure(&mut fake, &|| false).unwrap();
            assert_eq!(latency.discard, kept);
        }
    }

    #[test]
    fn a_late_projector_is_waited_for() {
        let mut fake = Fake::new(150, 0);
        let latency = measure(&mut fake, &|| false).unwrap();
        assert_eq!(latency.discard, 0);
        assert!(latency.wait >= Duration::from_millis(150), "{latency:?}");
    }

    #[test]
    fn a_camera_that_sees_no_projector_is_told_so() {
        struct Blind;
        impl LatencyProbe for Blind {
            fn show(&mut self, _: Flash) -> Result<(), SessionError> {
                Ok(())
            }
            fn level(&mut self) -> Result<f64, SessionError> {
                Ok(0.07)
            }
        }
        let stop_late = Instant::now();
        let stop = || stop_late.elapsed() > Duration::from_mins(1);
        let error = measure(&mut Blind, &stop).unwrap_err();
        assert!(error.to_string().contains("7.0 %"), "{error}");
    }
}
