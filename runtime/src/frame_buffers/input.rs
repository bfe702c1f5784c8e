//! Input buffers: wanted frames on their way to the device.

use super::layout::{BUFFERS, MAGIC, VERSION, descriptor, owner, word};
use super::{ControlWords, Format, Layout, RegionError};
use core::fmt;
use core::ops::Range;
use core::sync::atomic::{Ordering, fence};

/// The side that fills input buffers: a capture port's DMA, or the host that
/// plays it.
#[derive(Debug)]
pub struct Source<W> {
    words: W,
    layout: Layout,
    epoch: u32,
    sequence: u32,
}

/// A buffer that the source is filling.
#[derive(Debug)]
#[must_use = "the buffer is lost to the source unless it is finished"]
pub struct Filling {
    buffer: usize,
    sequence: u32,
}

impl Filling {
    /// The number of the frame.
    #[must_use]
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }
}

impl<W: ControlWords> Source<W> {
    /// Announces frames of `format` in a region of `region` bytes.
    ///
    /// The device follows when it has finished the frame it is at; until
    /// [`attached`](Self::attached), no frame can be given to it.
    ///
    /// # Errors
    /// [`RegionError`] if the frames do not fit.
    pub fn announce(words: W, region: usize, format: Format) -> Result<Self, RegionError> {
        let layout = Layout::new(format, region)?;
        words.store(word::MAGIC, 0);
        // Zero is what fresh memory holds: no epoch has it.
        let epoch = words.load(word::EPOCH).wrapping_add(1).max(1);
        for buffer in 0..BUFFERS {
            words.store(
                descriptor::input(buffer) + descriptor::OWNER,
                owner::OUTSIDE,
            );
        }
        format.emit(&words);
        words.store(word::EPOCH, epoch);
        words.store(word::MAGIC, MAGIC);
        Ok(Self {
            words,
            layout,
            epoch,
            sequence: 0,
        })
    }

    /// Whether the device takes frames of this announcement.
    pub fn attached(&self) -> bool {
        self.words.load(word::ATTACHED) == self.epoch
    }

    /// Whether the device has left a buffer to fill.
    pub fn has_room(&self) -> bool {
        self.attached() && self.free().is_some()
    }

    /// Starts the next frame; `None` if there is no buffer for it. The frame is
    /// dropped then, which the device sees by its number missing.
    pub fn begin(&mut self) -> Option<Filling> {
        self.sequence = self.sequence.wrapping_add(1);
        if !self.attached() {
            return None;
        }
        let buffer = self.free()?;
        let at = descriptor::input(buffer);
        self.words.store(at + descriptor::START, self.sequence);
        // The number must be seen to change before any pixel does.
        fence(Ordering::SeqCst);
        Some(Filling {
            buffer,
            sequence: self.sequence,
        })
    }

    /// Where the pixels of a frame go.
    #[must_use]
    pub fn pixels(&self, filling: &Filling) -> Range<usize> {
        self.layout.input(filling.buffer)
    }

    /// Where the light of the neighbours' cells goes; empty if the format has none.
    #[must_use]
    pub fn light(&self, filling: &Filling) -> Range<usize> {
        self.layout.light(filling.buffer)
    }

    /// Hands a whole frame to the device, with the neighbours' light if that has been filled in.
    #[allow(
        clippy::needless_pass_by_value,
        reason = "the buffer is not the source's any more"
    )]
    pub fn finish(&mut self, filling: Filling, with_light: bool) {
        let Filling { buffer, sequence } = filling;
        let at = descriptor::input(buffer);
        let length = self.layout.input_bytes(with_light) as u32;
        self.words.store(at + descriptor::LENGTH, length);
        self.words.store(at + descriptor::END, sequence);
        self.words.store(at + descriptor::OWNER, owner::DEVICE);
    }

    fn free(&self) -> Option<usize> {
        (0..BUFFERS).find(|buffer| {
            let at = descriptor::input(*buffer);
            self.words.load(at + descriptor::OWNER) == owner::OUTSIDE
        })
    }
}

/// Why a device cannot take frames from a frame memory.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AttachError {
    /// No source has announced itself.
    NoSource,
    /// The source speaks another version.
    Version {
        /// What the header says.
        found: u32,
    },
    /// The header describes no possible frame.
    Format,
    /// The frames do not fit.
    Region(RegionError),
}

