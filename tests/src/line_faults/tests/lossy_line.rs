//! Tests of the lossy line.

use super::*;
use crate::line_faults::{FaultCounts, FaultRates, Faults, LossyLine, PacedLine};
use fastrand::Rng;
use iltm::device::Line;
use std::io::ErrorKind;

/// Fast enough that frames take next to no time.
const FAST: u32 = 100_000_000;

fn fast(faults: Faults) -> LossyLine<PacedLine<Notes>> {
    LossyLine::new(PacedLine::new(Notes::default(), FAST), faults)
}

/// What comes until nothing comes for a second.
fn hear(line: &mut impl Line) -> Vec<u8> {
    let (mut heard, mut bytes) = (Vec::new(), [0; 300]);
    let mut silent_since = line.now();
    while line.now() < silent_since + SECOND {
        let count = line.read(&mut bytes, SECOND).expect("plugged in");
        if count > 0 {
            silent_since = line.now();
        }
        heard.extend(&bytes[..count]);
    }
    heard
}

/// A frame of six bytes that says its number.
fn frame(number: u16) -> [u8; 6] {
    let [low, high] = number.to_le_bytes();
    [1 + (low & 0x7F), 2 + (low >> 7), 1 + (high & 0x7F), 7, 9, 0]
}

fn number(frame: &&[u8]) -> u32 {
    let [low, middle, high] = [frame[0] - 1, frame[1] - 2, frame[2] - 1];
    u32::from(low) + (u32::from(middle) << 7) + (u32::from(high) << 8)
}

fn frames(count: u16) -> Vec<u8> {
    (0..count).flat_map(frame).collect()
}

/// What the device hears of frames that are sent one after the other.
fn sent(line: &mut LossyLine<PacedLine<Notes>>, count: u16) -> Vec<u8> {
    for number in 0..count {
        line.write(&frame(number)).expect("plugged in");
    }
    hear(line);
    std::mem::take(&mut line.line_mut().far_end_mut().heard)
}

fn pieces(bytes: &[u8]) -> Vec<&[u8]> {
    bytes.split_inclusive(|byte| *byte == 0).collect()
}

#[test]
fn a_line_without_faults_passes_every_byte_in_its_order() {
    let mut random = Rng::with_seed(1);
    // Noise, with many delimiters in a row, with thousands of bytes between two, and
    // without one at the end.
    let mut noise: Vec<u8> = (0..20_000).map(|_| random.u8(..4)).collect();
    noise.extend((0..20_000).map(|_| random.u8(1..)));
    let mut line = fast(Faults::default());
    for piece in noise.chunks(77) {
        line.write(piece).expect("plugged in");
    }
    line.line_mut().far_end_mut().says.clone_from(&noise);
    assert_eq!(hear(&mut line), noise);
    assert_eq!(line.line().far_end().heard, noise);
    assert_eq!((line.to_device().faulty(), line.to_host().faulty()), (0, 0));
}

#[test]
fn a_delimiter_before_a_frame_belongs_to_it() {
    let mut line = fast(Faults::default());
    for _ in 0..10 {
        line.write(&[0, 5, 5, 0]).expect("plugged in");
    }
    assert_eq!(line.to_device().frames, 10);
}

/// Whether `count` of so many draws is what a rate in parts of 1,000 gives, within
/// five standard deviations.
fn is_rate(count: u64, rate: u16, draws: u16) -> bool {
    let (share, draws) = (f64::from(rate) / 1_000.0, f64::from(draws));
    let off = (count as f64 - share * draws).abs();
    off <= 5.0 * (share * (1.0 - share) * draws).sqrt()
}

const COUNT: u16 = 20_000;

/// What became of frames by a counts, and what the device heard of them.
fn damaged(rates: FaultRates) -> (FaultCounts, Vec<u8>) {
    let mut line = fast(Faults {
        to_device: rates,
        seed: 7,
        ..Faults::default()
    });
    let heard = sent(&mut line, COUNT);
    (line.to_device(), heard)
}

