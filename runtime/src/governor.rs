//! Governor: chooses the tier that fits the frame budget.
//!
//! A [`Governor`] is told how long every frame took and says which tier the next
//! one gets. It knows how much longer each tier takes than the one below, as a
//! ratio and as a difference: first a ratio from the table's own figures, then
//! both as measured when a tier was tried. A slower clock multiplies times and a
//! busy interrupt adds to them; which of the two it is cannot be known, so it
//! expects the worse on the way down and the better on the way up.
//!
//! - **Down at once.** A frame over the budget lowers the tier before the next
//!   frame, by as many tiers as it may take; should that not do, by twice as many
//!   the next time.
//! - **Up with patience.** The next tier is tried only after [`PATIENCE`] frames
//!   that all left it room with a margin of an eighth, and one tier at a time. A
//!   trial that fails doubles the patience, one that lasts halves it again.
//!
//! So frames are never risked for accuracy for long: every frame over the budget
//! costs at least one tier, and tiers are won back at most once in [`PATIENCE`]
//! frames. Where tier 0 fits, at most `start + n / PATIENCE` of any `n` frames
//! from the start are over the budget, whatever the load does; under a constant
//! load, a tier that failed is not tried again.

use crate::image::Table;
use crate::image::layout::MAX_TIERS;

/// Frames that must leave room for the next tier before it is tried.
pub const PATIENCE: u32 = 8;

/// Longest patience, in frames: half an hour at 60 a second.
pub const MOST_PATIENCE: u32 = 1 << 17;

/// Fraction bits of a ratio between two times.
const RATIO_BITS: u32 = 12;

/// Two times that do not differ.
const SAME: u32 = 1 << RATIO_BITS;

/// The largest ratio that is kept.
const MOST: u32 = u32::MAX;

/// Cost of one sample at a tier without operator, of one outside the operator at the
/// others, and of one multiplication in it, in instructions. Only their ratios count,
/// and only until they have been measured. The first is the largest that it is anywhere
/// in `docs/instructions.csv`, in proportion to the second: a tier that is expected to
/// take longer than it does might never be tried.
const GAIN_COST: u64 = 17;
const SAMPLE_COST: u64 = 40;
const MULTIPLICATION_COST: u64 = 4;

/// A tier for every frame.
#[derive(Clone, Debug)]
pub struct Governor {
    budget: u32,
    tier: u8,
    top: u8,
    /// How much longer each tier takes than the one below; the first is unused.
    steps: [Step; MAX_TIERS],
    /// Slowly sinking maximum of the times at this tier.
    peak: u32,
    /// The same at the tier below, when this one was tried.
    before: Option<u32>,
    /// Frames at this tier, all within the budget.
    steady: u32,
    /// Frames in a row that left room for the next tier.
    roomy: u32,
    patience: u32,
    /// Tiers that the last frame over the budget cost, if the frame before was
    /// over the budget too.
    fall: u8,
    overruns: u32,
}

/// From one tier to the next.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// With [`RATIO_BITS`] fraction bits.
    ratio: u32,
    /// Ticks, once they have been measured.
    difference: Option<u32>,
}

/// A change of tier.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TierChange {
    /// Tier of the frame that was measured.
    pub from: u8,
    /// Tier of the next frame.
    pub to: u8,
    /// Why.
    pub reason: Reason,
}

/// Why the tier changed. Times are in the ticks that the governor is used with.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reason {
    /// A frame took longer than the budget.
    OverBudget {
        /// What it took.
        took: u32,
    },
    /// The next tier will fit.
    TimeToSpare {
        /// What a frame of it is expected to take.
        expected: u32,
    },
}

