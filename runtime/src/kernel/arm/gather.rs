//! Operator loop in assembler: the same as the plain way ([`operator`](crate::operator)) for
//! Arm's DSP extension.
//!
//! What makes it faster than what a compiler makes of the plain loop: rows of one
//! number of pairs run without counting them (at most eight, unrolled), words come
//! from the table several at a time (`ldm`), and a pair is three instructions: index
//! out of its word (`uxth`), two input coefficients at once (`ldr`), both products
//! added up (`smlad`). Three channels share the first of them.
//!
//! `docs/firmware.md` says what that brings and how to repeat it.

use crate::kernel::{GroupRows, Sums};
use core::arch::global_asm;
use core::ffi::c_void;
use fixed::types::I2F30;

/// What the loops need beside pointers into the table. The assembler below knows
/// the order of the fields.
#[repr(C)]
struct Context {
    inputs: *const i16,
    sums: *mut i32,
    /// Bytes from the inputs of a channel to those of the next.
    stride: usize,
    scales: [i32; 3],
    /// Bytes from the sums of a channel to those of the next.
    sums_stride: usize,
}

/// Runs the rows of one number of pairs (or of any) from `words` to `end`.
type Loop = unsafe extern "C" fn(words: *const c_void, context: *const Context, end: *const c_void);

unsafe extern "C" {
    fn iltm_clear(values: *mut [i32; 8], end: *const [i32; 8]);
}

/// Makes all values zero, as `portable.rs` says.
pub(crate) fn clear(values: &mut [i32]) -> bool {
    let (eights, rest) = values.as_chunks_mut::<8>();
    if !eights.is_empty() {
        let eights = eights.as_mut_ptr_range();
        // SAFETY: the loop writes whole eights from the start of `eights` to its end, of
        // which there is one at least.
        unsafe { iltm_clear(eights.start, eights.end) };
    }
    rest.fill(0);
    true
}

/// Adds rows to the sums; `false`, and nothing done, if there is no loop for them: rows
/// for all channels behind others.
///
/// `fresh` says that the sums are zero. The rows are those of a segment that was checked
/// against a grid of `sums.cells` cells and `sums.of_channel` inputs; sums and inputs have
/// that many elements for each scale.
pub(crate) fn gather<'a>(
    rows: impl Iterator<Item = GroupRows<'a>>,
    scales: &[I2F30],
    fresh: bool,
    sums: &mut Sums<'_>,
) -> bool {
    let loops = match scales {
        [scale] if fresh && *scale == I2F30::ONE => &STORE_ONE,
        [_] => &ADD_ONE,
        [_, _, _] if fresh => &STORE_THREE,
        _ => return false,
    };
    let mut context = Context {
        inputs: sums.inputs.as_ptr(),
        sums: sums.outputs.as_mut_ptr(),
        stride: sums.of_channel * size_of::<i16>(),
        scales: [0; 3],
        sums_stride: sums.cells * size_of::<i32>(),
    };
    for (slot, scale) in context.scales.iter_mut().zip(scales) {
        *slot = scale.to_bits();
    }
    for rows in rows {
        // A checked segment has no rows of other lengths.
        let Some(run) = loops.get(usize::from(rows.pairs)) else {
            continue;
        };
        let words = rows.words.as_ptr_range();
        // SAFETY: the segment was checked, so `words` is aligned and holds whole rows as
        // the loop reads them, at least one, every row's index is below `sums.cells` and every pair's below
        // `sums.of_channel - 1`; the caller made sure that `sums` and `inputs` have
        // `sums.cells` and `sums.of_channel` elements for each scale. The table lies in flash that nobody
        // writes while a `Table` borrows it. Words of two inputs need no alignment.
        unsafe {
            run(words.start.cast(), &raw const context, words.end.cast());
        };
    }
    true
}

/// Loops by number of pairs, the one for rows of any number first.
type Loops = [Loop; 9];

macro_rules! loops {
    ($name:ident: $($function:ident)*) => {
        unsafe extern "C" {
            $(fn $function(words: *const c_void, context: *const Context, end: *const c_void);)*
        }
        static $name: Loops = [$($function),*];
    };
}

loops!(STORE_ONE: iltm_store_one_0 iltm_store_one_1 iltm_store_one_2 iltm_store_one_3
    iltm_store_one_4 iltm_store_one_5 iltm_store_one_6 iltm_store_one_7 iltm_store_one_8);
loops!(ADD_ONE: iltm_add_one_0 iltm_add_one_1 iltm_add_one_2 iltm_add_one_3
    iltm_add_one_4 iltm_add_one_5 iltm_add_one_6 iltm_add_one_7 iltm_add_one_8);
loops!(STORE_THREE: iltm_store_three_0 iltm_store_three_1 iltm_store_three_2 iltm_store_three_3
    iltm_store_three_4 iltm_store_three_5 iltm_store_three_6 iltm_store_three_7 iltm_store_three_8);