#[test]
fn every_kind_of_fault_comes_as_often_as_its_rate() {
    let rates = FaultRates {
        drop: 100,
        duplicate: 150,
        corrupt: 50,
        reorder: 200,
        delay: 80,
        cut: 120,
        delay_by: SECOND / 2,
    };
    let (counts, _) = damaged(rates);
    for (count, rate) in [
        (counts.dropped, 100),
        (counts.duplicated, 150),
        (counts.corrupted, 50),
        (counts.reordered, 200),
        (counts.delayed, 80),
        (counts.cut, 120),
        (counts.faulty(), 700),
    ] {
        assert!(is_rate(count, rate, COUNT), "{count} for {rate} of 1,000");
    }
    assert_eq!(counts.frames, u64::from(COUNT));
}

#[test]
fn dropped_frames_are_missing_and_no_others() {
    let (counts, heard) = damaged(FaultRates::only(|rates| rates.drop = 100));
    assert!(is_rate(counts.dropped, 100, COUNT) && counts.faulty() == counts.dropped);
    assert_eq!(
        pieces(&heard).len() as u64,
        u64::from(COUNT) - counts.dropped
    );
    assert!(pieces(&heard).is_sorted_by_key(number), "in their order");
}

#[test]
fn duplicated_frames_come_twice_and_no_others() {
    let (counts, heard) = damaged(FaultRates::only(|rates| rates.duplicate = 150));
    assert!(is_rate(counts.duplicated, 150, COUNT) && counts.faulty() == counts.duplicated);
    let mut came = pieces(&heard);
    assert_eq!(came.len() as u64, u64::from(COUNT) + counts.duplicated);
    came.dedup();
    assert!(came.concat() == frames(COUNT));
}

#[test]
fn reordered_and_delayed_frames_all_arrive() {
    let delayed = FaultRates {
        delay: 80,
        delay_by: SECOND / 2,
        ..FaultRates::default()
    };
    for rates in [delayed, FaultRates::only(|rates| rates.reorder = 200)] {
        let (counts, heard) = damaged(rates);
        assert!(is_rate(
            counts.delayed + counts.reordered,
            rates.delay + rates.reorder,
            COUNT
        ));
        let mut came = pieces(&heard);
        assert!(!came.is_sorted_by_key(number), "{counts:?}");
        came.sort_unstable_by_key(number);
        assert!(came.concat() == frames(COUNT), "{counts:?}");
    }
}

#[test]
fn cut_frames_run_into_the_next() {
    let (counts, heard) = damaged(FaultRates::only(|rates| rates.cut = 120));
    assert!(is_rate(counts.cut, 120, COUNT) && counts.faulty() == counts.cut);
    let whole = pieces(&heard)
        .iter()
        .filter(|piece| piece.ends_with(&[0]))
        .count();
    assert_eq!(whole as u64, u64::from(COUNT) - counts.cut);
    // Of six bytes, from none to five stay, each alike often.
    let left = heard.len() as f64 - 6.0 * (f64::from(COUNT) - counts.cut as f64);
    assert!(
        (left / counts.cut as f64 - 2.5).abs() < 0.2,
        "{left} of {counts:?}"
    );
}

#[test]
fn corrupted_frames_have_other_bytes_and_as_many() {
    let (counts, heard) = damaged(FaultRates::only(|rates| rates.corrupt = 50));
    assert!(is_rate(counts.corrupted, 50, COUNT) && counts.faulty() == counts.corrupted);
    let sent = frames(COUNT);
    assert_eq!(heard.len(), sent.len());
    let pairs = heard.chunks(6).zip(sent.chunks(6));
    assert_eq!(
        pairs.filter(|(heard, sent)| heard != sent).count() as u64,
        counts.corrupted
    );
}

#[test]
fn frames_that_are_all_reordered_arrive_all_the_same() {
    let rates = FaultRates::only(|rates| rates.reorder = 1_000);
    let mut line = fast(Faults::both_ways(rates, 1));
    assert_eq!(sent(&mut line, 50), frames(50));
    // One alone waits for a companion, and not for ever.
    let before = line.now();
    line.line_mut().far_end_mut().says = frames(1);
    let mut bytes = [0; 100];
    let mut count = 0;
    while count == 0 {
        count = line.read(&mut bytes, SECOND).expect("plugged in");
    }
    assert_eq!(bytes[..count], frame(0));
    let took = line.now() - before;
    assert!((20..21).contains(&took.as_millis()), "{took:?}");
}

