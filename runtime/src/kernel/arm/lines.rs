//! Interpolation loops in assembler: the same as the plain way
//! ([`resample`](crate::resample)) for 32-bit Arm.
//!
//! A cell covers a few pixels only, so what is done once a cell counts: slices that
//! a compiler takes apart and products of 64 bits. Here they are products of 32 bits
//! with their upper halves.

use crate::kernel::Between;
use core::arch::global_asm;

/// What the loop needs. The assembler below knows the order of the fields.
#[repr(C)]
struct Expand {
    values: *const i32,
    pixels: *mut i32,
    /// Values but the last.
    runs: usize,
    between: Between,
}

unsafe extern "C" {
    fn iltm_blend(
        before: *const i32,
        after: *const i32,
        fraction: u32,
        line: *mut i32,
        count: usize,
    );
    fn iltm_expand(expand: *const Expand);
}

/// Cells to pixels, as `portable.rs` says.
pub(crate) fn expand(between: &Between, values: &[i32], pixels: &mut [i32]) -> bool {
    let runs = values.len().saturating_sub(1);
    let Between {
        past,
        part,
        whole,
        cell,
        ..
    } = *between;
    if runs == 0 || whole == 0 || past >= cell || part >= cell {
        return false;
    }
    // Each run has `whole` pixels, and one more as often as `part` adds up to a cell.
    let pixel_units = u64::from(whole) * u64::from(cell) + u64::from(part);
    let needed = (pixel_units * runs as u64).div_ceil(u64::from(cell));
    if needed > pixels.len() as u64 {
        return false;
    }
    let expand = Expand {
        values: values.as_ptr(),
        pixels: pixels.as_mut_ptr(),
        runs,
        between: *between,
    };
    // SAFETY: `values` has `runs + 1` elements; the runs have `needed` pixels at most,
    // since a run takes one more pixel only when `past` has fallen below `part`.
    unsafe { iltm_expand(&raw const expand) };
    true
}

/// Two rows to one between, as `portable.rs` says.
pub(crate) fn blend(before: &[i32], after: &[i32], fraction: u32, line: &mut [i32]) -> bool {
    let count = line.len().min(before.len()).min(after.len());
    if fraction >> 31 != 0 {
        return false;
    }
    // SAFETY: all three have at least `count` elements, which may be none.
    unsafe {
        iltm_blend(
            before.as_ptr(),
            after.as_ptr(),
            fraction,
            line.as_mut_ptr(),
            count,
        );
    }
    true
}

// r0 before, r1 after, r2 fraction, r3 line, r4 elements left, r5 and r6 values before, r7
// and r8 after, r9 and r10 low and high half of the product.
global_asm!(
    r#"
    .syntax unified
    .macro iltm_between before, after
        sub \after, \after, \before
        smull r9, r10, \after, r2
        add \before, \before, r10, lsl #1
        add \before, \before, r9, lsr #31
    .endm

    .section .text.iltm_blend, "ax", %progbits
    .global iltm_blend
    .type iltm_blend, %function
    .thumb_func
    iltm_blend:
        push {{r4-r10, lr}}
        ldr r4, [sp, #32]
        subs r4, #2
        blt 2f
    1:
        ldrd r5, r6, [r0], #8
        ldrd r7, r8, [r1], #8
        iltm_between r5, r7
        iltm_between r6, r8
        strd r5, r6, [r3], #8
        subs r4, #2
        bge 1b
    2:
        adds r4, #2
        beq 3f
        ldr r5, [r0]
        ldr r7, [r1]
        iltm_between r5, r7
        str r5, [r3]
    3:
        pop {{r4-r10, pc}}
    .size iltm_blend, . - iltm_blend
    .text
    "#
);

// r0 values, r1 pixels, r2 runs left, r3 step of the axis, r4 half a cell, r5 past,
// r6 part, r7 whole, r8 cell, r9 value, r10 next value and sign, r11 low half and
// pixels of the run, r12 step of the run, lr offset and every second pixel.
global_asm!(
    r#"
    .syntax unified
    .section .text.iltm_expand, "ax", %progbits
    .global iltm_expand
    .type iltm_expand, %function
    .thumb_func
    iltm_expand:
        push {{r4-r11, lr}}
        ldmia r0, {{r0-r8}}
        ldr r9, [r0], #4
    1:
        ldr r10, [r0], #4
        sub r10, r10, r9
        umull r11, r12, r10, r3
        and lr, r3, r10, asr #31
        sub r12, r12, lr
        adds r11, r11, #0x80000000
        adc r12, r12, #0
        mul r11, r5, r4
        umull lr, r10, r12, r11
        and lr, r11, r12, asr #31
        sub r10, r10, lr
        add r10, r10, r9
        mov r11, r7
        cmp r6, r5
        itt hi
        addhi r11, #1
        addhi r5, r5, r8
        sub r5, r5, r6
        subs r11, #4
        blt 3f
    2:
        add lr, r10, r12
        strd r10, lr, [r1], #8
        add r10, lr, r12
        add lr, r10, r12
        strd r10, lr, [r1], #8
        add r10, lr, r12
        subs r11, #4
        bge 2b
    3:
        adds r11, #4
        beq 5f
    4:
        str r10, [r1], #4
        add r10, r12
        subs r11, #1
        bne 4b
    5:
        ldr r9, [r0, #-4]
        subs r2, #1
        bne 1b
        pop {{r4-r11, pc}}
    .size iltm_expand, . - iltm_expand
    .text
    "#
);
