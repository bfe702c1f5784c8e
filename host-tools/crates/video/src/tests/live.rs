//! Tables replaced while a stream runs, and tiers that follow a budget.

use super::*;
use crate::Input;
use crate::live::{Live, LiveEvent, LiveSummary};
use crate::watch::FileWatch;
use crate::y4m::Header;
use iltm_picture::progress::Silent;
use iltm_runtime::placement::ProjectorPixels;
use std::collections::VecDeque;
use std::time::Duration;

const LINE: &str = "YUV4MPEG2 W63 H41 C420jpeg";

/// Frames of random bytes.
pub(super) fn stream(line: &str, frames: usize) -> Vec<u8> {
    let bytes = Header::parse(line.as_bytes()).unwrap().frame_bytes();
    let mut random = fastrand::Rng::with_seed(5);
    let mut stream = format!("{line}\n").into_bytes();
    for _ in 0..frames {
        stream.extend(b"FRAME\n");
        stream.extend((0..bytes).map(|_| random.u8(..)));
    }
    stream
}

/// The frames of a stream, each with its header.
fn frames<'s>(line: &str, stream: &'s [u8]) -> Vec<&'s [u8]> {
    let bytes = Header::parse(line.as_bytes()).unwrap().frame_bytes() + b"FRAME\n".len();
    stream[line.len() + 1..].chunks_exact(bytes).collect()
}

/// A stream through a table at a fixed tier.
fn fixed(image: &[u8], tier: Option<u8>, input: &[u8]) -> Vec<u8> {
    let table = Table::check(image).unwrap();
    let settings = CompensateOptions {
        tier,
        ..settings(Encoding::Display)
    };
    let mut output = Vec::new();
    let compensator = Compensator::new(&table, settings).unwrap();
    compensator.y4m(input, &mut output, &Silent).unwrap();
    output
}

/// A stream live: `newer` are the times, in frames asked for, at which new bytes are
/// there. The events as words.
fn live(
    image: &[u8],
    budget: Option<Duration>,
    newer: &[(usize, &[u8])],
    input: &[u8],
) -> (Vec<u8>, LiveSummary, Vec<LiveEvent>) {
    let mut waiting: VecDeque<_> = newer.iter().copied().collect();
    let (mut asked, mut events) = (0, Vec::new());
    let mut events_of = |event: &LiveEvent| {
        // Events carry errors, which cannot be cloned: the fields that tests look at.
        events.push(match event {
            LiveEvent::Tier { frame, change } => LiveEvent::Tier {
                frame: *frame,
                change: *change,
            },
            LiveEvent::Table { frame, id } => LiveEvent::Table {
                frame: *frame,
                id: *id,
            },
            LiveEvent::Refused { frame, .. } => LiveEvent::Refused {
                frame: *frame,
                why: VideoError::Still.into(),
            },
        });
    };
    let mut output = Vec::new();
    let table = Table::check(image).unwrap();
    let compensator = Compensator::new(&table, settings(Encoding::Display)).unwrap();
    let live = Live {
        budget,
        newer: &mut || {
            asked += 1;
            let due = waiting.front().is_some_and(|(time, _)| *time < asked);
            due.then(|| waiting.pop_front().unwrap().1.to_vec())
        },
        said: &mut events_of,
    };
    let input = Input::of(input).unwrap();
    let summary = compensator.live(live, input, &mut output, &Silent);
    (output, summary.unwrap(), events)
}

fn tables() -> [Vec<u8>; 2] {
    [1, 2].map(|seed| MadeUp::of_all_kinds(grid(13, 21), 3, 5, seed).image())
}

#[test]
fn a_new_table_takes_over_between_two_frames_and_no_frame_is_torn() {
    let [first, second] = tables();
    let input = stream(LINE, 20);
    let (old, new) = (fixed(&first, None, &input), fixed(&second, None, &input));
    for at in [0, 1, 7, 19] {
        let (output, summary, events) = live(&first, None, &[(at, &second)], &input);
        let output = frames(LINE, &output);
        for (number, frame) in output.iter().enumerate() {
            let expected = if number < at { &old } else { &new };
            assert!(
                *frame == frames(LINE, expected)[number],
                "{at}: frame {number}"
            );
        }
        assert_eq!(
            (output.len(), summary.frames.frames, summary.tables),
            (20, 20, 1)
        );
        assert!(matches!(events[..], [LiveEvent::Table { frame, .. }] if frame == at as u64));
    }
}

#[test]
fn a_new_table_of_another_grid_and_of_one_channel_takes_over_too() {
    let [first, _] = tables();
    let second = MadeUp::of_all_kinds(grid(4, 6), 1, 3, 9).image();
    let input = stream(LINE, 6);
    // The frame that a table takes over at is asked for twice, before and after.
    let (output, _, _) = live(&first, None, &[(3, &second), (5, &first)], &input);
    let (one, other) = (fixed(&first, None, &input), fixed(&second, None, &input));
    let (output, one, other) = (
        frames(LINE, &output),
        frames(LINE, &one),
        frames(LINE, &other),
    );
    assert!(output[..3] == one[..3] && output[3] == other[3] && output[4..] == one[4..]);
}