// r0 values, r1 their end, r2 to r9 zero.
global_asm!(
    r#"
    .syntax unified
    .section .text.iltm_clear, "ax", %progbits
    .global iltm_clear
    .type iltm_clear, %function
    .thumb_func
    iltm_clear:
        push {{r4-r9}}
    .irp zero, r2, r3, r4, r5, r6, r7, r8, r9
        mov \zero, #0
    .endr
    1:
        stmia r0!, {{r2-r9}}
        cmp r0, r1
        bne 1b
        pop {{r4-r9}}
        bx lr
    .size iltm_clear, . - iltm_clear
    .text
    "#
);

// One channel.
//
// r0 words, r1 inputs, r2 sums, r3 end of the words, r4 first word of the row, r5
// and r6 values, r7 indices, r8 to r10 the next two pairs, r11 inputs of a pair, r12 sum,
// lr pairs left in a long row.
global_asm!(
    r#"
    .syntax unified
    .macro iltm_first_one values, indices
        uxth r11, \indices
        ldr r11, [r1, r11, lsl #1]
        smuad r12, r11, \values
    .endm

    .macro iltm_low_one values, indices
        uxth r11, \indices
        ldr r11, [r1, r11, lsl #1]
        smlad r12, r11, \values, r12
    .endm

    .macro iltm_high_one values, indices
        lsr r11, \indices, #16
        ldr r11, [r1, r11, lsl #1]
        smlad r12, r11, \values, r12
    .endm

    .macro iltm_begin_one name
    .section .text.\name, "ax", %progbits
    .global \name
    .type \name, %function
    .thumb_func
    \name:
        push {{r4-r12, lr}}
        mov r3, r2
        ldr r2, [r1, #12]
        push {{r2}}
        ldr r2, [r1, #4]
        ldr r1, [r1]
    .endm

    .macro iltm_finish_one name, add
        lsr r11, r4, #16
        uxth r4, r4
    .if \add
        ldr r5, [sp]
        sub r11, #2
        ldr r6, [r2, r4, lsl #2]
        smmul r12, r12, r5
        asr r12, r11
        add r12, r6
    .else
        asr r12, r11
    .endif
        cmp r0, r3
        str r12, [r2, r4, lsl #2]
        blo 1b
        add sp, #4
        pop {{r4-r12, pc}}
    .size \name, . - \name
    .endm

    .macro iltm_short_one name, add, pairs
    iltm_begin_one \name
    1:
    .if \pairs == 1
        ldmia r0!, {{r4, r5, r7}}
    .elseif \pairs == 2
        ldmia r0!, {{r4-r7}}
    .elseif \pairs == 3
        ldmia r0!, {{r4-r9}}
    .else
        ldmia r0!, {{r4-r10}}
    .endif
        iltm_first_one r5, r7
    .if \pairs > 1
        iltm_high_one r6, r7
    .endif
    .if \pairs == 3
        iltm_low_one r8, r9
    .endif
    .if \pairs > 3
        iltm_low_one r8, r10
        iltm_high_one r9, r10
    .endif
    .if \pairs == 5
        ldmia r0!, {{r5, r7}}
    .elseif \pairs == 6
        ldmia r0!, {{r5-r7}}
    .elseif \pairs == 7
        ldmia r0!, {{r5-r9}}
    .elseif \pairs == 8
        ldmia r0!, {{r5-r10}}
    .endif
    .if \pairs > 4
        iltm_low_one r5, r7
    .endif
    .if \pairs > 5
        iltm_high_one r6, r7
    .endif
    .if \pairs == 7
        iltm_low_one r8, r9
    .endif
    .if \pairs > 7
        iltm_low_one r8, r10
        iltm_high_one r9, r10
    .endif
    iltm_finish_one \name, \add
    .endm

    .macro iltm_long_one name, add
    iltm_begin_one \name
    1:
        ldr r4, [r0], #4
        ldr lr, [r0], #4
        mov r12, #0
        subs lr, #8
        blt 3f
    2:
        ldmia r0!, {{r5-r10}}
        iltm_low_one r5, r7
        iltm_high_one r6, r7
        iltm_low_one r8, r10
        iltm_high_one r9, r10
        ldmia r0!, {{r5-r10}}
        iltm_low_one r5, r7
        iltm_high_one r6, r7
        iltm_low_one r8, r10
        iltm_high_one r9, r10
        subs lr, #8
        bge 2b
    3:
        lsls r11, lr, #30
        bcc 6f
        ldmia r0!, {{r5-r10}}
        iltm_low_one r5, r7
        iltm_high_one r6, r7
        iltm_low_one r8, r10
        iltm_high_one r9, r10
    6:
        lsls lr, #31
        bcc 4f
        ldmia r0!, {{r5-r7}}
        iltm_low_one r5, r7
        iltm_high_one r6, r7
    4:
        cmp lr, #0
        beq 5f
        ldmia r0!, {{r5, r7}}
        iltm_low_one r5, r7
    5:
    iltm_finish_one \name, \add
    .endm

    .macro iltm_family_one name, add
    iltm_long_one \name\()_0, \add
    .irp pairs, 1, 2, 3, 4, 5, 6, 7, 8
    iltm_short_one \name\()_\pairs, \add, \pairs
    .endr
    .endm

    iltm_family_one iltm_store_one, 0
    iltm_family_one iltm_add_one, 1
    .text
    "#
);

// Three channels.
//
// r0 words, r1-r3 inputs by channel, r4-r6 sums by channel, r7 and r8 values, r9
// indices, r10 index, r11 inputs of a pair, r12 shift of a short row or pairs left in a
// long one, lr index of a short row or first word of a long one. On the stack: the
// context from `sums` on, then the end of the words.
global_asm!(
    r#"
    .macro iltm_pair_three values
        ldr r11, [r1, r10, lsl #1]
        smlad r4, r11, \values, r4
        ldr r11, [r2, r10, lsl #1]
        smlad r5, r11, \values, r5
        ldr r11, [r3, r10, lsl #1]
        smlad r6, r11, \values, r6
    .endm

    .macro iltm_first_three values
        uxth r10, r9
        ldr r11, [r1, r10, lsl #1]
        smuad r4, r11, \values
        ldr r11, [r2, r10, lsl #1]
        smuad r5, r11, \values
        ldr r11, [r3, r10, lsl #1]
        smuad r6, r11, \values
    .endm

    .macro iltm_low_three values, indices
        uxth r10, \indices
        iltm_pair_three \values
    .endm

    .macro iltm_high_three values
        lsr r10, r9, #16
        iltm_pair_three \values
    .endm

    .macro iltm_begin_three name
    .section .text.\name, "ax", %progbits
    .global \name
    .type \name, %function
    .thumb_func
    \name:
        push {{r4-r11, lr}}
        sub sp, #28
        ldmia r1, {{r3-r9}}
        str r2, [sp, #20]
        stmia sp, {{r4, r6-r9}}
        mov r1, r3
        add r2, r1, r5
        add r3, r2, r5
    .endm

    .macro iltm_finish_three name
        ldmia sp, {{r7-r11}}
        smmul r4, r4, r8
        smmul r5, r5, r9
        smmul r6, r6, r10
        ldr r8, [sp, #20]
        add r7, r7, lr, lsl #2
        sub r12, #2
        asr r4, r12
        asr r5, r12
        asr r6, r12
        str r4, [r7]
        str r5, [r7, r11]
        str r6, [r7, r11, lsl #1]
        cmp r0, r8
        blo 1b
        add sp, #28
        pop {{r4-r11, pc}}
    .size \name, . - \name
    .endm

    .macro iltm_short_three name, pairs
    iltm_begin_three \name
    1:
        ldrh lr, [r0], #2
        ldrh r12, [r0], #2
    .if \pairs == 1
        ldmia r0!, {{r7, r9}}
    .else
        ldmia r0!, {{r7-r9}}
    .endif
        iltm_first_three r7
    .if \pairs > 1
        iltm_high_three r8
    .endif
    .irp at, 2, 4, 6
    .if \pairs == \at + 1
        ldmia r0!, {{r7, r9}}
        iltm_low_three r7, r9
    .elseif \pairs > \at
        ldmia r0!, {{r7-r9}}
        iltm_low_three r7, r9
        iltm_high_three r8
    .endif
    .endr
    iltm_finish_three \name
    .endm

    .macro iltm_long_three name
    iltm_begin_three \name
    1:
        ldr lr, [r0], #4
        ldr r12, [r0], #4
        mov r4, #0
        mov r5, #0
        mov r6, #0
        subs r12, #4
        blt 3f
    2:
        ldmia r0!, {{r7-r9}}
        iltm_low_three r7, r9
        iltm_high_three r8
        ldmia r0!, {{r7-r9}}
        iltm_low_three r7, r9
        iltm_high_three r8
        subs r12, #4
        bge 2b
    3:
        lsls r12, #31
        bcc 4f
        ldmia r0!, {{r7-r9}}
        iltm_low_three r7, r9
        iltm_high_three r8
    4:
        cmp r12, #0
        beq 5f
        ldmia r0!, {{r7, r9}}
        iltm_low_three r7, r9
    5:
        lsr r12, lr, #16
        uxth lr, lr
    iltm_finish_three \name
    .endm

    .macro iltm_family_three name
    iltm_long_three \name\()_0
    .irp pairs, 1, 2, 3, 4, 5, 6, 7, 8
    iltm_short_three \name\()_\pairs, \pairs
    .endr
    .endm

    iltm_family_three iltm_store_three
    .text
    "#
);
