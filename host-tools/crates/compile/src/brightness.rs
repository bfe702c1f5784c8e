//! Brightness of a table's white against the white that the projector shows without it.
//!
//! Bounces make corners of a scene brighter than the rest, and a table makes all of it as
//! bright as reference white: darker than it was, most of all in the corners. Both are
//! light that the camera measured, ambient light included, of all channels together.

use iltm_capture::Measurements;
use serde::{Deserialize, Serialize};

/// Light of a wanted white on the wall, of what white gives there without a table.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Brightness {
    /// Of all live cells together.
    pub mean: f64,
    /// Of the cell that loses most.
    pub least: f64,
}

impl Brightness {
    /// That of a reference white in camera units; `None` where no live cell has light.
    #[must_use]
    pub fn of(measurements: &Measurements, white: f64) -> Option<Self> {
        let channels = &measurements.channels;
        let whites: Vec<Vec<f64>> = (0..channels.len())
            .map(|channel| measurements.white(channel))
            .collect();
        let uncompensated = |cell: usize| -> f64 {
            let light = channels.iter().zip(&whites);
            let light = light.map(|(channel, white)| white[cell] + channel.ambient[cell].max(0.0));
            light.sum()
        };
        let cells = (0..measurements.live.len()).filter(|cell| measurements.live[*cell]);
        let before: Vec<f64> = cells
            .map(uncompensated)
            .filter(|light| *light > 0.0)
            .collect();
        let brightest = before.iter().copied().fold(0.0, f64::max);
        let wanted = white * channels.len() as f64;
        (brightest > 0.0).then(|| Self {
            mean: wanted * before.len() as f64 / before.iter().sum::<f64>(),
            least: wanted / brightest,
        })
    }

    /// In a sentence for people.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            "white is {:.0} % as bright as without the table; {:.0} % where bounces made it \
             brightest",
            100.0 * self.mean,
            100.0 * self.least
        )
    }
}