impl Governor {
    /// A governor that starts at tier 0, for tiers of these relative costs, tier 0
    /// first, and a budget in ticks of any clock.
    ///
    /// Costs beyond the sixteenth are left out, and a budget of zero is one tick.
    #[must_use]
    pub fn new(costs: impl IntoIterator<Item = u64>, budget: u32) -> Self {
        let mut steps = [Step::SAME; MAX_TIERS];
        let mut costs = costs.into_iter();
        let mut below = costs.next().unwrap_or(1).max(1);
        let mut top = 0;
        for (step, cost) in steps.iter_mut().skip(1).zip(costs) {
            step.ratio = ratio(cost, below);
            below = cost.max(1);
            top += 1;
        }
        Self {
            budget: budget.max(1),
            tier: 0,
            top,
            steps,
            peak: 0,
            before: None,
            steady: 0,
            roomy: 0,
            patience: PATIENCE,
            fall: 0,
            overruns: 0,
        }
    }

    /// A governor for frames of `samples` samples with this table.
    #[must_use]
    pub fn for_table(table: &Table<'_>, samples: usize, budget: u32) -> Self {
        let samples = samples as u64;
        let cost = |multiplications: u32| match multiplications {
            0 => samples * GAIN_COST,
            some => samples * SAMPLE_COST + u64::from(some) * MULTIPLICATION_COST,
        };
        let tiers = table.tiers().iter();
        Self::new(tiers.map(|tier| cost(tier.multiplications)), budget)
    }

    /// Tier of the next frame.
    #[must_use]
    pub const fn tier(&self) -> u8 {
        self.tier
    }

    /// What a frame may take.
    #[must_use]
    pub const fn budget(&self) -> u32 {
        self.budget
    }

    /// Frames that took longer than the budget.
    #[must_use]
    pub const fn overruns(&self) -> u32 {
        self.overruns
    }

    /// Takes the time of a frame at [`tier`](Self::tier); the next frame may have
    /// another one.
    pub fn frame(&mut self, took: u32) -> Option<TierChange> {
        // An eighth down a frame: what is over for some frames is forgotten.
        self.peak = took.max(self.peak - self.peak / 8);
        if took > self.budget {
            return self.over_budget(took);
        }
        self.fall = 0;
        self.steady = self.steady.saturating_add(1);
        self.judge_trial(took);
        self.try_next()
    }

    /// The highest tier below that should fit, and at least one below.
    fn over_budget(&mut self, took: u32) -> Option<TierChange> {
        self.overruns = self.overruns.saturating_add(1);
        if let Some(before) = self.before.take() {
            self.learn(took, before);
            self.patience = (self.patience * 2).min(MOST_PATIENCE);
        }
        self.roomy = 0;
        self.steady = 0;
        let from = self.tier;
        if from == 0 {
            return None;
        }
        let least = self.fall.saturating_mul(2).max(1);
        let mut expected = took;
        while self.tier > 0 && (from - self.tier < least || expected > self.room()) {
            expected = self.step(self.tier).down(expected);
            self.tier -= 1;
        }
        self.fall = from - self.tier;
        self.peak = 0;
        Some(TierChange {
            from,
            to: self.tier,
            reason: Reason::OverBudget { took },
        })
    }

    /// After a while, a tier that was tried has lasted.
    fn judge_trial(&mut self, took: u32) {
        if self.steady < PATIENCE {
            return;
        }
        if let Some(before) = self.before.take() {
            self.learn(took.max(self.peak), before);
            self.patience = (self.patience / 2).max(PATIENCE);
        }
    }

    fn try_next(&mut self) -> Option<TierChange> {
        if self.tier >= self.top || self.before.is_some() {
            return None;
        }
        let expected = self.step(self.tier + 1).up(self.peak);
        if expected > self.room() {
            self.roomy = 0;
            return None;
        }
        self.roomy = self.roomy.saturating_add(1);
        if self.roomy < self.patience {
            return None;
        }
        let from = self.tier;
        self.before = Some(self.peak);
        self.tier += 1;
        self.peak = 0;
        self.steady = 0;
        self.roomy = 0;
        Some(TierChange {
            from,
            to: self.tier,
            reason: Reason::TimeToSpare { expected },
        })
    }

    /// What a tier may be expected to take if it is to be chosen.
    const fn room(&self) -> u32 {
        self.budget - self.budget / 8
    }

    /// From the tier below to this one.
    fn step(&self, tier: u8) -> Step {
        let step = self.steps.get(usize::from(tier));
        step.copied().unwrap_or(Step::SAME)
    }

