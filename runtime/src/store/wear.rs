//! Wear limit: how often a device lets its line erase flash.
//!
//! Whoever reaches the line of a device without a key can have it erase the same sector
//! again and again. Whole updates in a row are never slowed: a start allows
//! [`UPDATES`] times all sectors of a slot. From then on one more erase is allowed every
//! [`REFILL_MS`]: 100,000 erases, which is what a sector of common flash bears, take 5.7
//! years. What writes a commit record without a right counts as an erase too, since
//! records are erased in turn.

use crate::link::Refusal;

/// Whole slots that may be written in a row.
const UPDATES: u32 = 16;

/// Milliseconds after which one more erase is allowed: half an hour.
const REFILL_MS: u64 = 30 * 60 * 1_000;

/// Erases that are allowed yet. Known in RAM only.
#[derive(Clone, Copy, Debug)]
pub(super) struct WearLimit {
    most: u32,
    left: u32,
    /// When `left` is counted up next.
    next_ms: u64,
}

impl WearLimit {
    /// At a start, for slots of so many sectors.
    pub(super) const fn new(sectors: u32) -> Self {
        let most = sectors.saturating_mul(UPDATES);
        Self {
            most,
            left: most,
            next_ms: 0,
        }
    }

    /// Takes one erase.
    ///
    /// # Errors
    /// [`Refusal::Wear`].
    #[inline(never)]
    pub(super) fn take(&mut self, now_ms: u64) -> Result<(), Refusal> {
        while self.left < self.most && now_ms >= self.next_ms {
            self.left += 1;
            self.next_ms = self.next_ms.saturating_add(REFILL_MS);
        }
        if self.left == self.most {
            self.next_ms = now_ms.saturating_add(REFILL_MS);
        }
        if let Some(left) = self.left.checked_sub(1) {
            self.left = left;
            return Ok(());
        }
        // At most half an hour.
        let wait_s = (self.next_ms.saturating_sub(now_ms) as u32).div_ceil(1_000);
        Err(Refusal::Wear { wait_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wear(wait_s: u32) -> Result<(), Refusal> {
        Err(Refusal::Wear { wait_s })
    }

    #[test]
    fn so_many_updates_in_a_row_are_allowed_and_then_one_erase_every_half_hour() {
        let mut limit = WearLimit::new(10);
        for _ in 0..160 {
            assert_eq!(limit.take(5_000), Ok(()));
        }
        assert_eq!(limit.take(5_000), wear(1_800));
        assert_eq!(limit.take(905_000), wear(900));
        assert_eq!(limit.take(1_805_000), Ok(()));
        assert_eq!(limit.take(1_805_000), wear(1_800));
    }

    #[test]
    fn hammering_one_sector_from_the_first_start_on_takes_years_to_wear_it_out() {
        // A slot of 512 sectors, an attempt a minute, for a year.
        let mut limit = WearLimit::new(512);
        let minutes = 365 * 24 * 60_u64;
        let erases = (0..minutes).filter(|minute| limit.take(minute * 60_000).is_ok());
        let erases = erases.count();
        assert!(erases < 8_192 + 17_600, "{erases} in a year");
    }

    #[test]
    fn a_pause_brings_the_allowance_back_and_no_more() {
        let mut limit = WearLimit::new(1);
        while limit.take(0).is_ok() {}
        let years = u64::MAX / 2;
        assert_eq!(
            (0..100)
                .filter(|_| limit.take(REFILL_MS * 1_000).is_ok())
                .count(),
            16
        );
        assert!(limit.take(years).is_ok());
    }
}
