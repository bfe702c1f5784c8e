//! Playback to an emulated board, both ends of its projector cable: frames in, as a capture
//! port's DMA would bring them, and projector input out, as a display would fetch
//! it.

use super::memory::{BoardMemory, FileWords};
use iltm_runtime::frame_buffers::{Display, Format, Layout, RegionError, Shown, Source, psram};
use iltm_runtime::units::Halfword;
use std::io;
use std::ops::Range;

/// Why frames cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum PlaybackError {
    /// The board's memory cannot be used.
    #[error("the board's memory: {0}")]
    Memory(#[from] io::Error),
    /// The frames are larger than the board's frame memory.
    #[error("{0}")]
    Region(#[from] RegionError),
}

/// Plays frames to a board and takes what it shows.
#[derive(Debug)]
pub struct Playback<'m> {
    memory: &'m BoardMemory,
    layout: Layout,
    source: Source<FileWords>,
    /// Once the board has taken the announcement.
    display: Option<Display<FileWords>>,
    counts: PlaybackCounts,
}

/// What became of the frames, as seen from outside.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PlaybackCounts {
    /// Given to the board.
    pub given: u64,
    /// That the board had no buffer for.
    pub refused: u64,
    /// Shown by the board.
    pub shown: u64,
    /// Shown, but written over meanwhile or incomplete.
    pub torn: u64,
}

impl<'m> Playback<'m> {
    /// Announces frames of this format.
    ///
    /// # Errors
    /// [`PlaybackError`].
    pub fn new(memory: &'m BoardMemory, format: Format) -> Result<Self, PlaybackError> {
        let region = psram::FRAMES.len();
        Ok(Self {
            memory,
            layout: Layout::new(format, region)?,
            source: Source::announce(memory.words()?, region, format)?,
            display: None,
            counts: PlaybackCounts::default(),
        })
    }

    /// Whether the board has taken the announcement.
    pub fn attached(&mut self) -> bool {
        self.display.is_some() || self.source.attached()
    }

    /// Gives the board a frame without any light of its neighbours, or lets it drop where the board
    /// has no buffer for it, as a cable would.
    ///
    /// # Errors
    /// [`PlaybackError::Memory`].
    pub fn give(&mut self, frame: &[u8]) -> Result<(), PlaybackError> {
        self.give_with(frame, &[])
    }

    /// The same with the light of the neighbours' cells, if the format has that and it is there.
    ///
    /// # Errors
    /// [`PlaybackError::Memory`].
    pub fn give_with(&mut self, frame: &[u8], light: &[Halfword]) -> Result<(), PlaybackError> {
        match self.source.begin() {
            Some(filling) => {
                let place = within_memory(&self.source.pixels(&filling));
                self.memory.write(&place, frame)?;
                let place = within_memory(&self.source.light(&filling));
                self.memory.write(&place, light.as_flattened())?;
                self.source.finish(filling, !light.is_empty());
                self.counts.given += 1;
            }
            None => self.counts.refused += 1,
        }
        Ok(())
    }

    /// Takes everything that the board has ready to be shown; `see` gets number
    /// and pixels of every whole frame.
    ///
    /// # Errors
    /// [`PlaybackError::Memory`].
    pub fn show(&mut self, mut see: impl FnMut(Shown, &[u8])) -> Result<(), PlaybackError> {
        if self.display.is_none() && self.source.attached() {
            self.display = Some(Display::new(self.memory.words()?, self.layout));
        }
        let Some(display) = &mut self.display else {
            return Ok(());
        };
        while let Some(shown) = display.advance() {
            let mut pixels = vec![0; self.layout.frame_bytes()];
            let place = within_memory(&display.pixels(&shown));
            self.memory.read(&place, &mut pixels)?;
            if display.is_whole(&shown) {
                self.counts.shown += 1;
                see(shown, &pixels);
            } else {
                self.counts.torn += 1;
            }
        }
        Ok(())
    }

    /// What became of the frames so far.
    #[must_use]
    pub const fn counts(&self) -> PlaybackCounts {
        self.counts
    }
}

/// A range of the frame memory as one of the whole memory.
const fn within_memory(range: &Range<usize>) -> Range<usize> {
    psram::FRAMES.start + range.start..psram::FRAMES.start + range.end
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::{
        FrameSize,
        frame_buffers::{Presenter, Receiver},
        pipeline::Encoding,
    };

    #[test]
    fn frames_go_through_the_file_to_a_board_and_back() {
        let memory = BoardMemory::temporary().expect("a temporary file");
        let size = FrameSize::new(4, 2).expect("small");
        let format = Format::new(size, 1, Encoding::Display, 40_000).expect("a format");
        let mut playback = Playback::new(&memory, format).expect("it fits");
        playback.give(&[9; 8]).expect("readable");
        assert_eq!(playback.counts().refused, 1, "nobody is there yet");

        let words = memory.words().expect("the same file");
        let region = psram::FRAMES.len();
        let mut receiver = Receiver::attach(&words, region).expect("announced");
        let presenter = Presenter::new(&words, receiver.layout());
        assert!(playback.attached());
        for number in 1..=5_u8 {
            playback.give(&[number; 8]).expect("readable");
            let claim = receiver.claim().expect("a frame");
            let sequence = claim.sequence();
            let mut pixels = [0; 8];
            let place = within_memory(&receiver.pixels(&claim));
            memory.read(&place, &mut pixels).expect("readable");
            receiver.release(claim).expect("nobody touched it");
            let buffer = presenter.free().expect("the display keeps one at most");
            let place = presenter.begin(buffer, sequence);
            memory
                .write(&within_memory(&place), &pixels.map(|code| code + 100))
                .expect("room");
            presenter.publish(buffer, sequence);
            let mut seen = Vec::new();
            playback
                .show(|shown, pixels| seen.push((shown.sequence(), pixels.to_vec())))
                .expect("readable");
            assert_eq!(seen, [(sequence, vec![number + 100; 8])]);
        }
        let counts = playback.counts();
        assert_eq!((counts.given, counts.shown, counts.torn), (5, 5, 0));
    }
}
