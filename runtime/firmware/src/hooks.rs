//! Hooks of a self-test in the frame loop.

use crate::board::Clock;
use crate::telemetry::Telemetry;
use iltm_runtime::governor::TierChange;

/// What a self-test may do to the loop; the product runs with [`NoHooks`].
pub trait FrameHooks {
    /// Called once a round, before a frame is looked for.
    fn round(&mut self, _clock: &impl Clock) {}

    /// The tier of the next frame, where the governor chose `tier`.
    fn tier(&mut self, tier: u8) -> u8 {
        tier
    }

    /// Called when the pixels of a frame are done and it is still claimed.
    fn during_frame(&mut self, _sequence: u32, _tier: u8, _clock: &impl Clock) {}

    /// Called after every frame.
    fn after_frame(&mut self, _outcome: FrameOutcome, _status: &Telemetry) {}
}

/// What became of a frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameOutcome {
    /// Its number.
    pub sequence: u32,
    /// Its tier.
    pub tier: u8,
    /// Ticks that it took.
    pub ticks: u32,
    /// Whether it took longer than the budget.
    pub over: bool,
    /// Whether the governor changed the tier after it.
    pub change: Option<TierChange>,
}

/// No hooks.
pub struct NoHooks;

impl FrameHooks for NoHooks {}
