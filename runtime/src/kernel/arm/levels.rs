//! Haar loops in assembler: the same as the plain way ([`haar`](crate::haar)) for Arm's DSP
//! extension.
//!
//! The levels of a small grid are short rows, and a compiler's loop over a row
//! begins with working out how long its slices are. Here one call takes a level;
//! two details are packed and stored at once (`pkhbt`).

use crate::kernel::Block;
use crate::units::InputCoefficient;
use core::arch::global_asm;

/// What the loops need. The assembler below knows the order of the fields.
#[repr(C)]
struct MergeValues {
    values: *const i32,
    sums: *mut i32,
    details: *mut i16,
    /// Nodes of a row.
    nodes: usize,
    /// GroupRows of nodes.
    rows: usize,
    shift: u32,
    half: u32,
    /// Bytes from a row of values to the next.
    stride: usize,
}

/// See [`MergeValues`].
#[repr(C)]
struct SplitValues {
    values: *const i32,
    details: *const i32,
    to: *mut i32,
    nodes: usize,
    rows: usize,
    stride: usize,
}

unsafe extern "C" {
    fn iltm_merge_values(merge: *const MergeValues);
    fn iltm_split_values(split: *const SplitValues);
}

/// Cells that a block spans in memory; `None` if the loops cannot run through it.
#[inline]
pub(super) fn span(block: Block) -> Option<usize> {
    let Block {
        cols, nodes, rows, ..
    } = block;
    let whole = cols == 2 * nodes || (rows == 1 && cols > 2 * nodes);
    if nodes == 0 || rows == 0 || !whole {
        return None;
    }
    // The last row ends with its last node.
    Some(cols * (2 * rows - 1) + 2 * nodes)
}

/// Sums and details of a block, as `portable.rs` says.
#[inline]
pub(crate) fn merge(
    values: &[i32],
    block: Block,
    shift: u32,
    sums: &mut [i32],
    details: &mut [[InputCoefficient; 3]],
) -> bool {
    let values = values.get(block.row * block.cols..).unwrap_or_default();
    let count = block.nodes * block.rows;
    let fits = span(block).is_some_and(|span| values.len() >= span);
    if !fits || sums.len() < count || details.len() < count || shift == 0 {
        return false;
    }
    let merge = MergeValues {
        values: values.as_ptr(),
        sums: sums.as_mut_ptr(),
        details: details.as_mut_ptr().cast(),
        nodes: block.nodes,
        rows: block.rows,
        shift,
        half: 1_u32.wrapping_shl(shift) >> 1,
        stride: block.cols * size_of::<i32>(),
    };
    // SAFETY: `values` spans the block; `sums` has one element for each of its nodes
    // and `details` three. The words of two details need no alignment.
    unsafe { iltm_merge_values(&raw const merge) };
    true
}

/// Quarters of a block, as `portable.rs` says.
#[inline]
pub(crate) fn split(block: Block, values: &[i32], details: &[[i32; 3]], to: &mut [i32]) -> bool {
    let count = block.nodes * block.rows;
    let fits = span(block).is_some_and(|span| to.len() >= span);
    if !fits || values.len() < count || details.len() < count {
        return false;
    }
    let split = SplitValues {
        values: values.as_ptr(),
        details: details.as_ptr().cast(),
        to: to.as_mut_ptr(),
        nodes: block.nodes,
        rows: block.rows,
        stride: block.cols * size_of::<i32>(),
    };
    // SAFETY: `to` spans the block; `values` has one element for each of its nodes
    // and `details` three.
    unsafe { iltm_split_values(&raw const split) };
    true
}

// r0 top, r1 bottom, r2 sums, r3 details, r4 nodes left in the row, r5 shift,
// r6-r9 the four values of a node, r10 half, r11 stride, r12 and lr what comes of
// them. On the stack: nodes of a row, rows left.
global_asm!(
    r#"
    .syntax unified
    .section .text.iltm_merge_values, "ax", %progbits
    .global iltm_merge_values
    .type iltm_merge_values, %function
    .thumb_func
    iltm_merge_values:
        push {{r4-r11, lr}}
        ldmia r0, {{r1-r8}}
        mov r0, r1
        mov r12, r5
        mov r5, r6
        mov r10, r7
        mov r11, r8
        push {{r4, r12}}
    1:
        add r1, r0, r11
        ldr r4, [sp]
    2:
        ldrd r6, r7, [r0], #8
        ldrd r8, r9, [r1], #8
        add r12, r6, r7
        sub r6, r6, r7
        add lr, r8, r9
        sub r8, r8, r9
        add r7, r12, lr
        sub r12, r12, lr
        str r7, [r2], #4
        add r6, r10
        add r12, r10
        add r7, r6, r8
        sub r6, r6, r8
        asr r7, r5
        asr r12, r5
        asr r6, r5
        pkhbt r7, r7, r12, lsl #16
        strh r6, [r3, #4]
        str r7, [r3], #6
        subs r4, #1
        bne 2b
        mov r0, r1
        ldr r12, [sp, #4]
        subs r12, #1
        str r12, [sp, #4]
        bne 1b
        add sp, #8
        pop {{r4-r11, pc}}
    .size iltm_merge_values, . - iltm_merge_values
    .text
    "#
);

// r0 values, r1 details, r2 top, r3 bottom, r4 nodes left in the row (two a turn, an
// odd one alone), r5 stride, r6 value, r7-r9 details, r10 to lr quarters. On the
// stack: nodes of a row, rows left.
global_asm!(
    r#"
    .macro iltm_split
        ldr r6, [r0], #4
        ldmia r1!, {{r7-r9}}
        add r10, r6, r8
        sub r6, r6, r8
        add r8, r7, r9
        sub r7, r7, r9
        add r11, r10, r8
        sub r12, r10, r8
        add r9, r6, r7
        sub lr, r6, r7
        strd r11, r12, [r2], #8
        strd r9, lr, [r3], #8
    .endm

    .section .text.iltm_split_values, "ax", %progbits
    .global iltm_split_values
    .type iltm_split_values, %function
    .thumb_func
    iltm_split_values:
        push {{r4-r11, lr}}
        ldmia r0, {{r0-r5}}
        push {{r3, r4}}
    1:
        add r3, r2, r5
        ldr r4, [sp]
        tst r4, #1
        it ne
        addne r4, #1
        bne 3f
    2:
        iltm_split
    3:
        iltm_split
        subs r4, #2
        bne 2b
        mov r2, r3
        ldr r6, [sp, #4]
        subs r6, #1
        str r6, [sp, #4]
        bne 1b
        add sp, #8
        pop {{r4-r11, pc}}
    .size iltm_split_values, . - iltm_split_values
    .text
    "#
);
