//! Both sides of a frame memory against each other.

use super::layout::{BUFFERS, CONTROL_WORDS, descriptor, word};
use super::{
    AttachError, Broken, ControlWords, Display, Format, Layout, NativeWords, Presenter, Receiver,
    Source,
};
use crate::pipeline::Encoding;
use crate::{FrameSize, Grid};
use core::ops::Range;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use proptest::prelude::*;
use std::vec::Vec;

fn format(width: u16, height: u16) -> Format {
    let size = FrameSize::new(width, height).expect("not empty");
    Format::new(size, 3, Encoding::Display, 16_667).expect("three channels")
}

fn words() -> Vec<AtomicU32> {
    (0..CONTROL_WORDS).map(|_| AtomicU32::new(0)).collect()
}

const REGION: usize = 1 << 16;

/// A source that announced frames and a device that takes them.
fn pair(memory: &[AtomicU32]) -> (Source<NativeWords<'_>>, Receiver<NativeWords<'_>>) {
    let words = NativeWords(memory);
    let source = Source::announce(words, REGION, format(4, 3)).expect("it fits");
    let receiver = Receiver::attach(words, REGION).expect("announced");
    (source, receiver)
}

#[test]
fn a_device_reads_the_format_that_the_source_announced() {
    let memory = words();
    let (source, receiver) = pair(&memory);
    assert_eq!(receiver.format(), format(4, 3));
    assert!(source.attached());
    assert!(receiver.is_current());
}

#[test]
fn memory_without_a_source_is_no_source() {
    let memory = words();
    let refused = Receiver::attach(NativeWords(&memory), REGION).expect_err("all zero");
    assert_eq!(refused, AttachError::NoSource);
}

#[test]
fn buffers_never_overlap_and_stay_in_the_region() {
    for (width, height) in [(1, 1), (21, 13), (33, 7), (100, 40)] {
        let layout = Layout::new(format(width, height), REGION).expect("it fits");
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for buffer in 0..BUFFERS {
            ranges.extend([layout.input(buffer), layout.output(buffer)]);
        }
        ranges.sort_by_key(|range| range.start);
        assert!(ranges[0].start >= CONTROL_WORDS * 4);
        assert!(ranges[3].end <= REGION);
        for pair in ranges.windows(2) {
            assert!(pair[0].end <= pair[1].start);
        }
    }
    let huge = format(u16::MAX, u16::MAX);
    let refused = Layout::new(huge, REGION).expect_err("12 GB in 64 KiB");
    assert_eq!(refused.given, REGION);
}

#[test]
fn the_neighbours_light_lies_behind_the_pixels_and_may_be_missing() {
    let memory = words();
    let words = NativeWords(&memory);
    let grid = Grid::new(2, 5).expect("small");
    // 45 bytes of pixels, so that there is a gap before the light.
    let format = format(5, 3).with_neighbours(Some(grid));
    assert_eq!((format.bytes(), format.light_bytes()), (45, 60));
    let mut source = Source::announce(words, REGION, format).expect("it fits");
    let mut receiver = Receiver::attach(words, REGION).expect("announced");
    assert_eq!(receiver.format(), format);
    let layout = receiver.layout();
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for buffer in 0..BUFFERS {
        let (pixels, light) = (layout.input(buffer), layout.light(buffer));
        assert_eq!((pixels.len(), light.len()), (45, 60));
        assert!(light.start.is_multiple_of(4));
        ranges.extend([pixels, light, layout.output(buffer)]);
    }
    ranges.sort_by_key(|range| range.start);
    assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start));
    for with_light in [true, false, true] {
        let filling = source.begin().expect("room");
        let place = source.light(&filling);
        source.finish(filling, with_light);
        let claim = receiver.claim().expect("a frame");
        assert_eq!(receiver.light(&claim), with_light.then_some(place));
        receiver.release(claim).expect("nobody touched it");
    }
    // Neither the pixels alone nor all of the light.
    let filling = source.begin().expect("room");
    let buffer = (0..BUFFERS)
        .find(|buffer| layout.input(*buffer) == source.pixels(&filling))
        .expect("one of them");
    source.finish(filling, true);
    words.store(descriptor::input(buffer) + descriptor::LENGTH, 104);
    assert!(receiver.claim().is_none());
    let broken = receiver.counts().last_broken.map(|(_, broken)| broken);
    assert_eq!(broken, Some(Broken::Short));
}

