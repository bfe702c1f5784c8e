//! Mutation: inputs made from good ones, each by its number: nothing else is needed to
//! make it again.

use fastrand::Rng;

/// Input number `index` of a run: one of the `seeds` with some of its bytes changed, in
/// groups of `group` bytes behind the first `head`.
pub fn input(seeds: &[Vec<u8>], (head, group): (usize, usize), run: u64, index: u64) -> Vec<u8> {
    let mut random = Rng::with_seed(run.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index);
    // A generator whose seeds are neighbours starts alike.
    random = Rng::with_seed(random.u64(..));
    let mut bytes = random.choice(seeds).cloned().unwrap_or_default();
    for _ in 0..1 << random.u32(0..5) {
        mutate(&mut bytes, seeds, (head, group), &mut random);
    }
    bytes
}

fn mutate(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], (head, group): (usize, usize), random: &mut Rng) {
    let groups = bytes.len().saturating_sub(head) / group;
    // Where a group begins, or ends at last.
    let place = |random: &mut Rng| (head + random.usize(0..=groups) * group).min(bytes.len());
    let (one, two) = (place(random), place(random));
    let (from, to) = (one.min(two), one.max(two));
    match random.u32(0..10) {
        0 | 1 if !bytes.is_empty() => {
            let at = random.usize(0..bytes.len());
            bytes[at] ^= 1 << random.u32(0..8);
        }
        2 | 3 if !bytes.is_empty() => {
            let at = random.usize(0..bytes.len());
            let telling = [0, 1, 0x7F, 0x80, 0xFF, random.u8(..)];
            bytes[at] = telling[random.usize(0..telling.len())];
        }
        4 if !bytes.is_empty() => {
            // The head, which much depends on.
            let at = random.usize(0..head.clamp(1, bytes.len()));
            bytes[at] = random.u8(..);
        }
        5 => {
            let short = to.min(from + 4 * group);
            bytes.drain(from..short);
        }
        6 => {
            let short = to.min(from + 4 * group);
            let copy = bytes[from..short].to_vec();
            bytes.splice(two..two, copy);
        }
        7 if random.u32(0..4) == 0 => bytes.truncate(from),
        8 => {
            if let Some(other) = random.choice(seeds) {
                let start = (head + random.usize(0..=other.len() / group) * group).min(other.len());
                let end = (start + random.usize(0..8) * group).min(other.len());
                bytes.splice(from..from, other[start..end].iter().copied());
            }
        }
        _ => {
            let new: Vec<u8> = (0..group * random.usize(1..6))
                .map(|_| random.u8(..))
                .collect();
            bytes.splice(from..from, new);
        }
    }
}

/// The shortest and simplest input found that `fails` as well.
pub fn minimised(
    mut bytes: Vec<u8>,
    (head, group): (usize, usize),
    fails: impl Fn(&[u8]) -> bool,
) -> Vec<u8> {
    let mut size = bytes.len().next_power_of_two().max(group);
    loop {
        let mut at = head.min(bytes.len());
        let mut shorter = false;
        while at < bytes.len() {
            let mut less = bytes.clone();
            less.drain(at..bytes.len().min(at + size));
            if fails(&less) {
                bytes = less;
                shorter = true;
            } else {
                at += size;
            }
        }
        if size > group {
            size = (size / 2).max(group);
        } else if !shorter {
            break;
        }
    }
    for at in 0..bytes.len() {
        let mut plain = bytes.clone();
        plain[at] = 0;
        if plain != bytes && fails(&plain) {
            bytes = plain;
        }
    }
    bytes
}