#[test]
fn what_is_no_table_or_does_not_suit_the_stream_keeps_the_old_one() {
    let [first, second] = tables();
    let input = stream(LINE, 8);
    let mut damaged = second.clone();
    damaged[200] ^= 1;
    // More cells than the frames have pixels along a side.
    let large = MadeUp::new(grid(50, 70), 3).image();
    let bad: [&[u8]; 4] = [&damaged, &second[..100], b"", &large];
    let newer: Vec<(usize, &[u8])> = (1..).zip(bad).collect();
    let (output, summary, events) = live(&first, None, &newer, &input);
    assert_eq!(output, fixed(&first, None, &input));
    assert_eq!((summary.tables, summary.refused), (0, 4));
    assert!(
        events
            .iter()
            .all(|event| matches!(event, LiveEvent::Refused { .. }))
    );
    // One that is refused is no hindrance for a later one.
    let (output, summary, _) = live(&first, None, &[(1, &damaged), (2, &second)], &input);
    assert_eq!((summary.tables, summary.refused), (1, 1));
    assert_eq!(
        frames(LINE, &output)[7],
        frames(LINE, &fixed(&second, None, &input))[7]
    );
}

#[test]
fn a_newer_table_may_have_another_border_but_not_move_the_frames() {
    let bordered = |border| {
        let mut table = MadeUp::of_all_kinds(grid(13, 21), 3, 5, 1);
        table.projector = ProjectorPixels::new(size(126, 82), border);
        table.image()
    };
    let [first, second] = [4, 8].map(bordered);
    let input = stream(LINE, 3);
    let (output, summary, _) = live(&first, None, &[(1, &second)], &input);
    assert_eq!((summary.tables, summary.refused), (1, 0));
    let old = fixed(&first, None, &input);
    let new = fixed(&second, None, &input);
    let [output, old, new] = [&output, &old, &new].map(|stream| frames(LINE, stream));
    assert!(output[0] == old[0] && output[2] == new[2] && old[2] != new[2]);
    // A stream of the size inside the border is put there, which another border would not do.
    let line = "YUV4MPEG2 W118 H74 C420jpeg";
    let (_, summary, _) = live(&first, None, &[(1, &second)], &stream(line, 3));
    assert_eq!((summary.tables, summary.refused), (0, 1));
}

#[test]
fn a_colour_table_for_a_grey_stream_is_refused_while_it_runs() {
    let line = "YUV4MPEG2 W63 H41 Cmono";
    let grey = MadeUp::of_all_kinds(grid(13, 21), 1, 5, 1).image();
    let [colour, _] = tables();
    let input = stream(line, 3);
    let (output, summary, _) = live(&grey, None, &[(1, &colour)], &input);
    assert_eq!((output, summary.refused), (fixed(&grey, None, &input), 1));
}

#[test]
fn a_budget_too_small_stays_at_gain_only_and_says_how_often_it_was_over() {
    let [image, _] = tables();
    let input = stream(LINE, 40);
    let (output, summary, events) = live(&image, Some(Duration::from_micros(1)), &[], &input);
    assert_eq!(output, fixed(&image, Some(0), &input));
    assert_eq!((summary.tiers, summary.overruns), (vec![40], 40));
    assert!(events.is_empty());
}

#[test]
fn a_large_budget_climbs_to_the_top_tier_and_every_frame_is_its_tier_s() {
    let [image, _] = tables();
    let input = stream(LINE, 60);
    let (output, summary, events) = live(&image, Some(Duration::from_mins(1)), &[], &input);
    assert_eq!(summary.overruns, 0);
    assert_eq!(summary.tiers.len(), 3);
    assert_eq!(summary.tiers.iter().sum::<u64>(), 60);
    assert_eq!(events.len(), 2, "{events:?}");
    let of_tier = [0, 1, 2].map(|tier| fixed(&image, Some(tier), &input));
    let mut tier = 0;
    let mut changes = events.iter().peekable();
    for (number, frame) in frames(LINE, &output).iter().enumerate() {
        if let Some(LiveEvent::Tier { frame, change }) = changes.peek()
            && *frame == number as u64
        {
            tier = usize::from(change.to);
            changes.next();
        }
        assert!(
            *frame == frames(LINE, &of_tier[tier])[number],
            "frame {number}"
        );
    }
    assert_eq!(tier, 2);
}

#[test]
fn a_file_is_read_again_once_it_is_replaced_or_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iltm");
    std::fs::write(&path, b"one").unwrap();
    let (first, watch) = FileWatch::read(&path, 100).unwrap();
    assert_eq!(first, b"one");
    let wait = |expected: &[u8]| {
        for _ in 0..3_000 {
            if let Some(bytes) = watch.newer() {
                assert_eq!(bytes, expected);
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("never read again");
    };
    let beside = folder.path().join("beside");
    std::fs::write(&beside, b"another").unwrap();
    std::fs::rename(&beside, &path).unwrap();
    wait(b"another");
    std::fs::write(&path, b"the third").unwrap();
    wait(b"the third");
    // Gone for a while, as when somebody copies by hand.
    std::fs::remove_file(&path).unwrap();
    std::fs::write(&path, b"back").unwrap();
    wait(b"back");
    assert_eq!(watch.newer(), None);
}
