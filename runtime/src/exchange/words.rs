//! Access to the control words.

use core::sync::atomic::{AtomicU32, Ordering};

/// The control words of a frame memory, as one side reaches them.
///
/// A device has them as atomics ([`NativeWords`]); a host may read and write the
/// file behind an emulator's memory.
pub trait ControlWords {
    /// The word at `index`, with acquire ordering: what the other side wrote
    /// before it stored this value can be read afterwards. Zero outside.
    fn load(&self, index: usize) -> u32;

    /// Stores the word at `index` with release ordering: what this side wrote
    /// before can be read by whoever loads this value. Nothing outside.
    fn store(&self, index: usize, value: u32);
}

impl<W: ControlWords + ?Sized> ControlWords for &W {
    fn load(&self, index: usize) -> u32 {
        (**self).load(index)
    }

    fn store(&self, index: usize, value: u32) {
        (**self).store(index, value);
    }
}

/// Control words in memory that this processor shares with the other side.
#[derive(Clone, Copy, Debug)]
pub struct NativeWords<'m>(pub &'m [AtomicU32]);

impl ControlWords for NativeWords<'_> {
    fn load(&self, index: usize) -> u32 {
        let word = self.0.get(index);
        u32::from_le(word.map_or(0, |word| word.load(Ordering::Acquire)))
    }

    fn store(&self, index: usize, value: u32) {
        if let Some(word) = self.0.get(index) {
            word.store(value.to_le(), Ordering::Release);
        }
    }
}
