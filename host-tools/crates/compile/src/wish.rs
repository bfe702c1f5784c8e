//! Which reference white was asked for, and which it became.

use super::content_white::Headroom;
use super::white::reference_white;
use super::{CompileError, FineGains};
use iltm_picture::LightPicture;
use iltm_solve::InverseTransport;
use serde::{Deserialize, Serialize};

/// What reference white is asked for, if not the brightest even grey that every live cell
/// reaches.
#[derive(Clone, Copy, Debug)]
pub enum WhiteWish<'c> {
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

/// The reference white of a table, and why it is that.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ChosenWhite {
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

/// What of the content is cut.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Cut {
    /// Share of the samples that may be cut at the projector's white.
    pub allowed: f64,
    /// Share of the samples that are.
    pub bright: f64,
    /// Share of the samples that are cut at its black, whatever the reference white.
    pub dark: f64,
    /// Frames looked at.
    pub frames: usize,
}

impl ChosenWhite {
    /// Chooses as asked. Content that nothing could cut, black all over, leaves it to the
    /// even grey.
    ///
    /// # Errors
    /// [`CompileError::Dark`] if no cell can be lit, [`CompileError::GreyContent`] if
    /// content is grey and the scene has colours.
    pub fn new(
        inverse: &InverseTransport,
        fine: Option<&FineGains>,
        wish: Option<WhiteWish<'_>>,
    ) -> Result<Self, CompileError> {
        let uniform = reference_white(inverse).ok_or(CompileError::Dark)?.light;
        let mut own = Self {
            light: uniform,
            uniform,
            chosen: Chosen::Uniform,
            content: None,
        };
        match wish {
            None => {}
            Some(WhiteWish::Light(light)) => {
                (own.light, own.chosen) = (light, Chosen::Given);
            }
            Some(WhiteWish::Content { frames, share }) => {
                let headroom = headroom(inverse, fine, frames)?;
                if let Some(white) = headroom.as_ref().and_then(|h| h.choose(share)) {
                    (own.light, own.chosen) = (white.light, Chosen::Content);
                    own.content = Some(Cut {
                        allowed: share,
                        bright: white.bright,
                        dark: white.dark,
                        frames: white.frames,
                    });
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

/// Where content is cut, frame by frame; `None` if the fine gains are of another grid.
///
/// # Errors
/// [`CompileError::GreyContent`].
pub fn headroom<'i>(
    inverse: &'i InverseTransport,
    fine: Option<&FineGains>,
    frames: &[LightPicture],
) -> Result<Option<Headroom<'i>>, CompileError> {
    let Some(mut headroom) = Headroom::new(inverse, fine) else {
        return Ok(None);
    };
    for frame in frames {
        if !headroom.add(frame) {
            return Err(CompileError::GreyContent);
        }
    }
    Ok(Some(headroom))
}
