use super::*;
use crate::device::Line;
use fastrand::Rng;
use std::io::ErrorKind;
use std::time::Duration;

/// A device that notes what it hears and when, and says what it is told to.
#[derive(Debug, Default)]
struct Notes {
    heard: Vec<u8>,
    says: Vec<u8>,
    last: Duration,
}

impl FarEnd for Notes {
    fn turn(&mut self, arrived: &[u8], now: Duration) {
        if !arrived.is_empty() {
            self.last = now;
        }
        self.heard.extend(arrived);
    }

    fn pending(&self) -> &[u8] {
        &self.says
    }

    fn sent(&mut self, count: usize) {
        self.says.drain(..count);
    }
}

const FAST: u32 = 100_000_000;
const BAUD: u32 = 921_600;
const SECOND: Duration = Duration::from_secs(1);

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
fn a_line_without_harm_passes_every_byte_in_its_order() {
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
    assert_eq!((line.to_device().harmed(), line.to_host().harmed()), (0, 0));
}

#[test]
fn a_delimiter_before_a_frame_belongs_to_it() {
    let mut line = fast(Faults::default());
    for _ in 0..10 {
        line.write(&[0, 5, 5, 0]).expect("plugged in");
    }
    assert_eq!(line.to_device().frames, 10);
}

#[test]
fn every_kind_of_harm_comes_as_often_as_its_rate() {
    const COUNT: u16 = 20_000;
    let none = Harm::default();
    for (rate, harm) in [
        (100, Harm { drop: 100, ..none }),
        (
            150,
            Harm {
                duplicate: 150,
                ..none
            },
        ),
        (
            50,
            Harm {
                corrupt: 50,
                ..none
            },
        ),
        (
            200,
            Harm {
                reorder: 200,
                ..none
            },
        ),
        (
            80,
            Harm {
                delay: 80,
                delay_by: SECOND,
                ..none
            },
        ),
        (120, Harm { cut: 120, ..none }),
    ] {
        let mut line = fast(Faults {
            to_device: harm,
            seed: 7,
            ..Faults::default()
        });
        let heard = sent(&mut line, COUNT);
        let tally = line.to_device();
        let kinds = [
            tally.dropped,
            tally.duplicated,
            tally.corrupted,
            tally.reordered,
            tally.delayed,
            tally.cut,
        ];
        let rates = [
            harm.drop,
            harm.duplicate,
            harm.corrupt,
            harm.reorder,
            harm.delay,
            harm.cut,
        ];
        let share = f64::from(rate) / 1_000.0;
        // Five standard deviations.
        let allowed = 5.0 * (share * (1.0 - share) * f64::from(COUNT)).sqrt();
        for (kind, rate) in kinds.iter().zip(rates) {
            let expected = f64::from(rate) / 1_000.0 * f64::from(COUNT);
            let off = (*kind as f64 - expected).abs();
            assert!(
                off <= if rate == 0 { 0.0 } else { allowed },
                "{harm:?} {tally:?}"
            );
        }
        assert_eq!(
            (tally.frames, tally.harmed()),
            (COUNT.into(), kinds.iter().sum())
        );

        // And what is counted has happened.
        let whole = pieces(&heard);
        let all = frames(COUNT);
        let all = pieces(&all);
        let count = u64::from(COUNT);
        let mut sorted = whole.clone();
        sorted.sort_unstable();
        let mut expected = all.clone();
        expected.sort_unstable();
        if tally.dropped > 0 {
            assert_eq!(whole.len() as u64, count - tally.dropped);
        } else if tally.duplicated > 0 {
            assert_eq!(whole.len() as u64, count + tally.duplicated);
            sorted.dedup();
            assert_eq!(sorted, expected);
        } else if tally.reordered + tally.delayed > 0 {
            assert_eq!(sorted, expected, "every frame, whole");
            assert_ne!(whole, all, "not in their order");
        } else if tally.cut > 0 {
            assert!(whole.len() as u64 >= count - tally.cut);
            assert!(heard.len() < all.concat().len());
        } else {
            assert_eq!(heard.len(), all.concat().len());
            let other = heard
                .chunks(6)
                .zip(&all)
                .filter(|(heard, sent)| heard != *sent);
            // Bytes of a frame only: the one that has changed.
            assert_eq!(other.count() as u64, tally.corrupted);
        }
    }
}