#[test]
fn a_source_without_room_drops_frames_and_the_device_counts_them() {
    let memory = words();
    let (mut source, mut receiver) = pair(&memory);
    for _ in 0..5 {
        if let Some(filling) = source.begin() {
            source.finish(filling, false);
        }
    }
    let first = receiver.claim().expect("the first frame");
    assert_eq!(first.sequence(), 1);
    assert!(
        receiver
            .claim()
            .is_some_and(|second| second.sequence() == 2)
    );
    receiver.release(first).expect("whole");
    let sixth = source.begin().expect("a buffer is free again");
    source.finish(sixth, false);
    assert!(receiver.claim().is_some_and(|sixth| sixth.sequence() == 6));
    assert_eq!(receiver.counts().dropped, 3);
    assert_eq!(receiver.counts().received, 3);
}

#[test]
fn torn_short_and_stale_frames_are_refused_and_counted_once() {
    let memory = words();
    let (mut source, mut receiver) = pair(&memory);
    let break_next = |source: &mut Source<NativeWords<'_>>, field: usize, value: u32| {
        let filling = source.begin().expect("room");
        source.finish(filling, false);
        // Both buffers are free, so it is the first.
        memory[descriptor::input(0) + field].store(value, Ordering::Relaxed);
    };
    let good = source.begin().expect("room");
    source.finish(good, false);
    let claim = receiver.claim().expect("a good frame");
    receiver.release(claim).expect("whole");
    break_next(&mut source, descriptor::END, 77);
    assert!(receiver.claim().is_none());
    break_next(&mut source, descriptor::LENGTH, 35);
    assert!(receiver.claim().is_none());
    // Frame 4 says that it is frame 1 again.
    let stale = source.begin().expect("room");
    source.finish(stale, false);
    for at in [descriptor::START, descriptor::END] {
        memory[descriptor::input(0) + at].store(1, Ordering::Relaxed);
    }
    assert!(receiver.claim().is_none());
    let good = source.begin().expect("room");
    source.finish(good, false);
    assert!(receiver.claim().is_some_and(|claim| claim.sequence() == 5));
    let counts = receiver.counts();
    assert_eq!((counts.received, counts.broken), (2, 3));
    assert_eq!(counts.last_broken, Some((1, Broken::Stale)));
    // The stale frame's own number never came.
    assert_eq!(counts.dropped, 1);
}

#[test]
fn a_frame_written_to_while_it_is_worked_on_is_torn() {
    for field in [descriptor::START, descriptor::END, descriptor::OWNER] {
        let memory = words();
        let (mut source, mut receiver) = pair(&memory);
        let filling = source.begin().expect("room");
        source.finish(filling, false);
        let claim = receiver.claim().expect("whole so far");
        memory[descriptor::input(0) + field].store(9, Ordering::Relaxed);
        assert_eq!(receiver.release(claim), Err(Broken::Torn));
        assert_eq!(receiver.counts().broken, 1);
    }
}

#[test]
fn a_new_announcement_ends_the_old_one() {
    let memory = words();
    let (mut source, mut receiver) = pair(&memory);
    let filling = source.begin().expect("room");
    source.finish(filling, false);
    let claim = receiver.claim().expect("a frame");
    let mut next = Source::announce(NativeWords(&memory), REGION, format(5, 5)).expect("it fits");
    assert!(!receiver.is_current());
    assert!(next.begin().is_none(), "the device has not followed yet");
    assert_eq!(receiver.release(claim), Err(Broken::Superseded));
    let receiver = Receiver::attach(NativeWords(&memory), REGION).expect("announced");
    assert_eq!(receiver.format(), format(5, 5));
    assert!(next.begin().is_some());
}

#[test]
fn a_restarted_device_leaves_the_display_what_it_shows() {
    let memory = words();
    let (_source, receiver) = pair(&memory);
    let layout = receiver.layout();
    let presenter = Presenter::new(NativeWords(&memory), layout);
    let buffer = presenter.free().expect("both are");
    presenter.begin(buffer, 1);
    presenter.publish(buffer, 1);
    let mut display = Display::new(NativeWords(&memory), layout);
    let shown = display.advance().expect("published");
    let _restarted = Receiver::attach(NativeWords(&memory), REGION).expect("announced");
    let presenter = Presenter::new(NativeWords(&memory), layout);
    assert_eq!(presenter.free(), Some(1 - buffer));
    assert!(display.is_whole(&shown));
}

#[test]
fn an_output_that_changes_while_it_is_shown_is_not_whole() {
    let memory = words();
    let (_source, receiver) = pair(&memory);
    let presenter = Presenter::new(NativeWords(&memory), receiver.layout());
    let mut display = Display::new(NativeWords(&memory), receiver.layout());
    let buffer = presenter.free().expect("both are");
    presenter.begin(buffer, 7);
    presenter.publish(buffer, 7);
    let shown = display.advance().expect("published");
    for field in [descriptor::START, descriptor::END, descriptor::LENGTH] {
        assert!(display.is_whole(&shown));
        let word = &memory[descriptor::output(buffer) + field];
        let before = word.fetch_add(1, Ordering::SeqCst);
        assert!(!display.is_whole(&shown), "field {field}");
        word.store(before, Ordering::SeqCst);
    }
}

