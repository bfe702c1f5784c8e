//! Reference white: what a wanted 255 means in camera units, as asked for and as it became.

use super::clip_thresholds::{ClipThresholds, Cut};
use super::{CompileError, FineGains};
use iltm_picture::{LightPicture, statistics::quantile};
use iltm_solve::InverseTransport;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// What reference white is asked for, if not the brightest even grey that every live cell
/// reaches.
#[derive(Clone, Copy, Debug)]
pub enum WhiteRequest<'c> {
    /// This light, camera units.
    Light(f64),
    /// The brightest at which no more than a share of the content is cut.
    Content {
        /// Frames: light relative to white, of any size.
        frames: &'c [LightPicture],
        /// Share of the samples that may be cut at the projector's white.
        share: f64,
    },
}

/// A white that is asked for may be so many times the even grey that every live cell
/// reaches: content that is dark all over has room for some more, and beyond that nothing
/// of white is left.
const MOST_OVER: f64 = 4.0;

/// The reference white of a table, and why it is that.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ReferenceWhite {
    /// Light of reference white, camera units.
    pub light: f64,
    /// The brightest even grey that every live cell reaches, camera units.
    pub uniform: f64,
    /// Why.
    pub chosen: Chosen,
    /// What of the content is cut, where there was some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub content: Option<Cut>,
}

/// Why a reference white is what it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Chosen {
    /// It is the brightest even grey.
    Uniform,
    /// It was given.
    Given,
    /// It is the brightest that cuts no more of the content than was allowed.
    Content,
}

impl ReferenceWhite {
    /// Chooses as asked, for content with black raised to that of the brightest cells if
    /// `match_black`. Content that nothing could cut, black all over, leaves it to the
    /// even grey.
    ///
    /// # Errors
    /// [`CompileError::Dark`] if no cell can be lit, [`CompileError::BeyondReach`] if what
    /// is asked for is, [`CompileError::GreyContent`] if
    /// content is grey and the scene has colours.
    pub fn new(
        inverse: &InverseTransport,
        fine: Option<&FineGains>,
        request: Option<WhiteRequest<'_>>,
        match_black: bool,
    ) -> Result<Self, CompileError> {
        let uniform = uniform_white(inverse).ok_or(CompileError::Dark)?;
        let mut own = Self {
            light: uniform,
            uniform,
            chosen: Chosen::Uniform,
            content: None,
        };
        match request {
            None => {}
            Some(WhiteRequest::Light(light)) => {
                if light > MOST_OVER * uniform {
                    return Err(CompileError::BeyondReach { light, uniform });
                }
                (own.light, own.chosen) = (light, Chosen::Given);
            }
            Some(WhiteRequest::Content { frames, share }) => {
                let black = if match_black {
                    brightest_black(inverse)
                } else {
                    0.0
                };
                let thresholds = ClipThresholds::of(inverse, fine, frames, black)?;
                if let Some((light, cut)) = thresholds.and_then(|found| found.choose(share)) {
                    (own.light, own.chosen) = (light, Chosen::Content);
                    own.content = Some(cut);
                }
            }
        }
        Ok(own)
    }

    /// Why, for people.
    #[must_use]
    pub fn reason(&self) -> String {
        match (self.chosen, &self.content) {
            (Chosen::Uniform, _) => {
                "the brightest even grey that every live cell reaches".to_owned()
            }
            (Chosen::Content, Some(cut)) => format!(
                "the brightest that cuts at most {:.3} % of {} frames of content: {:.3} % at the \
                 projector's white, {:.3} % at its black; even grey would reach {:.4}",
                100.0 * cut.allowed,
                cut.frames,
                100.0 * cut.bright,
                100.0 * cut.dark,
                self.uniform
            ),
            (Chosen::Given | Chosen::Content, _) => {
                format!("as asked for; even grey would reach {:.4}", self.uniform)
            }
        }
    }
}

/// Share of the live cells whose black is not brighter than the one that all get: the brightest
/// cells of all are those with the most noise.
const BLACK_REACHED: f64 = 0.99;

/// The black that nearly all live cells can show, camera units.
pub(crate) fn brightest_black(inverse: &InverseTransport) -> f64 {
    let live = (0..inverse.live.len()).filter(|cell| inverse.live[*cell]);
    let most = |cell: usize| {
        let channels = inverse.channels.iter().map(|channel| channel.ambient[cell]);
        channels.fold(0.0, f64::max)
    };
    let mut light: Vec<f64> = live.map(most).collect();
    quantile(&mut light, BLACK_REACHED).unwrap_or(0.0)
}

/// Light of the brightest uniform grey, the same in all channels, that every live cell
/// reaches without clipping, camera units; `None` if there is no such cell or light.
///
/// For a wanted light `w` everywhere, cell `i` needs
/// `p_i = w s_i - t_i` with `s = g - K 1` and `t = g a - K a`, so it reaches
/// `w <= (1 + t_i) / s_i`.
#[must_use]
pub fn uniform_white(inverse: &InverseTransport) -> Option<f64> {
    let mut lowest: Option<f64> = None;
    let cells = inverse.grid.cells();
    let live = |cell: usize| inverse.live.get(cell).copied().unwrap_or(false);
    for (index, channel) in inverse.channels.iter().enumerate() {
        // Even light, and what is there under black.
        let light = DMatrix::from_fn(cells, 2, |cell, column| match column {
            _ if !live(cell) => 0.0,
            0 => 1.0,
            _ => channel.ambient[cell],
        });
        let drive = inverse.channel(index).apply(&light);
        for cell in (0..cells).filter(|cell| live(*cell)) {
            let (slope, offset) = (drive[(cell, 0)], drive[(cell, 1)]);
            if slope <= 0.0 {
                continue;
            }
            let light = (1.0 + offset) / slope;
            if light.is_finite() && light > 0.0 && lowest.is_none_or(|low| light < low) {
                lowest = Some(light);
            }
        }
    }
    lowest
}