#[test]
fn a_reordered_frame_changes_places_with_the_next() {
    let rates = FaultRates::only(|rates| rates.reorder = 300);
    let mut line = fast(Faults::both_ways(rates, 3));
    let heard = sent(&mut line, 1_000);
    let all = frames(1_000);
    let places: Vec<usize> = pieces(&heard)
        .iter()
        .map(|piece| {
            pieces(&all)
                .iter()
                .position(|sent| sent == piece)
                .expect("whole")
        })
        .collect();
    let counts = line.to_device();
    // Where two frames in a row wait, the third passes both.
    let passed = places.windows(2).filter(|pair| pair[0] > pair[1]).count() as u64;
    assert!(
        passed > 150 && passed <= counts.reordered,
        "{passed} of {counts:?}"
    );
    let far = places
        .iter()
        .enumerate()
        .filter(|(at, place)| at.abs_diff(**place) > 8);
    assert_eq!(far.count(), 0);
}

#[test]
fn a_delayed_frame_comes_when_its_time_has_come() {
    let delay_by = Duration::from_millis(70);
    let rates = FaultRates {
        delay: 1_000,
        delay_by,
        ..FaultRates::default()
    };
    let mut line = fast(Faults::both_ways(rates, 1));
    line.write(&frame(1)).expect("plugged in");
    hear(&mut line);
    // On the next turn, a tenth of a millisecond later at most.
    let last = line.line().far_end().last;
    assert!(
        (delay_by..delay_by + Duration::from_micros(200)).contains(&last),
        "{last:?}"
    );
}

#[test]
fn a_line_is_unplugged_after_exactly_so_many_frames() {
    for after in [0, 1, 7] {
        let faults = Faults::default().unplugged_after(u64::from(after));
        let mut line = fast(faults);
        let result = line.write(&frames(10));
        assert_eq!(
            result.is_err(),
            after == 0,
            "a line that is there takes them all"
        );
        let error = line.write(&frame(0)).expect_err("unplugged");
        assert_eq!(error.kind(), ErrorKind::NotConnected);
        line.read(&mut [0; 10], SECOND).expect_err("unplugged");
        assert!(line.is_unplugged());
        line.plug_in();
        line.write(&frame(11)).expect("plugged in");
        hear(&mut line);
        let expected = [frames(after), frame(11).to_vec()].concat();
        assert_eq!(line.line().far_end().heard, expected);
    }
}

#[test]
fn frames_to_the_host_before_it_is_unplugged_can_still_be_read() {
    let mut line = fast(Faults::default().unplugged_after(2));
    line.line_mut().far_end_mut().says = frames(3);
    let (mut heard, mut bytes) = (Vec::<u8>::new(), [0; 1]);
    let error = loop {
        match line.read(&mut bytes, SECOND) {
            Ok(count) => heard.extend(&bytes[..count]),
            Err(error) => break error,
        }
    };
    assert_eq!(error.kind(), ErrorKind::NotConnected);
    assert_eq!(heard, frames(2));
}

#[test]
fn the_same_seed_damages_the_same_frames() {
    let run = |seed| {
        let mut line = fast(Faults::both_ways(FaultRates::evenly(400), seed));
        let heard = sent(&mut line, 500);
        (heard, line.to_device())
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn rates_that_are_shared_evenly_add_up() {
    for parts in [0, 4, 200, 201, 1_000] {
        let rates = FaultRates::evenly(parts);
        let sum = rates.drop + rates.duplicate + rates.corrupt + rates.reorder + rates.cut;
        assert_eq!(sum, parts);
    }
    let all = FaultRates {
        drop: u16::MAX,
        cut: u16::MAX,
        ..FaultRates::default()
    };
    let mut line = fast(Faults::both_ways(all, 1));
    assert!(sent(&mut line, 100).is_empty());
    assert_eq!(line.to_device().dropped, 100);
}

#[test]
fn no_wait_and_no_buffer_hangs() {
    let turns = Duration::from_secs(1);
    let line = PacedLine::new(Notes::default(), 0).with_turns_every(turns);
    let mut line = LossyLine::new(line, Faults::default());
    line.line_mut().far_end_mut().says = vec![1; 100];
    assert_eq!(line.read(&mut [], Duration::MAX).expect("a line"), 0);
    // A baud of 0 is 1: the first of these bytes comes after 10 s.
    let mut count = 0;
    while count == 0 {
        count = line.read(&mut [0; 8], Duration::MAX).expect("a line");
    }
    assert!(line.line().elapsed() >= 10 * SECOND);
}