#[test]
fn the_display_shows_outputs_in_order_and_keeps_the_last() {
    let memory = words();
    let (_source, receiver) = pair(&memory);
    let presenter = Presenter::new(NativeWords(&memory), receiver.layout());
    let mut display = Display::new(NativeWords(&memory), receiver.layout());
    // Across the wrap of the numbers.
    let first = u32::MAX - 2;
    for sequence in (0..6).map(|n| first.wrapping_add(n)) {
        let buffer = presenter.free().expect("the display holds one at most");
        presenter.begin(buffer, sequence);
        presenter.publish(buffer, sequence);
        let shown = display.advance().expect("it was published");
        assert_eq!(shown.sequence(), sequence);
        assert!(display.is_whole(&shown));
        assert_eq!(display.advance(), None);
        assert_eq!(display.shown(), Some(shown));
    }
}

/// One step of one of the parties.
#[derive(Clone, Copy, Debug)]
enum Step {
    Begin,
    Finish,
    Claim,
    Release,
    Show,
    /// The source writes a frame without looking at the owner.
    Trample(usize),
    /// A word takes any value.
    Corrupt(usize, u32),
}

fn steps(honest: bool) -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        4 => Just(Step::Begin),
        4 => Just(Step::Finish),
        4 => Just(Step::Claim),
        4 => Just(Step::Release),
        4 => Just(Step::Show),
        u32::from(!honest) => (0..BUFFERS).prop_map(Step::Trample),
        u32::from(!honest) => (16..32_usize, 0..6_u32).prop_map(|(at, value)| Step::Corrupt(at, value)),
    ];
    prop::collection::vec(step, 0..200)
}

/// Plays steps with one number for all pixels of a buffer: that of the frame
/// last written to it. Returns the frames that were shown, with what their
/// pixels were at that time.
fn play(steps: &[Step]) -> Vec<(u32, Option<u32>)> {
    let memory = words();
    let (mut source, mut receiver) = pair(&memory);
    let presenter = Presenter::new(NativeWords(&memory), receiver.layout());
    let mut display = Display::new(NativeWords(&memory), receiver.layout());
    // `None` is a frame that is being written.
    let mut inputs = [None; BUFFERS];
    let mut outputs = [None; BUFFERS];
    let (mut filling, mut working) = (None, None);
    let mut shown = Vec::new();
    let layout = receiver.layout();
    let at = |range: &Range<usize>| {
        (0..BUFFERS)
            .find(|b| layout.input(*b) == *range || layout.output(*b) == *range)
            .expect("a buffer of the layout")
    };
    for step in steps {
        match *step {
            Step::Begin if filling.is_none() => {
                filling = source.begin();
                if let Some(filling) = &filling {
                    inputs[at(&source.pixels(filling))] = None;
                }
            }
            Step::Finish => {
                if let Some(filling) = filling.take() {
                    inputs[at(&source.pixels(&filling))] = Some(filling.sequence());
                    source.finish(filling, false);
                }
            }
            Step::Claim if working.is_none() => {
                working = presenter.free().and_then(|output| {
                    let claim = receiver.claim()?;
                    presenter.begin(output, claim.sequence());
                    let pixels = inputs[at(&receiver.pixels(&claim))];
                    Some((claim, output, pixels))
                });
                if let Some((_, output, _)) = &working {
                    outputs[*output] = None;
                }
            }
            Step::Release => {
                if let Some((claim, output, before)) = working.take() {
                    let sequence = claim.sequence();
                    let after = inputs[at(&receiver.pixels(&claim))];
                    if receiver.release(claim).is_ok() {
                        outputs[output] = before.filter(|_| before == after);
                        presenter.publish(output, sequence);
                    }
                }
            }
            Step::Show => {
                if let Some(next) = display.advance() {
                    shown.push((next.sequence(), outputs[at(&display.pixels(&next))]));
                }
            }
            Step::Trample(buffer) => {
                // A DMA engine that runs away: another frame begins in whatever
                // buffer.
                let start = descriptor::input(buffer) + descriptor::START;
                memory[start].fetch_add(1_000, Ordering::Relaxed);
                inputs[buffer] = None;
            }
            Step::Corrupt(at, value) => memory[at].store(value, Ordering::Relaxed),
            Step::Begin | Step::Claim => {}
        }
    }
    shown
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn every_frame_shown_is_whole_and_newer_than_the_last(steps in steps(true)) {
        let shown = play(&steps);
        for (sequence, pixels) in &shown {
            prop_assert_eq!(Some(*sequence), *pixels);
        }
        for pair in shown.windows(2) {
            prop_assert!(pair[0].0 < pair[1].0);
        }
    }

    #[test]
    fn a_source_that_tramples_over_buffers_never_gets_a_mixed_frame_shown(
        steps in steps(false).prop_map(|steps| {
            steps.into_iter().filter(|step| !matches!(step, Step::Corrupt(..))).collect::<Vec<_>>()
        })
    ) {
        for (sequence, pixels) in play(&steps) {
            prop_assert_eq!(Some(sequence), pixels);
        }
    }

    #[test]
    fn words_of_any_value_do_no_harm(steps in steps(false)) {
        play(&steps);
    }

    #[test]
    fn a_header_of_any_value_gives_buffers_inside_the_region(
        header in prop::collection::vec(any::<u32>(), 5), small in any::<bool>(), region in 0..REGION
    ) {
        let memory = words();
        for (word, value) in memory.iter().zip(&header) {
            // Sizes that may fit come rarely by chance.
            let value = if small { *value & 0x001f_001f } else { *value };
            word.store(value, Ordering::Relaxed);
        }
        let words = NativeWords(&memory);
        words.store(word::MAGIC, super::layout::MAGIC);
        words.store(word::VERSION, super::layout::VERSION);
        if let Ok(receiver) = Receiver::attach(words, region) {
            for buffer in 0..BUFFERS {
                prop_assert!(receiver.layout().output(buffer).end <= region);
                prop_assert_eq!(receiver.layout().input(buffer).len(), receiver.format().bytes());
            }
        }
    }
}

