//! Stack depth: how deep the stack has been.
//!
//! Before anything else runs, the free part of the stack is painted; what is no
//! longer paint has been used. The stack is a region of its own in `memory.x`.

use core::hint::black_box;
use core::ptr::{self, with_exposed_provenance_mut};
use iltm_runtime::link::Stack;

/// No instruction, no address, and no likely value.
const PAINT: u32 = 0xA5C3_5A3C;

/// Bytes above the current stack pointer that painting leaves alone: the frame of
/// [`paint`] itself and an interrupt's.
const MARGIN: usize = 256;

unsafe extern "C" {
    /// Bounds of the stack: symbols of `memory.x`, of which only the addresses mean
    /// something. It grows down from the start to the end.
    static _stack_start: u32;
    static _stack_end: u32;
}

fn bounds() -> (usize, usize) {
    // Nothing may be concluded from what the symbols are declared as.
    let low = black_box((&raw const _stack_end).expose_provenance());
    let high = black_box((&raw const _stack_start).expose_provenance());
    (low, high)
}

/// Paints the free part of the stack. Call first thing.
pub fn paint() {
    let (low, _) = bounds();
    let here = 0_u32;
    let top = ptr::from_ref(&here).addr().saturating_sub(MARGIN);
    for address in (low..top).step_by(4) {
        // SAFETY: below the stack pointer by more than any frame in use, and in the
        // stack's region, of which nothing else is a part.
        unsafe { with_exposed_provenance_mut::<u32>(address).write_volatile(PAINT) };
    }
}

/// The deepest it has been, and its size.
#[must_use]
pub fn depth() -> Stack {
    let (low, high) = bounds();
    // SAFETY: words of the stack's region, painted or used.
    let painted = |address: &usize| unsafe {
        with_exposed_provenance_mut::<u32>(*address).read_volatile() == PAINT
    };
    let untouched = (low..high).step_by(4).take_while(painted).count() * 4;
    Stack {
        used: (high - low - untouched) as u32,
        size: (high - low) as u32,
    }
}
