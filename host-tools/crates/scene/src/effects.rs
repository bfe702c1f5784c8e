//! Simulated effects: which there are, and what was decided about each.

use strum::{Display, EnumIter, EnumString, VariantNames};
use thiserror::Error;

/// Something that light does, or that a camera makes of it, in the order in which it is
/// decided about. Its name on the command line is its own in small letters.
#[derive(
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Debug,
    Display,
    EnumIter,
    EnumString,
    VariantNames,
)]
#[strum(serialize_all = "kebab-case")]
#[strum(parse_err_ty = UnknownEffect, parse_err_fn = UnknownEffect::new)]
pub enum Effect {
    /// Red, green and blue are different.
    Colour,
    /// Surfaces throw shadows in the projector's light.
    Shadows,
    /// Surfaces light each other.
    Interreflection,
    /// Surfaces stand between others.
    Occlusion,
    /// What is beside the projector's frame sends light back.
    Surroundings,
    /// Sides turned away from the projector send light back.
    Backs,
    /// Bounced light differs within a patch.
    Detail,
    /// Glossy panels send light around the mirror direction.
    Gloss,
    /// Mirrors reflect.
    Mirrors,
    /// The projector's cells run into each other.
    Blur,
    /// The projector is darker in the corners.
    Vignetting,
    /// The projector's black is not dark.
    Black,
    /// The projector's lamp grows darker while photographs are taken.
    Drift,
    /// The camera's channels see more than one of the projector's.
    Mixing,
    /// Light from elsewhere.
    Ambient,
    /// The camera's lens bends straight lines.
    Distortion,
    /// Photographs are noisy.
    Noise,
    /// Photographs are rounded to the converter's bits.
    Quantisation,
    /// The camera's values are not in proportion to light.
    Response,
}

/// A name that no [`Effect`] has.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
#[error("there is no effect `{name}`; there are {}", Effect::VARIANTS.join(", "))]
pub struct UnknownEffect {
    name: String,
}

impl UnknownEffect {
    fn new(name: &str) -> Self {
        let name = name.to_owned();
        Self { name }
    }
}

/// What was decided about an effect, and why.
#[derive(Clone, PartialEq, Debug)]
pub struct Decision {
    /// The effect.
    pub effect: Effect,
    /// Whether it is simulated.
    pub on: bool,
    /// Whether somebody asked for this instead of what the scene says.
    pub forced: bool,
    /// Whether the scene leaves a choice: what it does not have cannot be simulated.
    pub possible: bool,
    /// Why, with the number that decided.
    pub reason: String,
    /// Seconds that simulating it took; 0 if it is off or costs nothing of its own.
    pub seconds: f64,
}

/// Effects that are wanted or unwanted whatever the scene says.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Forced(Vec<(Effect, bool)>);

impl Forced {
    /// Wants `effect` on or off.
    #[must_use]
    pub fn with(mut self, effect: Effect, on: bool) -> Self {
        self.0.retain(|(e, _)| *e != effect);
        self.0.push((effect, on));
        self
    }

    fn wanted(&self, effect: Effect) -> Option<bool> {
        let found = self.0.iter().find(|(e, _)| *e == effect);
        found.map(|(_, on)| *on)
    }
}

/// The decisions of one simulation, as they are made.
#[derive(Clone, Debug)]
pub(crate) struct Decisions {
    forced: Forced,
    made: Vec<Decision>,
}

impl Decisions {
    /// None yet.
    pub(crate) fn new(forced: Forced) -> Self {
        Self {
            forced,
            made: Vec::new(),
        }
    }

    /// What somebody asked for about an effect.
    pub(crate) fn forced(&self, effect: Effect) -> Option<bool> {
        self.forced.wanted(effect)
    }

    /// Decides about an effect: `on` is what the scene says, `reason` why. Returns
    /// whether to simulate it.
    pub(crate) fn decide(&mut self, effect: Effect, on: bool, reason: impl Into<String>) -> bool {
        let wanted = self.forced.wanted(effect);
        let forced = wanted.is_some_and(|wanted| wanted != on);
        let on = wanted.unwrap_or(on);
        self.made.push(Decision {
            effect,
            on,
            forced,
            possible: true,
            reason: reason.into(),
            seconds: 0.0,
        });
        on
    }

    /// An effect that the scene leaves no room for: it cannot be forced either.
    /// Where somebody asked for it, the reason says so.
    pub(crate) fn rule_out(&mut self, effect: Effect, reason: &str) {
        let asked = self.forced(effect) == Some(true);
        let reason = if asked {
            format!("asked for, but {reason}")
        } else {
            reason.to_owned()
        };
        self.made.push(Decision {
            effect,
            on: false,
            forced: false,
            possible: false,
            reason,
            seconds: 0.0,
        });
    }

    /// Decides about an effect that was `found`, if it shows and why, or rules it out because
    /// there is `nothing`. Returns whether to simulate it.
    pub(crate) fn weigh(
        &mut self,
        effect: Effect,
        found: Option<(bool, String)>,
        nothing: &str,
    ) -> bool {
        if let Some((on, reason)) = found {
            return self.decide(effect, on, reason);
        }
        self.rule_out(effect, nothing);
        false
    }

    /// Adds to an effect's time.
    pub(crate) fn took(&mut self, effect: Effect, seconds: f64) {
        if let Some(decision) = self.made.iter_mut().find(|d| d.effect == effect) {
            decision.seconds += seconds;
        }
    }

    /// Adds to an effect's reason what was found while simulating it.
    pub(crate) fn found(&mut self, effect: Effect, what: &str) {
        if let Some(decision) = self.made.iter_mut().find(|d| d.effect == effect) {
            decision.reason.push_str("; ");
            decision.reason.push_str(what);
        }
    }

    /// Whether an effect is simulated.
    pub(crate) fn on(&self, effect: Effect) -> bool {
        self.made.iter().any(|d| d.effect == effect && d.on)
    }

    /// All of them, in the order of [`Effect`].
    pub(crate) fn all(&self) -> Vec<Decision> {
        let mut all = self.made.clone();
        all.sort_by_key(|decision| decision.effect);
        all
    }
}
