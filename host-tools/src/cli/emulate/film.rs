//! Film for an emulated board: frames that the table in use takes, whichever that is.
//!
//! A board passes frames unchanged that are not for its table. Where the film is this
//! program's own, it then takes the size and channels that a table in the board's flash is
//! for, as somebody would who plugs another player in.

use super::super::failure::Failure;
use super::screen::{BoardScreen, PictureKind};
use super::{format, playback_failure, scene};
use crate::device::frame_source::FrameFeed;
use crate::device::memory::BoardMemory;
use crate::device::playback::{Playback, PlaybackCounts};
use iltm_runtime::{
    frame_buffers::psram,
    image::{Table, content, unseal},
};
use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::{Duration, Instant};

/// Frames given last that are remembered: more than are on their way.
const REMEMBERED: usize = 8;

/// Frames that pass unchanged in a row before the film is changed.
const UNCHANGED: u32 = 4;

/// Longer than a board takes to follow.
const PAUSE: Duration = Duration::from_millis(400);

/// Frames played to a board.
pub(super) struct Film<'m> {
    memory: &'m BoardMemory,
    frames: FrameFeed,
    playback: Playback<'m>,
    /// Whether it becomes what a table takes.
    follows: bool,
    given: VecDeque<u64>,
    unchanged: u32,
    changed: Instant,
    /// The slot whose table it was made for last.
    slot: usize,
    before: PlaybackCounts,
}

impl<'m> Film<'m> {
    /// Announces the frames to the board.
    pub(super) fn new(
        memory: &'m BoardMemory,
        frames: FrameFeed,
        follows: bool,
    ) -> Result<Self, Failure> {
        let playback = Playback::new(memory, format(&frames)?);
        Ok(Self {
            memory,
            playback: playback.map_err(|error| playback_failure(&error))?,
            frames,
            follows,
            given: VecDeque::new(),
            unchanged: 0,
            changed: Instant::now(),
            slot: 1,
            before: PlaybackCounts::default(),
        })
    }

    /// Frames a second.
    pub(super) const fn rate(&self) -> f64 {
        self.frames.rate()
    }

    /// What became of all frames.
    pub(super) const fn counts(&self) -> PlaybackCounts {
        let (before, now) = (self.before, self.playback.counts());
        PlaybackCounts {
            given: before.given + now.given,
            refused: before.refused + now.refused,
            shown: before.shown + now.shown,
            torn: before.torn + now.torn,
        }
    }

    /// What its frames are now.
    pub(super) fn kind(&self) -> PictureKind {
        PictureKind {
            size: self.frames.size(),
            channels: self.frames.channels(),
            rate: self.frames.rate(),
        }
    }

    /// Gives the next frame and takes what the board shows.
    pub(super) fn turn(&mut self, screen: &mut BoardScreen) -> Result<(), Failure> {
        let kind = self.kind();
        let frame = self.frames.next_frame()?;
        if self.given.len() == REMEMBERED {
            self.given.pop_front();
        }
        self.given.push_back(hash(&frame.pixels));
        let (given, unchanged) = (&self.given, &mut self.unchanged);
        let mut taken = Ok(());
        let given_now = self.playback.give_with(&frame.pixels, &frame.light);
        let passed = given_now.and_then(|()| {
            self.playback.show(|_, pixels| {
                let same = given.contains(&hash(pixels));
                *unchanged = if same { *unchanged + 1 } else { 0 };
                if taken.is_ok() {
                    taken = screen.take(kind, &frame.pixels, pixels);
                }
            })
        });
        passed.map_err(|error| playback_failure(&error))?;
        taken?;
        if self.follows && self.unchanged >= UNCHANGED && self.changed.elapsed() >= PAUSE {
            self.unchanged = 0;
            self.changed = Instant::now();
            self.follow()?;
        }
        Ok(())
    }

    /// Goes on with frames for a table in the board's flash that cannot take these. With
    /// two such tables, for one and then for the other: which of them is in use is told
    /// by the one that compensates.
    fn follow(&mut self) -> Result<(), Failure> {
        for slot in [1 - self.slot, self.slot] {
            let place = if slot == 0 {
                psram::SLOT_A
            } else {
                psram::SLOT_B
            };
            let mut bytes = vec![0; place.len()];
            if self.memory.read(&place, &mut bytes).is_err() {
                continue;
            }
            let table = unseal(content(&bytes)).and_then(|(image, _)| Table::check(image));
            let Ok(table) = table else {
                continue;
            };
            let frames = scene(Some(&table), None, self.frames.rate())?;
            let kind = |frames: &FrameFeed| (frames.size(), frames.channels(), frames.neighbours());
            if kind(&frames) == kind(&self.frames) {
                continue;
            }
            // Larger than the board's frame memory: it says so itself when it is asked.
            let Ok(playback) = Playback::new(self.memory, format(&frames)?) else {
                continue;
            };
            self.before = self.counts();
            (self.frames, self.playback, self.slot) = (frames, playback, slot);
            self.given.clear();
            break;
        }
        Ok(())
    }
}

fn hash(pixels: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    pixels.hash(&mut hasher);
    hasher.finish()
}
