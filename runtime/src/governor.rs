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
//!   frame over the budget less than [`LASTING`] frames after a change of tier doubles
//!   the patience, up to [`MOST_PATIENCE`]; a tier that was tried and has lasted
//!   [`LASTING`] frames halves it.
//!
//! So frames are never risked for accuracy for long. Where tier 0 fits:
//!
//! - Whatever the load does, at most `25 + n / 700` of any `n` frames are over the
//!   budget: a frame that comes after a lasting tier costs [`LASTING`] frames, any other
//!   doubles the patience, and the tiers that it costs are won back at that pace.
//! - Under a disturbance that comes every `N` frames, `N` up to 2,000, at most one frame
//!   in 2,048 is over the budget and at most one change of tier in 256 frames is made,
//!   once 100,000 frames have passed.
//! - When a disturbance is over, the first tier comes back after at most
//!   [`MOST_PATIENCE`] frames and each further one after at most `2 * LASTING`: at 60
//!   frames a second after 273 and 68 seconds.
//! - Under a constant load, a tier whose first frame failed is not tried again for
//!   [`FORGET`] frames, half an hour. Then what was measured is forgotten, since a
//!   disturbance may have met that very frame.

use crate::image::Table;
use crate::image::layout::MAX_TIERS;

/// Frames that must leave room for the next tier before it is tried.
pub const PATIENCE: u32 = 8;

/// Longest patience, in frames.
pub const MOST_PATIENCE: u32 = 1 << 14;

/// Frames after which a tier that was tried has lasted.
pub const LASTING: u32 = 1 << 11;

/// Frames after which a tier is tried again that has been measured to be too slow: half
/// an hour at 60 a second.
pub const FORGET: u32 = 1 << 17;

/// Fraction bits of a ratio between two times.
const RATIO_BITS: u32 = 12;

/// Two times that do not differ.
const SAME: u32 = 1 << RATIO_BITS;

/// The largest ratio that is kept.
const MOST: u32 = u32::MAX;

/// Cost of one sample at a tier without operator, of one outside the operator at the
/// others, and of one multiplication in it. Only their ratios count, and only until they
/// have been measured. A tier that is expected to take longer than it does may never be
/// tried, while one that is tried in vain costs a frame. So these are the least by which a
/// tier differs from the one below: the first two for frames of many pixels a cell, the
/// last for long rows of entries and odd grids, where samples take the most.
const GAIN_COST: u64 = 44;
const SAMPLE_COST: u64 = 64;
const MULTIPLICATION_COST: u64 = 1;

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
    /// Whether this tier was reached from the one below.
    climbed: bool,
    /// Frames in a row for which the next tier was measured to be too slow.
    barred: u32,
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
    /// The same by the table's own figures.
    stated: u32,
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
            step.stated = ratio(cost, below);
            step.ratio = step.stated;
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
            climbed: false,
            barred: 0,
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
        if took > self.budget {
            return self.over_budget(took);
        }
        // An eighth down a frame: what is over for some frames is forgotten.
        self.peak = took.max(self.peak - self.peak / 8);
        self.fall = 0;
        self.steady = self.steady.saturating_add(1);
        self.judge_trial(took);
        self.try_next()
    }

    /// The highest tier below that should fit, and at least one below.
    fn over_budget(&mut self, took: u32) -> Option<TierChange> {
        self.overruns = self.overruns.saturating_add(1);
        if let Some(before) = self.before.take() {
            // Frames of the trial that fitted say what the tier takes; this one was
            // disturbed.
            let measured = if self.steady == 0 { took } else { self.peak };
            self.learn(measured, before);
        }
        let is_lasting = self.steady >= LASTING;
        self.roomy = 0;
        self.steady = 0;
        self.barred = 0;
        self.climbed = false;
        let from = self.tier;
        if from == 0 {
            self.peak = self.peak.max(took);
            return None;
        }
        if !is_lasting && self.fall == 0 {
            self.patience = (self.patience * 2).min(MOST_PATIENCE);
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

    /// After a while, what a tier takes is known, and later that it has lasted.
    fn judge_trial(&mut self, took: u32) {
        if self.steady < PATIENCE {
            return;
        }
        if let Some(before) = self.before.take() {
            self.learn(took.max(self.peak), before);
        }
        if self.climbed && self.steady.is_multiple_of(LASTING) {
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
            self.barred = self.barred.saturating_add(1);
            if self.barred == FORGET {
                self.forget();
            }
            return None;
        }
        self.barred = 0;
        self.roomy = self.roomy.saturating_add(1);
        if self.roomy < self.patience {
            return None;
        }
        let from = self.tier;
        self.before = Some(self.peak);
        self.tier += 1;
        self.climbed = true;
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
            step.ratio = ratio(u64::from(took), u64::from(before.max(1)));
            step.difference = Some(took.saturating_sub(before));
        }
    }

    /// What was measured of the next tier is forgotten; the table's own figures count.
    fn forget(&mut self) {
        self.barred = 0;
        if let Some(step) = self.steps.get_mut(usize::from(self.tier) + 1) {
            step.ratio = step.stated;
            step.difference = None;
        }
    }
}