/// Source, device and display on threads of their own, with real pixels. Every
/// pixel of every frame shown must be the device's work on the frame of that
/// number.
#[test]
fn three_threads_never_mix_two_frames() {
    const FRAMES: u32 = 20_000;
    let memory = words();
    let pixels: Vec<AtomicU8> = (0..REGION).map(|_| AtomicU8::new(0)).collect();
    let pixels = pixels.as_slice();
    let wanted = |sequence: u32, at: usize| (sequence as usize * 31 + at * 7) as u8;
    let (mut source, mut receiver) = pair(&memory);
    let presenter = Presenter::new(NativeWords(&memory), receiver.layout());
    let mut display = Display::new(NativeWords(&memory), receiver.layout());
    let done = AtomicBool::new(false);
    let done = &done;
    let (received, shown) = std::thread::scope(|scope| {
        scope.spawn(move || {
            for _ in 0..FRAMES {
                while !source.has_room() {
                    std::thread::yield_now();
                }
                let filling = source.begin().expect("there is room");
                for (at, pixel) in pixels[source.pixels(&filling)].iter().enumerate() {
                    pixel.store(wanted(filling.sequence(), at), Ordering::Relaxed);
                }
                source.finish(filling, false);
            }
        });
        let device = scope.spawn(move || {
            let mut last = 0;
            while last < FRAMES {
                let both = presenter
                    .free()
                    .and_then(|output| Some((output, receiver.claim()?)));
                let Some((output, claim)) = both else {
                    std::thread::yield_now();
                    continue;
                };
                last = claim.sequence();
                let to = presenter.begin(output, last);
                let from = receiver.pixels(&claim);
                for (from, to) in pixels[from].iter().zip(&pixels[to]) {
                    to.store(!from.load(Ordering::Relaxed), Ordering::Relaxed);
                }
                receiver.release(claim).expect("an honest source");
                presenter.publish(output, last);
            }
            done.store(true, Ordering::Release);
            receiver.counts()
        });
        let viewer = scope.spawn(move || {
            let mut frames = 0_u32;
            loop {
                let over = done.load(Ordering::Acquire);
                let Some(shown) = display.advance() else {
                    if over {
                        return frames;
                    }
                    std::thread::yield_now();
                    continue;
                };
                let range = display.pixels(&shown);
                for (at, pixel) in pixels[range].iter().enumerate() {
                    let expected = !wanted(shown.sequence(), at);
                    assert_eq!(pixel.load(Ordering::Relaxed), expected);
                }
                assert!(display.is_whole(&shown));
                frames += 1;
            }
        });
        (
            device.join().expect("the device's thread"),
            viewer.join().expect("the display's thread"),
        )
    });
    assert_eq!(received.received, FRAMES);
    assert_eq!((received.broken, received.dropped), (0, 0));
    assert_eq!(shown, FRAMES, "the device waits for the display");
}