impl fmt::Display for AttachError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSource => f.write_str("no source has announced frames"),
            Self::Version { found } => write!(
                f,
                "the source has version {found} of the frame memory; this device has {VERSION}"
            ),
            Self::Format => f.write_str("the source announces frames that there cannot be"),
            Self::Region(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for AttachError {}

/// Why a frame is not shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Broken {
    /// The sequence numbers around the pixels differ, or changed while the frame
    /// was worked on.
    Torn,
    /// It has not as many bytes as the format says.
    Short,
    /// It is not newer than the frame before it.
    Stale,
    /// The source announced another format while the frame was worked on.
    Superseded,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Torn => "the frame changed while it was read",
            Self::Short => "the frame is incomplete",
            Self::Stale => "the frame is not newer than the last",
            Self::Superseded => "the source changed its format",
        })
    }
}

impl core::error::Error for Broken {}

/// The device's side of the input buffers.
#[derive(Debug)]
pub struct Receiver<W> {
    words: W,
    format: Format,
    layout: Layout,
    epoch: u32,
    /// Buffers that are claimed.
    held: [bool; BUFFERS],
    /// Number of the last whole frame, if there was one.
    last: Option<u32>,
    /// Frames refused since then: their numbers are missing, but not dropped.
    refused: u32,
    counts: InputCounts,
}

/// What became of the frames of one announcement.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct InputCounts {
    /// Frames taken, whole so far.
    pub received: u32,
    /// Torn, short and stale frames.
    pub broken: u32,
    /// Frames that the source numbered and the device never saw.
    pub dropped: u32,
    /// Number and fault of the last broken frame, as far as it had a number.
    pub last_broken: Option<(u32, Broken)>,
}

/// A frame that the device works on.
#[derive(Debug)]
#[must_use = "the buffer is lost to the source unless it is released"]
pub struct Claim {
    buffer: usize,
    sequence: u32,
    with_light: bool,
}

impl Claim {
    /// The number of the frame.
    #[must_use]
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }
}

impl<W: ControlWords> Receiver<W> {
    /// Reads what the source announced and tells it that frames may come.
    ///
    /// Outputs belong to the device from here on. A device that has only been
    /// restarted leaves them as they are, so that the display keeps what it shows.
    ///
    /// # Errors
    /// [`AttachError`] if there is no source or its frames are impossible.
    pub fn attach(words: W, region: usize) -> Result<Self, AttachError> {
        let epoch = words.load(word::EPOCH);
        let format = Format::parse(&words)?;
        let layout = Layout::new(format, region).map_err(AttachError::Region)?;
        if words.load(word::ATTACHED) != epoch {
            for buffer in 0..BUFFERS {
                words.store(
                    descriptor::output(buffer) + descriptor::OWNER,
                    owner::DEVICE,
                );
            }
            words.store(word::ATTACHED, epoch);
        }
        Ok(Self {
            words,
            format,
            layout,
            epoch,
            held: [false; BUFFERS],
            last: None,
            refused: 0,
            counts: InputCounts::default(),
        })
    }

    /// What the frames look like.
    pub const fn format(&self) -> Format {
        self.format
    }

    /// Where the pixels lie.
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Whether the announcement that this was attached to still stands.
    pub fn is_current(&self) -> bool {
        self.words.load(word::MAGIC) == MAGIC && self.words.load(word::EPOCH) == self.epoch
    }

    /// What became of the frames.
    pub const fn counts(&self) -> InputCounts {
        self.counts
    }

    /// Takes the oldest frame that waits; broken ones are counted and given back
    /// on the way.
    pub fn claim(&mut self) -> Option<Claim> {
        loop {
            let buffer = self.oldest()?;
            match self.inspect(buffer) {
                Ok((sequence, with_light)) => {
                    self.account_for(sequence);
                    self.hold(buffer, true);
                    return Some(Claim {
                        buffer,
                        sequence,
                        with_light,
                    });
                }
                Err((sequence, broken)) => {
                    self.refuse(sequence, broken);
                    self.give_back(buffer);
                }
            }
        }
    }