#[test]
fn frames_that_are_all_reordered_arrive_all_the_same() {
    let harm = Harm {
        reorder: 1_000,
        ..Harm::default()
    };
    let mut line = fast(Faults::both_ways(harm, 1));
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
    let harm = Harm {
        reorder: 300,
        ..Harm::default()
    };
    let mut line = fast(Faults::both_ways(harm, 3));
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
    let tally = line.to_device();
    // Where two frames in a row wait, the third passes both.
    let passed = places.windows(2).filter(|pair| pair[0] > pair[1]).count() as u64;
    assert!(
        passed > 150 && passed <= tally.reordered,
        "{passed} of {tally:?}"
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
    let harm = Harm {
        delay: 1_000,
        delay_by,
        ..Harm::default()
    };
    let mut line = fast(Faults::both_ways(harm, 1));
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
fn the_same_seed_harms_the_same_frames() {
    let run = |seed| {
        let mut line = fast(Faults::both_ways(Harm::evenly(400), seed));
        let heard = sent(&mut line, 500);
        (heard, line.to_device())
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn rates_that_are_shared_evenly_add_up() {
    for parts in [0, 4, 200, 201, 1_000] {
        let harm = Harm::evenly(parts);
        let sum = harm.drop + harm.duplicate + harm.corrupt + harm.reorder + harm.cut;
        assert_eq!(sum, parts);
    }
    let all = Harm {
        drop: u16::MAX,
        cut: u16::MAX,
        ..Harm::default()
    };
    let mut line = fast(Faults::both_ways(all, 1));
    assert!(sent(&mut line, 100).is_empty());
    assert_eq!(line.to_device().dropped, 100);
}

/// Bytes that the host has read of a device that never stops, by when.
fn read_until(line: &mut PacedLine<Notes>, end: Duration) -> u64 {
    let mut bytes = [0; 64];
    while line.elapsed() < end {
        let says = &mut line.far_end_mut().says;
        says.resize(10_000, 1);
        let wait = end - line.elapsed();
        line.read(&mut bytes, wait).expect("a line");
    }
    while line.read(&mut bytes, Duration::ZERO).expect("a line") > 0 {}
    line.bytes_to_host()
}

#[test]
fn a_byte_takes_ten_bits_of_time_to_the_host() {
    let mut line = PacedLine::new(Notes::default(), BAUD);
    line.far_end_mut().says.resize(10_000, 1);
    assert_eq!(
        read_until(&mut line, SECOND - Duration::from_nanos(1)),
        92_159
    );
    let mut line = PacedLine::new(Notes::default(), BAUD);
    line.far_end_mut().says.resize(10_000, 1);
    assert_eq!(read_until(&mut line, SECOND), 92_160);
    assert_eq!(read_until(&mut line, 3 * SECOND), 3 * 92_160);
}

#[test]
fn a_byte_takes_ten_bits_of_time_to_the_device() {
    for (baud, bytes) in [(BAUD, 92_160), (115_200, 11_520), (9_600, 960)] {
        let line = PacedLine::new(Notes::default(), baud);
        let mut line = line.with_turns_every(Duration::from_millis(1));
        line.write(&vec![1; bytes]).expect("a line");
        // The last 4,096 wait in a buffer.
        let buffered = bytes.min(4_096) as f64 / bytes as f64;
        let left = 1.0 - line.elapsed().as_secs_f64() - buffered;
        assert!(left.abs() < 1e-6, "{left} s");
        let before = SECOND - line.elapsed() - Duration::from_nanos(1);
        let nothing = line.read(&mut [0], before).expect("a line");
        assert_eq!((nothing, line.bytes_to_device() < bytes as u64), (0, true));
        line.read(&mut [0], Duration::ZERO).expect("a line");
        assert_eq!(line.bytes_to_device(), bytes as u64);
        assert_eq!(line.far_end().last, SECOND);
    }
}

#[test]
fn both_ways_are_carried_at_once() {
    let mut line = PacedLine::new(Notes::default(), BAUD);
    line.far_end_mut().says.resize(92_160, 1);
    let mut bytes = [0; 512];
    let mut unsent = 92_160;
    while line.elapsed() < SECOND {
        let count = unsent.min(100);
        line.write(&[2; 100][..count]).expect("a line");
        unsent -= count;
        line.read(&mut bytes, Duration::from_millis(1))
            .expect("a line");
    }
    let both = [line.bytes_to_device(), line.bytes_to_host()];
    assert!(both.iter().all(|count| *count > 92_000), "{both:?}");
}

#[test]
fn latency_delays_bytes_and_costs_no_rate() {
    let latency = Duration::from_millis(16);
    let mut line = PacedLine::new(Notes::default(), BAUD).with_latency(latency);
    line.far_end_mut().says.resize(10_000, 1);
    assert_eq!(read_until(&mut line, latency), 0);
    assert_eq!(read_until(&mut line, latency + SECOND), 92_160);
}

#[test]
fn a_read_of_nothing_takes_the_wait_and_no_time_of_ours() {
    let started = std::time::Instant::now();
    let mut line = PacedLine::new(Notes::default(), BAUD);
    let before = line.now();
    for _ in 0..10 {
        assert_eq!(line.read(&mut [0; 8], 10 * SECOND).expect("a line"), 0);
    }
    assert_eq!(line.now() - before, 100 * SECOND);
    assert!(started.elapsed() < 10 * SECOND);
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
