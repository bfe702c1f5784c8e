//! Output buffers: projector input on its way to the display.

use super::layout::{BUFFERS, descriptor, owner};
use super::{ControlWords, Layout};
use core::ops::Range;
use core::sync::atomic::{Ordering, fence};

/// The device's side of the output buffers.
#[derive(Debug)]
pub struct Presenter<W> {
    words: W,
    layout: Layout,
}

impl<W: ControlWords> Presenter<W> {
    /// For the outputs of the memory that a [`Receiver`](super::Receiver) is
    /// attached to.
    pub const fn new(words: W, layout: Layout) -> Self {
        Self { words, layout }
    }

    /// A buffer that the device may write; `None` while the display has both.
    pub fn free(&self) -> Option<usize> {
        (0..BUFFERS).find(|buffer| {
            let at = descriptor::output(*buffer);
            self.words.load(at + descriptor::OWNER) == owner::DEVICE
        })
    }

    /// Where the pixels of a buffer go. Call before the first pixel is written.
    pub fn begin(&self, buffer: usize, sequence: u32) -> Range<usize> {
        let at = descriptor::output(buffer % BUFFERS);
        self.words.store(at + descriptor::START, sequence);
        fence(Ordering::SeqCst);
        self.layout.output(buffer)
    }

    /// Hands a whole frame to the display.
    pub fn publish(&self, buffer: usize, sequence: u32) {
        let at = descriptor::output(buffer % BUFFERS);
        let length = self.layout.frame_bytes() as u32;
        self.words.store(at + descriptor::LENGTH, length);
        self.words.store(at + descriptor::END, sequence);
        self.words.store(at + descriptor::OWNER, owner::OUTSIDE);
    }
}

/// The side that shows output buffers: a display controller, or the host that
/// plays it.
///
/// It keeps the frame that it shows until there is a newer one, so the device
/// never writes into what is on the wall.
#[derive(Debug)]
pub struct Display<W> {
    words: W,
    layout: Layout,
    shown: Option<Shown>,
}

/// A frame that is being shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shown {
    buffer: usize,
    sequence: u32,
}

impl Shown {
    /// The number of the wanted frame that it was made from.
    #[must_use]
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }
}

impl<W: ControlWords> Display<W> {
    /// For the outputs of a source that the device has
    /// [attached](super::Source::attached) to.
    pub const fn new(words: W, layout: Layout) -> Self {
        Self {
            words,
            layout,
            shown: None,
        }
    }

    /// Shows the next frame and gives the one before back; `None` if there is no
    /// newer frame. Called until then, it ends with the newest.
    pub fn advance(&mut self) -> Option<Shown> {
        let held = self.shown.map(|shown| shown.buffer);
        let published = (0..BUFFERS).filter(|buffer| {
            let at = descriptor::output(*buffer);
            Some(*buffer) != held && self.words.load(at + descriptor::OWNER) == owner::OUTSIDE
        });
        let number = |buffer: usize| {
            self.words
                .load(descriptor::output(buffer) + descriptor::END)
        };
        let last = self.shown.map_or(0, |shown| shown.sequence);
        let distance = |buffer: &usize| number(*buffer).wrapping_sub(last).cast_signed();
        let buffer = published.min_by_key(distance)?;
        if let Some(held) = held {
            let at = descriptor::output(held);
            self.words.store(at + descriptor::OWNER, owner::DEVICE);
        }
        let shown = Shown {
            buffer,
            sequence: number(buffer),
        };
        self.shown = Some(shown);
        Some(shown)
    }

    /// The frame that is being shown.
    pub const fn shown(&self) -> Option<Shown> {
        self.shown
    }

    /// Where the pixels of a shown frame are.
    #[must_use]
    pub fn pixels(&self, shown: &Shown) -> Range<usize> {
        self.layout.output(shown.buffer)
    }

    /// Whether a shown frame was written as a whole and still is what it was.
    #[must_use]
    pub fn is_whole(&self, shown: &Shown) -> bool {
        fence(Ordering::SeqCst);
        let at = descriptor::output(shown.buffer);
        self.words.load(at + descriptor::START) == shown.sequence
            && self.words.load(at + descriptor::END) == shown.sequence
            && self.words.load(at + descriptor::LENGTH) as usize == self.layout.frame_bytes()
    }
}