    /// Where the pixels of a frame are.
    #[must_use]
    pub fn pixels(&self, claim: &Claim) -> Range<usize> {
        self.layout.input(claim.buffer)
    }

    /// Where the light of the neighbours' cells is that came with a frame; `None` if none came.
    #[must_use]
    pub fn light(&self, claim: &Claim) -> Option<Range<usize>> {
        claim.with_light.then(|| self.layout.light(claim.buffer))
    }

    /// Gives a frame back and says whether it was the same frame all the time it
    /// was worked on.
    ///
    /// # Errors
    /// [`Broken`] if the source wrote into it: nothing made from it may be shown.
    #[allow(
        clippy::needless_pass_by_value,
        reason = "the buffer is not the device's any more"
    )]
    pub fn release(&mut self, claim: Claim) -> Result<(), Broken> {
        let Claim {
            buffer, sequence, ..
        } = claim;
        self.hold(buffer, false);
        // The pixels were read before the numbers are looked at again.
        fence(Ordering::SeqCst);
        if !self.is_current() {
            return Err(Broken::Superseded);
        }
        let at = descriptor::input(buffer);
        let same = |field: usize| self.words.load(at + field) == sequence;
        let whole = same(descriptor::START)
            && same(descriptor::END)
            && self.words.load(at + descriptor::OWNER) == owner::DEVICE;
        let checked = if whole { Ok(()) } else { Err(Broken::Torn) };
        if let Err(broken) = checked {
            self.refuse(sequence, broken);
        }
        self.give_back(buffer);
        checked
    }

    fn hold(&mut self, buffer: usize, held: bool) {
        if let Some(slot) = self.held.get_mut(buffer) {
            *slot = held;
        }
    }

    /// The waiting buffer whose frame was begun first.
    fn oldest(&self) -> Option<usize> {
        let waiting = (0..BUFFERS).filter(|buffer| {
            let at = descriptor::input(*buffer);
            self.held.get(*buffer) == Some(&false)
                && self.words.load(at + descriptor::OWNER) == owner::DEVICE
        });
        let number = |buffer: usize| {
            self.words
                .load(descriptor::input(buffer) + descriptor::START)
        };
        // Distance from the last frame, so that numbers may wrap around.
        let last = self.last.unwrap_or_else(|| number(0));
        waiting.min_by_key(|buffer| number(*buffer).wrapping_sub(last).cast_signed())
    }

    /// The number of a waiting frame that is whole and new, and whether its neighbours' light came
    /// with it; else its number as far as it has one, and what is wrong.
    fn inspect(&self, buffer: usize) -> Result<(u32, bool), (u32, Broken)> {
        let at = descriptor::input(buffer);
        let start = self.words.load(at + descriptor::START);
        let length = self.words.load(at + descriptor::LENGTH) as usize;
        let with_light = self.format.light_bytes() > 0 && length == self.layout.input_bytes(true);
        let newer = |last: u32| start.wrapping_sub(last).cast_signed() > 0;
        let broken = if start != self.words.load(at + descriptor::END) {
            Broken::Torn
        } else if !with_light && length != self.layout.frame_bytes() {
            Broken::Short
        } else if !self.last.is_none_or(newer) {
            Broken::Stale
        } else {
            return Ok((start, with_light));
        };
        Err((start, broken))
    }

    fn account_for(&mut self, sequence: u32) {
        // Before the first frame, nobody was here to miss any.
        let before = self.last.unwrap_or_else(|| sequence.wrapping_sub(1));
        let missing = sequence.wrapping_sub(before).saturating_sub(1);
        let dropped = missing.saturating_sub(self.refused);
        self.counts.dropped = self.counts.dropped.saturating_add(dropped);
        self.counts.received = self.counts.received.saturating_add(1);
        self.refused = 0;
        self.last = Some(sequence);
    }

    const fn refuse(&mut self, sequence: u32, broken: Broken) {
        self.counts.last_broken = Some((sequence, broken));
        self.counts.broken = self.counts.broken.saturating_add(1);
        if matches!(broken, Broken::Torn | Broken::Short) {
            self.refused = self.refused.saturating_add(1);
        }
    }

    fn give_back(&self, buffer: usize) {
        let at = descriptor::input(buffer);
        self.words.store(at + descriptor::OWNER, owner::OUTSIDE);
    }
}