impl Step {
    const SAME: Self = Self {
        ratio: SAME,
        stated: SAME,
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
    use std::vec;
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

    /// What a load does to frames: the time of frame `index` at a tier.
    type Load<'l> = &'l dyn Fn(u32, u8) -> u32;

    const BUDGET: u32 = 1_000;

    /// Tables of two, five and sixteen tiers, of which some fit the budget.
    fn tables() -> [Vec<u32>; 3] {
        let even = (0..16).map(|tier| 300 + 40 * tier).collect();
        [vec![500, 860], vec![100, 300, 500, 700, 860], even]
    }

    fn governor_of(times: &[u32]) -> Governor {
        Governor::new(times.iter().map(|time| u64::from(*time)), BUDGET)
    }

    /// Frames over the budget above tier 0, and changes of tier, in so many frames.
    fn counted(governor: &mut Governor, load: Load<'_>, frames: std::ops::Range<u32>) -> [u32; 2] {
        let [mut over, mut changes] = [0; 2];
        for index in frames {
            let tier = governor.tier();
            let took = load(index, tier);
            over += u32::from(took > BUDGET && tier > 0);
            changes += u32::from(governor.frame(took).is_some());
        }
        [over, changes]
    }

    #[test]
    fn it_settles_under_any_periodic_disturbance_and_climbs_when_it_is_over() {
        let mut worst = [(0, 0, 0); 2];
        let [mut barred, mut cases] = [0; 2];
        // Every small period, and of the others one in 31: all of them take a minute.
        let periods = (2..40)
            .chain((40..=2_000).step_by(31))
            .chain([57, 60, 2_000]);
        for period in periods {
            for (index, times) in tables().iter().enumerate() {
                // Some more ticks at each tier, some more at the upper ones only, and so
                // many times the ticks; one frame or a tenth of the period.
                for (kind, more) in [(0, 60), (0, 200), (0, 4_000), (1, 300), (2, 2), (2, 30)] {
                    let long = if more == 200 { period / 10 } else { 0 };
                    let load = |frame: u32, tier: u8| {
                        let took = times[usize::from(tier)];
                        match kind {
                            _ if frame % period > long || kind == 1 && tier == 0 => took,
                            0 | 1 => took + more,
                            _ => took * more,
                        }
                    };
                    let mut governor = governor_of(times);
                    counted(&mut governor, &load, 0..100_000);
                    let found = counted(&mut governor, &load, 100_000..120_480);
                    for (worst, found) in worst.iter_mut().zip(found) {
                        *worst = (*worst).max((found, period, more));
                    }
                    let calm = |_: u32, tier: u8| times[usize::from(tier)];
                    let tiers = times.len() as u32 - 1;
                    let most = MOST_PATIENCE + 64 + 2 * LASTING * tiers;
                    let highest = times.iter().rposition(|time| *time <= governor.room());
                    let is_back = |governor: &Governor| Some(governor.tier().into()) == highest;
                    counted(&mut governor, &calm, 0..most);
                    if !is_back(&governor) {
                        // The first frame of a trial was disturbed.
                        barred += 1;
                        counted(&mut governor, &calm, 0..FORGET + most);
                    }
                    cases += 1;
                    assert!(
                        is_back(&governor),
                        "period {period}, table {index}, {kind} {more}: tier {} after it",
                        governor.tier()
                    );
                }
            }
        }
        let [over, changes] = worst;
        std::println!(
            "20,480 frames: over the budget {over:?}, changes {changes:?}; {barred} of {cases} barred"
        );
        assert!(over.0 <= 10, "{over:?}");
        assert!(changes.0 <= 80, "{changes:?}");
    }

    #[test]
    fn no_load_however_mean_brings_many_frames_over_the_budget() {
        // A load that sees the tier: it lets the tiers rise and last, then strikes some
        // times with so many frames between; `rest` frames later it begins anew.
        let mut worst = 0.0_f64;
        for times in tables() {
            let top = times.len() as u8 - 1;
            for rest in [
                0, 8, 9, 100, 2_040, 2_049, 4_100, 6_200, 8_300, 10_400, 12_500, 18_600,
            ] {
                for strikes in [1, 2, 3, 5, 8, 16] {
                    for between in [1, 2, 9, 40] {
                        let mut governor = governor_of(&times);
                        let (mut over, mut calm, mut left) = (0_u32, 0_u32, 0_u32);
                        let frames = 100_000_u32;
                        for frame in 0..frames {
                            let tier = governor.tier();
                            calm += 1;
                            if left == 0 && calm > rest && (tier == top || rest >= 8 && tier > 0) {
                                left = strikes;
                            }
                            let strike = left > 0 && tier > 0 && frame.is_multiple_of(between);
                            if strike {
                                left -= 1;
                                calm = 0;
                                over += 1;
                            }
                            left *= u32::from(tier > 0);
                            governor.frame(if strike { BUDGET + 1 } else { 10 });
                        }
                        worst = worst.max(f64::from(over) / f64::from(frames));
                        assert!(
                            over <= 25 + frames / 700,
                            "{over}: {top} {rest} {strikes} {between}"
                        );
                    }
                }
            }
        }
        std::println!("worst: one frame in {:.0}", 1.0 / worst);
    }

    #[test]
    fn a_tier_whose_first_frame_was_disturbed_is_tried_again_after_half_an_hour() {
        let times = [500, 860];
        let mut governor = governor_of(&times);
        run(&mut governor, &times, PATIENCE as usize);
        assert_eq!(governor.tier(), 1);
        governor.frame(1_060);
        assert_eq!(governor.tier(), 0);
        assert!(run(&mut governor, &times, FORGET as usize - 1).is_empty());
        run(&mut governor, &times, 2 * PATIENCE as usize + 1);
        assert_eq!((governor.tier(), governor.overruns()), (1, 1));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        #[test]
        fn whatever_the_load_overruns_are_few_if_tier_0_fits(
            costs in prop::collection::vec(1..1_000_u64, 1..MAX_TIERS),
            loads in prop::collection::vec(0..3_000_u32, 0..2_000),
        ) {
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
                prop_assert!(governor.overruns() <= 25 + frames / 700);
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
