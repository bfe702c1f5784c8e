//! Tests of the paced line.

use super::*;
use crate::line_faults::PacedLine;
use iltm::device::Line;

const BAUD: u32 = 921_600;
const NANOSECOND: Duration = Duration::from_nanos(1);

/// Bytes that the host has read of a device that never stops, by when.
fn read_until(line: &mut PacedLine<Notes>, end: Duration) -> u64 {
    let mut bytes = [0; 64];
    while line.elapsed() < end {
        let says = &mut line.far_end_mut().says;
        says.resize(10_000, 1);
        let wait = end.saturating_sub(line.elapsed());
        line.read(&mut bytes, wait).expect("a line");
    }
    line.bytes_to_host()
}

#[test]
fn a_byte_takes_ten_bits_of_time_to_the_host() {
    let mut line = PacedLine::new(Notes::default(), BAUD);
    line.far_end_mut().says.resize(10_000, 1);
    assert_eq!(
        read_until(&mut line, SECOND.saturating_sub(NANOSECOND)),
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
        let before = SECOND.saturating_sub(line.elapsed() + NANOSECOND);
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