    fn learn(&mut self, took: u32, before: u32) {
        if let Some(step) = self.steps.get_mut(usize::from(self.tier)) {
            *step = Step {
                ratio: ratio(u64::from(took), u64::from(before.max(1))),
                difference: Some(took.saturating_sub(before)),
            };
        }
    }
}

impl Step {
    const SAME: Self = Self {
        ratio: SAME,
        difference: None,
    };

    /// The least that the upper tier may take, if the lower takes `time`.
    fn up(self, time: u32) -> u32 {
        // A ratio at the end of its range may be any larger one.
        let product = if self.ratio == MOST {
            u32::MAX
        } else {
            let product = (u64::from(time) * u64::from(self.ratio)) >> RATIO_BITS;
            product.min(u64::from(u32::MAX)) as u32
        };
        let sum = self.difference.map(|more| time.saturating_add(more));
        sum.map_or(product, |sum| sum.min(product))
    }

    /// The most that the lower tier may take, if the upper takes `time`.
    fn down(self, time: u32) -> u32 {
        let quotient = ((u64::from(time) << RATIO_BITS) / u64::from(self.ratio.max(SAME))) as u32;
        let rest = self.difference.map(|more| time.saturating_sub(more));
        rest.map_or(quotient, |rest| rest.max(quotient))
    }
}

