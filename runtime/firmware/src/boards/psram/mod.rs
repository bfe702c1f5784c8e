//! PSRAM of the emulated boards, which stands for table flash and frame memory.
//!
//! This is the one place that turns its addresses into slices.

mod flash;
mod frames;

pub use flash::PsramFlash;
pub use frames::{PsramSink, PsramSource};

use core::ops::Range;
use core::sync::atomic::AtomicU32;
use iltm_runtime::frame_buffers::layout::CONTROL_WORDS;
use iltm_runtime::frame_buffers::{NativeWords, psram};

unsafe extern "C" {
    /// The PSRAM: a symbol of `memory.x`. Atomics, because the host writes it too.
    static __psram_start: [AtomicU32; psram::SIZE / 4];
}

/// Table flash, and both sides of the frame memory. The caller makes sure that
/// this happens once.
pub(super) fn take() -> (PsramFlash, PsramSource, PsramSink) {
    (PsramFlash::new(), PsramSource::new(), PsramSink::new())
}

/// The address of the byte at `offset`, at most the PSRAM's end.
fn address(offset: usize) -> *mut u8 {
    let start = (&raw const __psram_start).cast::<u8>().cast_mut();
    start.wrapping_add(offset.min(psram::SIZE))
}

/// Bytes that nobody writes while they are in use.
fn bytes(range: Range<usize>) -> &'static [u8] {
    let range = range.start.min(psram::SIZE)..range.end.min(psram::SIZE);
    // SAFETY: the range lies in the PSRAM, which is memory for as long as the
    // program runs. The store gives a slot back before it is written; claimed inputs are not
    // written by a source that keeps to the protocol, and one that does not is
    // found out by `Receiver::release` before anything is made of the pixels
    // other than pixels.
    unsafe { core::slice::from_raw_parts(address(range.start), range.len()) }
}

/// A byte of the part that stands for flash. Volatile, as flash is: it may be read
/// after it was written through another pointer.
fn load(offset: usize) -> u8 {
    let place = address(offset.min(psram::FLASH.end - 1));
    // SAFETY: in the PSRAM, of which this part holds bytes only.
    unsafe { place.read_volatile() }
}

/// Changes a byte of the part that stands for flash.
fn store(offset: usize, byte: u8) {
    let place = address(offset.min(psram::FLASH.end - 1));
    // SAFETY: as in `load`; nobody holds a slice of it, see `bytes`.
    unsafe { place.write_volatile(byte) };
}

/// Pixels of an output buffer.
///
/// # Safety
/// The device owns the buffer and nothing else refers to it.
unsafe fn pixels<'a>(range: Range<usize>) -> &'a mut [u8] {
    let range = range.start.min(psram::SIZE)..range.end.min(psram::SIZE);
    // SAFETY: in the PSRAM, as in `bytes`; the caller promises the rest.
    unsafe { core::slice::from_raw_parts_mut(address(range.start), range.len()) }
}

/// Words from `offset` on.
fn words(offset: usize, count: usize) -> NativeWords<'static> {
    // SAFETY: memory for as long as the program runs, of which every value is a
    // value of an atomic. The parts that are used as words are never made slices
    // of bytes.
    let all = unsafe { &__psram_start };
    let first = offset / 4;
    NativeWords(all.get(first..first + count).unwrap_or(&[]))
}

/// The control words of the frame memory.
fn control_words() -> NativeWords<'static> {
    words(psram::FRAMES.start, CONTROL_WORDS)
}

/// Words that [`self_test_words`] has.
const SELF_TEST_WORDS: usize = 1 << 12;

/// Words of the self-test's part.
#[must_use]
pub fn self_test_words() -> NativeWords<'static> {
    words(psram::SELF_TEST.start, SELF_TEST_WORDS)
}

/// The control words of the frame memory, for the self-test, which plays source and
/// display.
#[must_use]
pub fn outside_words() -> NativeWords<'static> {
    control_words()
}

/// The pixels of a frame that the self-test shows, by their range in the frame
/// memory.
#[must_use]
pub fn outside_pixels(range: Range<usize>) -> &'static [u8] {
    bytes(frames::in_psram(range))
}
