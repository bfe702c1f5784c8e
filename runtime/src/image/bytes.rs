//! Fields of bytes that nobody vouches for.

use core::ops::Range;

/// The `u16` at `field`, little-endian.
pub(super) fn u16_at(bytes: &[u8], field: Range<usize>) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(field)?.try_into().ok()?))
}

/// The `u32` at `field`, little-endian.
pub(super) fn u32_at(bytes: &[u8], field: Range<usize>) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(field)?.try_into().ok()?))
}

/// Writes a field, as much of it as there is room for.
pub(crate) fn put(bytes: &mut [u8], field: Range<usize>, value: &[u8]) {
    let places = bytes.get_mut(field).unwrap_or_default();
    for (place, byte) in places.iter_mut().zip(value) {
        *place = *byte;
    }
}

/// Little-endian `u16`s as they lie in an image.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Halfwords<'a>(&'a [[u8; 2]]);

impl<'a> Halfwords<'a> {
    /// All of `bytes`; `None` if their number is odd.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        match bytes.as_chunks::<2>() {
            (words, []) => Some(Self(words)),
            _ => None,
        }
    }

    pub(super) const fn words(self) -> &'a [[u8; 2]] {
        self.0
    }

    pub(super) const fn len(self) -> usize {
        self.0.len()
    }

    pub(super) fn get(self, index: usize) -> u16 {
        self.0.get(index).copied().map_or(0, u16::from_le_bytes)
    }

    /// `count` of them from `start`; fewer where there are fewer.
    pub(super) fn run(
        self,
        start: usize,
        count: usize,
    ) -> impl ExactSizeIterator<Item = u16> + use<'a> {
        let rest = self.0.get(start..).unwrap_or_default();
        let run = rest.get(..count).unwrap_or(rest);
        run.iter().copied().map(u16::from_le_bytes)
    }
}