/// `time / other`, at least 1.
fn ratio(time: u64, other: u64) -> u32 {
    let ratio = (time << RATIO_BITS).div_ceil(other);
    ratio.clamp(u64::from(SAME), u64::from(MOST)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// A device whose tiers take these times, for `frames` frames; the changes
    /// with the frame that they came after.
    fn run(governor: &mut Governor, times: &[u32], frames: usize) -> Vec<(usize, TierChange)> {
        (0..frames)
            .filter_map(|frame| {
                let change = governor.frame(times[usize::from(governor.tier())])?;
                Some((frame, change))
            })
            .collect()
    }

    fn rising() -> impl Strategy<Value = Vec<u32>> {
        prop::collection::vec(0..400_u32, 1..MAX_TIERS).prop_map(|steps| {
            let mut sum = 1;
            let times = steps.into_iter().map(|step| {
                sum += step;
                sum
            });
            times.collect()
        })
    }

    #[test]
    fn it_climbs_to_the_highest_tier_with_a_margin_and_stays() {
        let times = [100, 200, 400, 800, 1_600];
        let costs = [1, 2, 4, 8, 16];
        for (budget, expected) in [(99, 0), (240, 1), (500, 2), (1_000, 3), (5_000, 4)] {
            let mut governor = Governor::new(costs, budget);
            run(&mut governor, &times, 200);
            assert_eq!(governor.tier(), expected, "budget {budget}");
            assert!(run(&mut governor, &times, 10_000).is_empty());
            assert_eq!(governor.overruns() == 0, budget > 99);
        }
    }

    #[test]
    fn an_overrun_lowers_the_tier_before_the_next_frame_by_as_many_as_it_takes() {
        // By the table's figures, before anything was measured.
        let mut governor = Governor::new([1, 2, 4, 8], 1_000);
        governor.tier = 3;
        let change = governor.frame(3_200);
        let reason = Reason::OverBudget { took: 3_200 };
        assert_eq!(
            change,
            Some(TierChange {
                from: 3,
                to: 1,
                reason
            })
        );
        assert_eq!(governor.frame(800), None);
    }

    #[test]
    fn a_slower_clock_costs_one_frame_and_tiers_that_fit_come_back() {
        let times = [100, 200, 400, 800];
        let mut governor = Governor::new([1, 2, 4, 8], 1_000);
        run(&mut governor, &times, 200);
        assert_eq!((governor.tier(), governor.overruns()), (3, 0));
        let slow = times.map(|time| time * 4);
        run(&mut governor, &slow, 500);
        assert_eq!((governor.tier(), governor.overruns()), (1, 1));
    }

    #[test]
    fn an_added_delay_costs_one_frame_and_the_tier_comes_back() {
        let times = [100, 200, 300, 400, 500, 600, 700, 800];
        let mut governor = Governor::new([1, 2, 3, 4, 5, 6, 7, 8], 1_000);
        run(&mut governor, &times, 200);
        assert_eq!((governor.tier(), governor.overruns()), (7, 0));
        let slow = times.map(|time| time + 650);
        run(&mut governor, &slow, 500);
        assert_eq!((governor.tier(), governor.overruns()), (1, 1));
        run(&mut governor, &times, 1_000);
        assert_eq!((governor.tier(), governor.overruns()), (7, 1));
    }

    #[test]
    fn a_table_of_one_tier_has_nothing_to_choose() {
        let mut governor = Governor::new([5], 10);
        assert_eq!(governor.frame(1_000), None);
        assert_eq!(governor.frame(1), None);
        assert_eq!((governor.tier(), governor.overruns()), (0, 1));
    }

    #[test]
    fn a_tier_hundreds_of_times_as_slow_is_not_tried_again_and_again() {
        let mut governor = Governor::new([1, u64::MAX >> 20], 292);
        run(&mut governor, &[1, 333], 20_000);
        assert!(run(&mut governor, &[1, 333], 20_000).is_empty());
        assert!(governor.overruns() <= 1);
    }

    #[test]
    fn a_tier_that_fails_only_sometimes_is_tried_more_and_more_rarely() {
        // The next tier takes too long in one frame of ten.
        let mut governor = Governor::new([10, 11], 1_000);
        for frame in 0..100_000_u32 {
            let slow = governor.tier() == 1 && frame.is_multiple_of(10);
            governor.frame(if slow { 1_010 } else { 500 });
        }
        assert!(governor.overruns() < 20, "{}", governor.overruns());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        #[test]
        fn whatever_the_load_overruns_are_few_if_tier_0_fits(
            costs in prop::collection::vec(1..1_000_u64, 1..MAX_TIERS),
            loads in prop::collection::vec(0..3_000_u32, 0..2_000),
        ) {
            const BUDGET: u32 = 1_000;
            let mut governor = Governor::new(costs, BUDGET);
            for (frame, load) in loads.iter().enumerate() {
                let took = if governor.tier() == 0 { (*load).min(BUDGET) } else { *load };
                let tier = governor.tier();
                let change = governor.frame(took);
                prop_assert_eq!(change.map_or(tier, |change| change.to), governor.tier());
                if took > BUDGET {
                    prop_assert!(governor.tier() < tier, "an overrun lowers the tier");
                }
                let frames = frame as u32 + 1;
                prop_assert!(governor.overruns() <= frames / PATIENCE);
            }
        }

        #[test]
        fn under_a_constant_load_it_settles_for_good(
            times in rising(), costs in rising(), budget in 1..3_000_u32
        ) {
            let costs = costs.into_iter().map(u64::from).chain(std::iter::repeat(u64::MAX >> 20));
            let costs: Vec<u64> = costs.take(times.len()).collect();
            let mut governor = Governor::new(costs, budget.max(times[0]));
            run(&mut governor, &times, 20_000);
            let settled = governor.tier();
            prop_assert!(times[usize::from(settled)] <= governor.budget());
            prop_assert!(governor.overruns() <= u32::from(MAX_TIERS as u8));
            prop_assert!(run(&mut governor, &times, 20_000).is_empty());
        }

        #[test]
        fn it_settles_at_the_highest_tier_where_its_figures_are_right(
            times in rising(), budget in 1..3_000_u32
        ) {
            let mut governor = Governor::new(times.iter().map(|time| u64::from(*time)), budget);
            run(&mut governor, &times, 1_000);
            let room = budget - budget / 8;
            let highest = times.iter().rposition(|time| *time <= room).unwrap_or(0);
            // A ratio is kept to twelve bits.
            let slack = times.iter().rposition(|time| time + time / 256 < room).unwrap_or(0);
            let tier = usize::from(governor.tier());
            prop_assert!((slack..=highest).contains(&tier), "{tier} not in {slack}..={highest}");
            if times[0] <= budget {
                prop_assert_eq!(governor.overruns(), 0);
            }
        }
    }
}
