//! Frame source and sink in the PSRAM's frame memory, with the host at the other end.

use crate::board::{FrameSink, FrameSource};
use core::ops::Range;
use iltm_runtime::frame_buffers::{
    AttachError, Broken, Claim, Format, InputCounts, Layout, NativeWords, Presenter, Receiver,
    psram,
};
use iltm_runtime::link::SourceFault;
use iltm_runtime::units::Halfword;

/// The frame memory's range in the PSRAM from a range in the frame memory.
pub(super) fn in_psram(range: Range<usize>) -> Range<usize> {
    psram::FRAMES.start + range.start..psram::FRAMES.start + range.end
}

/// Wanted frames.
pub struct PsramSource {
    receiver: Option<Receiver<NativeWords<'static>>>,
    claim: Option<Claim>,
    /// Frames of earlier announcements.
    past: InputCounts,
    /// What was wrong when it was looked at last.
    refused: Option<AttachError>,
}

impl PsramSource {
    pub(super) const fn new() -> Self {
        Self {
            receiver: None,
            claim: None,
            past: InputCounts {
                received: 0,
                broken: 0,
                dropped: 0,
                last_broken: None,
            },
            refused: None,
        }
    }
}

impl FrameSource for PsramSource {
    fn follow(&mut self) -> Option<Result<Format, SourceFault>> {
        if self.receiver.as_ref().is_some_and(Receiver::is_current) {
            return None;
        }
        self.past = self.counts();
        self.receiver = None;
        match Receiver::attach(super::control_words(), psram::FRAMES.len()) {
            Ok(receiver) => {
                let format = receiver.format();
                self.receiver = Some(receiver);
                self.refused = None;
                Some(Ok(format))
            }
            Err(error) => {
                let new = self.refused.replace(error) != Some(error);
                SourceFault::of(&error).filter(|_| new).map(Err)
            }
        }
    }

    fn claim(&mut self) -> Option<u32> {
        if self.claim.is_none() {
            self.claim = self.receiver.as_mut()?.claim();
        }
        self.claim.as_ref().map(Claim::sequence)
    }

    fn wanted(&self) -> &[u8] {
        let frame = self.receiver.as_ref().zip(self.claim.as_ref());
        frame.map_or(&[], |(receiver, claim)| {
            super::bytes(in_psram(receiver.pixels(claim)))
        })
    }

    fn heard(&self) -> Option<&[Halfword]> {
        let (receiver, claim) = self.receiver.as_ref().zip(self.claim.as_ref())?;
        let light = receiver.light(claim)?;
        Some(super::bytes(in_psram(light)).as_chunks().0)
    }

    fn release(&mut self) -> Result<(), Broken> {
        match (self.receiver.as_mut(), self.claim.take()) {
            (Some(receiver), Some(claim)) => receiver.release(claim),
            _ => Err(Broken::Superseded),
        }
    }

    fn counts(&self) -> InputCounts {
        let now = self.receiver.as_ref().map(Receiver::counts);
        let (past, now) = (self.past, now.unwrap_or_default());
        InputCounts {
            received: past.received.saturating_add(now.received),
            broken: past.broken.saturating_add(now.broken),
            dropped: past.dropped.saturating_add(now.dropped),
            last_broken: now.last_broken.or(past.last_broken),
        }
    }

    fn capacity(&self) -> usize {
        Layout::capacity(psram::FRAMES.len())
    }
}

/// Projector input.
pub struct PsramSink {
    presenter: Option<Presenter<NativeWords<'static>>>,
    /// Buffer and number of the frame that is being written.
    writing: Option<(usize, u32)>,
}

impl PsramSink {
    pub(super) const fn new() -> Self {
        Self {
            presenter: None,
            writing: None,
        }
    }
}

impl FrameSink for PsramSink {
    fn start(&mut self, format: Format) {
        let layout = Layout::new(format, psram::FRAMES.len()).ok();
        self.presenter = layout.map(|layout| Presenter::new(super::control_words(), layout));
        self.writing = None;
    }

    fn has_room(&self) -> bool {
        let presenter = self.presenter.as_ref();
        presenter.is_some_and(|presenter| presenter.free().is_some())
    }

    fn begin(&mut self, sequence: u32) -> &mut [u8] {
        self.writing = None;
        let Some(presenter) = &self.presenter else {
            return &mut [];
        };
        let Some(buffer) = presenter.free() else {
            return &mut [];
        };
        self.writing = Some((buffer, sequence));
        let range = in_psram(presenter.begin(buffer, sequence));
        // SAFETY: the presenter says that the buffer is the device's, and the
        // slice borrows the only sink there is.
        unsafe { super::pixels(range) }
    }

    fn publish(&mut self) {
        if let Some((presenter, (buffer, sequence))) =
            self.presenter.as_ref().zip(self.writing.take())
        {
            presenter.publish(buffer, sequence);
        }
    }
}
