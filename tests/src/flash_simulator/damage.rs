//! Damage to flash cells: what a power cut, age and wear do to cells.

use super::{ERASE_STAGES, Wear};
use fastrand::Rng;
use std::collections::BTreeSet;

/// Bits that are set with a probability of `1 / 2^halvings` each.
fn rare(random: &mut Rng, halvings: u32) -> u64 {
    (0..halvings).fold(u64::MAX, |bits, _| bits & random.u64(..))
}

/// A byte whose program was cut: some of the bits that were to be cleared are.
pub(super) fn torn(old: u8, new: u8, random: &mut Rng) -> u8 {
    old & (new | random.u8(..))
}

/// A sector whose erase was cut at a stage, and which of its bits are `weak`.
///
/// A bit that is 0 has become 1 already with a probability of 1/64, 1/8, 1/2, 3/4,
/// 15/16, 127/128 or 1023/1024, stage by stage: at first few have moved, at last few
/// have not. Parts that clear all bits before they set them all do the first in
/// stages 1 and 2.
pub(super) fn half_erased(
    cells: &mut [u8],
    mut weak: Option<&mut [u8]>,
    stage: u64,
    preprograms: bool,
    random: &mut Rng,
) {
    if stage == 0 || stage >= ERASE_STAGES {
        return;
    }
    for (at, chunk) in cells.chunks_mut(8).enumerate() {
        let mut old = [0xFF; 8];
        for (old, cell) in old.iter_mut().zip(chunk.iter()) {
            *old = *cell;
        }
        let old = u64::from_le_bytes(old);
        let new = match (preprograms, stage) {
            (true, 1) => old & !rare(random, 2),
            (true, 2) => old & rare(random, 4),
            (true, _) => moved(stage, random),
            (false, _) => old | moved(stage, random),
        };
        for (cell, new) in chunk.iter_mut().zip(new.to_le_bytes()) {
            *cell = new;
        }
        // A cell that an erase has begun to move is near the threshold; a quarter of
        // them so near that it reads as either.
        if let Some(weak) = &mut weak {
            let doubtful = !old & rare(random, 2);
            let doubtful = doubtful.to_le_bytes();
            for (weak, doubtful) in weak.iter_mut().skip(at * 8).zip(doubtful) {
                *weak |= doubtful;
            }
        }
    }
}

fn moved(stage: u64, random: &mut Rng) -> u64 {
    match stage {
        1 => rare(random, 6),
        2 => rare(random, 3),
        3 => rare(random, 1),
        4 => !rare(random, 2),
        5 => !rare(random, 4),
        6 => !rare(random, 7),
        _ => !rare(random, 10),
    }
}

/// A worn sector just after it was erased: one cell in 1,024, and at least one, is
/// stuck at 0.
pub(super) fn worn_erase(cells: &mut [u8], random: &mut Rng) {
    let bits = cells.len() * 8;
    for _ in 0..bits.div_ceil(1_024) {
        flip(cells, random.usize(..bits), |cell, bit| cell & !bit);
    }
}

/// A byte in a worn sector after a program: one bit in 64 that was to be cleared is
/// not.
pub(super) fn worn_program(old: u8, new: u8, random: &mut Rng) -> u8 {
    let [slips, ..] = rare(random, 6).to_le_bytes();
    old & (new | slips)
}

/// Flips `count` bits, all different, or all there are.
pub(super) fn rot(cells: &mut [u8], count: usize, random: &mut Rng) {
    let bits = cells.len() * 8;
    // Floyd's sampling (Bentley and Floyd, 1987): every set of bits alike likely.
    let mut chosen = BTreeSet::new();
    for last in bits.saturating_sub(count)..bits {
        let bit = random.usize(..=last);
        if !chosen.insert(bit) {
            chosen.insert(last);
        }
    }
    for bit in chosen {
        flip(cells, bit, |cell, bit| cell ^ bit);
    }
}

fn flip(cells: &mut [u8], bit: usize, change: impl Fn(u8, u8) -> u8) {
    if let Some(cell) = cells.get_mut(bit / 8) {
        *cell = change(*cell, 1 << (bit % 8));
    }
}

/// What a sector has been through, and will stand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sector {
    pub(super) erases: u32,
    /// How many erases it stands, and how it fails afterwards.
    pub(super) limit: Option<(u32, Wear)>,
}

impl Sector {
    pub(super) const NEW: Self = Self {
        erases: 0,
        limit: None,
    };

    pub(super) fn is_worn(&self, how: Wear) -> bool {
        // One that takes no erase any more refuses the first that is too many.
        let more = u32::from(how == Wear::Refuses);
        self.limit
            .is_some_and(|(stands, wear)| wear == how && self.erases + more > stands)
    }
}
