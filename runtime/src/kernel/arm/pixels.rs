//! Pixel loops in assembler: the same as the plain way ([`pipeline`](crate::pipeline)) for
//! Arm's DSP extension.
//!
//! A compiler keeps some twenty addresses and values of these loops, more than there
//! are registers, and spends a third of its instructions on moving them. Written
//! out, everything stays in registers; two details are packed and stored at once
//! (`pkhbt`); a drive is clipped and shifted by one instruction (`usat`); and only
//! samples that were clipped are counted, on a way of their own.
//!
//! `docs/firmware.md` says what that brings and how to repeat it.

use super::levels::span;
use crate::kernel::{Block, Plane};
use crate::response::CODES;
use crate::units::{ClippedSamples, Drive, Halfword, InputCoefficient};
use core::arch::global_asm;
use core::ptr::without_provenance;

/// Input shift of the nodes of two by two cells, which the loop has built in.
const FINEST_SHIFT: u32 = 2;

/// What the merging loop needs. The assembler below knows the order of the fields.
#[repr(C)]
struct MergePixels {
    top: *const u8,
    light: *const u16,
    sums: *mut i32,
    details: *mut i16,
    /// Nodes of a row.
    nodes: usize,
    /// GroupRows of nodes.
    rows: usize,
    ambient: *const u8,
    /// Bytes from a row of pixels to the next.
    stride: usize,
}

/// What the finishing loop needs. The assembler below knows the order of the fields.
#[repr(C)]
struct Finish {
    corrections: *const i32,
    wanted: *const u8,
    gain: *const u8,
    input: *mut u8,
    light: *const u16,
    /// Codes by drive, or [`PROPORTIONAL`].
    codes: *const u8,
    gain_fraction: u32,
    half: u32,
    count: usize,
    ambient: *const u8,
}

/// What a drive is multiplied by to be a code in the high word of the product.
const PROPORTIONAL: usize = 255 << (32 - Drive::FRAC_NBITS);

/// Most pixels that the finishing loop takes, since it counts those clipped in two
/// halfwords. More, which only a grid can have, go the plain way.
const MAX_PIXELS: usize = u16::MAX as usize;

/// What the adding loop needs. The assembler below knows the order of the fields.
#[repr(C)]
struct AddLight {
    pixels: *const u8,
    columns: *mut u32,
    light: *const u16,
    weight: u32,
    count: usize,
    ambient: *const u8,
}

unsafe extern "C" {
    fn iltm_add_1_dark(add: *const AddLight);
    fn iltm_add_1_lit(add: *const AddLight);
    fn iltm_add_3_dark(add: *const AddLight);
    fn iltm_add_3_lit(add: *const AddLight);
    fn iltm_merge_1_dark(merge: *const MergePixels);
    fn iltm_merge_1_lit(merge: *const MergePixels);
    fn iltm_merge_3_dark(merge: *const MergePixels);
    fn iltm_merge_3_lit(merge: *const MergePixels);
    fn iltm_finish_1_dark(finish: *const Finish) -> u32;
    fn iltm_finish_1_lit(finish: *const Finish) -> u32;
    fn iltm_finish_3_dark(finish: *const Finish) -> u32;
    fn iltm_finish_3_lit(finish: *const Finish) -> u32;
    fn iltm_finish_1_dark_linear(finish: *const Finish) -> u32;
    fn iltm_finish_1_lit_linear(finish: *const Finish) -> u32;
    fn iltm_finish_3_dark_linear(finish: *const Finish) -> u32;
    fn iltm_finish_3_lit_linear(finish: *const Finish) -> u32;
}

/// Address of the first sample of a channel in pixels of `C` samples; `None` if there
/// are fewer than `count` pixels.
fn samples<T, const C: usize>(pixels: &[[T; C]], channel: usize, count: usize) -> Option<*const T> {
    let pixels = pixels.get(..count)?;
    Some(pixels.as_flattened().get(channel..)?.as_ptr())
}

/// Address of the first sample of the ambient light, null in a dark room.
fn ambient<const C: usize>(pixels: &Plane<'_, u8, C>, count: usize) -> Option<*const u8> {
    match pixels.ambient {
        Some(ambient) => Some(samples(ambient, pixels.channel, count)?.cast()),
        None => Some(core::ptr::null()),
    }
}

/// Sums and details of a block, as `portable.rs` says.
pub(crate) fn merge<const C: usize>(
    pixels: &Plane<'_, u8, C>,
    light: &[Halfword; 256],
    block: Block,
    shift: u32,
    sums: &mut [i32],
    details: &mut [[InputCoefficient; 3]],
) -> bool {
    let (count, pixels) = (
        block.nodes * block.rows,
        pixels.from(block.row * block.cols),
    );
    let Some(span) = span(block) else {
        return false;
    };
    if sums.len() < count || details.len() < count || shift != FINEST_SHIFT {
        return false;
    }
    let top = samples(pixels.codes, pixels.channel, span);
    let (Some(top), Some(ambient)) = (top, ambient(&pixels, span)) else {
        return false;
    };
    let merge = MergePixels {
        top,
        light: light.as_ptr().cast(),
        sums: sums.as_mut_ptr(),
        details: details.as_mut_ptr().cast(),
        nodes: block.nodes,
        rows: block.rows,
        ambient,
        stride: block.cols * C,
    };
    let merge = &raw const merge;
    // SAFETY: `samples` made sure of the pixels that the block spans, and of their
    // ambient light where it is read; `sums` has one element for each of its nodes and
    // `details` three; `light` has one for every value of a byte. Halfwords and the
    // words of two details need no alignment.
    unsafe {
        match (C, pixels.ambient.is_some()) {
            (1, false) => iltm_merge_1_dark(merge),
            (1, true) => iltm_merge_1_lit(merge),
            (3, false) => iltm_merge_3_dark(merge),
            (3, true) => iltm_merge_3_lit(merge),
            _ => return false,
        }
    }
    true
}

/// Codes of pixels, as `portable.rs` says.
pub(crate) fn finish<const C: usize>(
    wanted: &Plane<'_, u8, C>,
    light: &[Halfword; 256],
    codes: Option<&[u8; CODES]>,
    gain_fraction: u32,
    gains: &[[Halfword; C]],
    corrections: &[i32],
    input: &mut [[u8; C]],
) -> Option<ClippedSamples> {
    let (count, channel) = (corrections.len(), wanted.channel);
    if count > MAX_PIXELS {
        return None;
    }
    let finish = Finish {
        corrections: corrections.as_ptr(),
        wanted: samples(wanted.codes, channel, count)?,
        gain: samples(gains, channel, count)?.cast(),
        input: samples(input, channel, count)?.cast_mut(),
        light: light.as_ptr().cast(),
        codes: codes.map_or(without_provenance(PROPORTIONAL), |codes| codes.as_ptr()),
        gain_fraction,
        half: 1_u32.wrapping_shl(gain_fraction) >> 1,
        count,
        ambient: ambient(wanted, count)?,
    };
    let finish = &raw const finish;
    // SAFETY: all slices have `count` pixels, of which the loop touches one channel;
    // `light` has an element for every value of a byte, and `codes` for every index
    // that `usat` leaves, below 2^13; the loops for codes in proportion take them for
    // a factor.
    let clipped = unsafe {
        match (C, wanted.ambient.is_some(), codes.is_some()) {
            (1, false, true) => iltm_finish_1_dark(finish),
            (1, true, true) => iltm_finish_1_lit(finish),
            (3, false, true) => iltm_finish_3_dark(finish),
            (3, true, true) => iltm_finish_3_lit(finish),
            (1, false, false) => iltm_finish_1_dark_linear(finish),
            (1, true, false) => iltm_finish_1_lit_linear(finish),
            (3, false, false) => iltm_finish_3_dark_linear(finish),
            (3, true, false) => iltm_finish_3_lit_linear(finish),
            _ => return None,
        }
    };
    Some(ClippedSamples {
        black: clipped & 0xffff,
        white: clipped >> 16,
    })
}

/// Light added to columns, as `portable.rs` says.
pub(crate) fn add_light<const C: usize>(
    pixels: &Plane<'_, u8, C>,
    light: &[Halfword; 256],
    weight: u32,
    columns: &mut [u32],
) -> bool {
    let count = columns.len();
    let first = samples(pixels.codes, pixels.channel, count);
    let (Some(first), Some(ambient)) = (first, ambient(pixels, count)) else {
        return false;
    };
    let add = AddLight {
        pixels: first,
        columns: columns.as_mut_ptr(),
        light: light.as_ptr().cast(),
        weight,
        count,
        ambient,
    };
    let add = &raw const add;
    // SAFETY: `samples` made sure of `count` pixels and of their ambient light where it
    // is read; `columns` has `count` elements and `light` one for every value of a
    // byte.
    unsafe {
        match (C, pixels.ambient.is_some()) {
            (1, false) => iltm_add_1_dark(add),
            (1, true) => iltm_add_1_lit(add),
            (3, false) => iltm_add_3_dark(add),
            (3, true) => iltm_add_3_lit(add),
            _ => return false,
        }
    }
    true
}

// r0 pixels, r1 columns, r2 light, r3 weight, r4 pixels left, r5 ambient, r6 and r7
// light of two pixels, r8 and r9 their columns, r10 ambient light.
global_asm!(
    r#"
    .syntax unified
    .macro iltm_add_two channels, lit
        ldrd r8, r9, [r1]
        ldrb r6, [r0], #\channels
        ldrb r7, [r0], #\channels
        ldrh r6, [r2, r6, lsl #1]
        ldrh r7, [r2, r7, lsl #1]
    .if \lit
        ldrh r10, [r5], #2*\channels
        uqsub16 r6, r6, r10
        ldrh r10, [r5], #2*\channels
        uqsub16 r7, r7, r10
    .endif
        mla r8, r6, r3, r8
        mla r9, r7, r3, r9
        strd r8, r9, [r1], #8
    .endm

    .macro iltm_add name, channels, lit
    .section .text.\name, "ax", %progbits
    .global \name
    .type \name, %function
    .thumb_func
    \name:
        push {{r4-r10, lr}}
        ldmia r0, {{r0-r5}}
        subs r4, #8
        blt 2f
    1:
    .rept 4
        iltm_add_two \channels, \lit
    .endr
        subs r4, #8
        bge 1b
    2:
        adds r4, #8
        beq 4f
    3:
        ldrb r6, [r0], #\channels
        ldr r8, [r1]
        ldrh r6, [r2, r6, lsl #1]
    .if \lit
        ldrh r10, [r5], #2*\channels
        uqsub16 r6, r6, r10
    .endif
        mla r8, r6, r3, r8
        str r8, [r1], #4
        subs r4, #1
        bne 3b
    4:
        pop {{r4-r10, pc}}
    .size \name, . - \name
    .endm

    iltm_add iltm_add_1_dark, 1, 0
    iltm_add iltm_add_1_lit, 1, 1
    iltm_add iltm_add_3_dark, 3, 0
    iltm_add iltm_add_3_lit, 3, 1
    .text
    "#
);

// r0 top, r1 bottom, r2 light, r3 sums, r4 details, r5 nodes left in the row (in colour
// two a turn, an odd one alone), r6-r9 the four values of a node, r10 and r11 ambient
// light of top and bottom, r12 and lr what comes of them. On the stack: nodes of a row,
// rows left, stride.
global_asm!(
    r#"
    .syntax unified
    .macro iltm_merge_node channels, lit
        ldrb r6, [r0], #\channels
        ldrb r7, [r0], #\channels
        ldrb r8, [r1], #\channels
        ldrb r9, [r1], #\channels
        ldrh r6, [r2, r6, lsl #1]
        ldrh r7, [r2, r7, lsl #1]
        ldrh r8, [r2, r8, lsl #1]
        ldrh r9, [r2, r9, lsl #1]
    .if \lit
        ldrh r12, [r10], #2*\channels
        ldrh lr, [r10], #2*\channels
        uqsub16 r6, r6, r12
        uqsub16 r7, r7, lr
        ldrh r12, [r11], #2*\channels
        ldrh lr, [r11], #2*\channels
        uqsub16 r8, r8, r12
        uqsub16 r9, r9, lr
    .endif
        add r12, r6, r7
        sub r6, r6, r7
        add lr, r8, r9
        sub r8, r8, r9
        add r7, r12, lr
        sub r12, r12, lr
        str r7, [r3], #4
        add r6, #2
        add r12, #2
        add r7, r6, r8
        sub r6, r6, r8
        asr r7, #2
        asr r6, #2
        pkhbt r7, r7, r12, lsl #14
        strh r6, [r4, #4]
        str r7, [r4], #6
    .endm

    .macro iltm_merge name, channels, lit
    .section .text.\name, "ax", %progbits
    .global \name
    .type \name, %function
    .thumb_func
    \name:
        push {{r4-r11, lr}}
        ldr r10, [r0, #24]
        ldr r7, [r0, #28]
        ldmia r0, {{r1-r6}}
        mov r0, r1
        push {{r5, r6, r7}}
    1:
        ldr r6, [sp, #8]
        ldr r5, [sp]
        add r1, r0, r6
        add r11, r10, r6, lsl #1
    .if \channels == 3
        tst r5, #1
        it ne
        addne r5, #1
        bne 3f
    2:
        iltm_merge_node \channels, \lit
    3:
        iltm_merge_node \channels, \lit
        subs r5, #2
    .else
    2:
        iltm_merge_node \channels, \lit
        subs r5, #1
    .endif
        bne 2b
        mov r0, r1
        mov r10, r11
        ldr r6, [sp, #4]
        subs r6, #1
        str r6, [sp, #4]
        bne 1b
        add sp, #12
        pop {{r4-r11, pc}}
    .size \name, . - \name
    .endm

    iltm_merge iltm_merge_1_dark, 1, 0
    iltm_merge iltm_merge_1_lit, 1, 1
    iltm_merge iltm_merge_3_dark, 3, 0
    iltm_merge iltm_merge_3_lit, 3, 1
    .text
    "#
);

// r0 corrections, r1 wanted, r2 gain, r3 input, r4 light, r5 codes or factor, r6 gain
// fraction, r7 half, r8 pixels left, r9 drive, r10 gain and index, r11 ambient, r12
// correction or the way back, lr samples clipped at black and, in the high halfword,
// at white.
global_asm!(
    r#"
    .macro iltm_drive channels, lit, linear
        ldrb r9, [r1], #\channels
        ldrh r10, [r2], #2*\channels
        ldrh r9, [r4, r9, lsl #1]
    .if \lit
        ldrh r12, [r11], #2*\channels
        uqsub16 r9, r9, r12
    .endif
        ldr r12, [r0], #4
        mla r9, r9, r10, r7
        lsr r9, r6
        sub r9, r9, r12, asr #8
    .if \linear
        usat r10, #15, r9
        cmp r10, r9
    .else
        usat r10, #13, r9, asr #2
        cmp r10, r9, asr #2
    .endif
    .endm

    .macro iltm_code channels, linear
    .if \linear
        smmulr r10, r10, r5
    .else
        ldrb r10, [r5, r10]
    .endif
        strb r10, [r3], #\channels
    .endm

    .macro iltm_slot slot, channels, lit, linear
        iltm_drive \channels, \lit, \linear
        bne 1\slot\()f
    2\slot:
        iltm_code \channels, \linear
    .endm

    @ Samples clipped at black, most of all, say `gt` and are counted on the spot.
    .macro iltm_clipped back
        add lr, lr, r9, lsr #31
        bgt \back
        adr.w r12, \back
        b 8f
    .endm

    .macro iltm_finish name, channels, lit, linear
    .section .text.\name, "ax", %progbits
    @ In code aligned to halfwords `adr` would be two bytes off.
    .balign 4
    .global \name
    .type \name, %function
    .thumb_func
    \name:
        push {{r4-r11, lr}}
        mov lr, #0
        ldr r11, [r0, #36]
        ldmia r0, {{r0-r8}}
    .if \linear
        subs r8, #2
    .else
        subs r8, #4
    .endif
        blt 5f
    1:
        iltm_slot 1, \channels, \lit, \linear
        iltm_slot 2, \channels, \lit, \linear
    .if \linear
        subs r8, #2
        bge 1b
    5:
        adds r8, #2
    .else
        iltm_slot 3, \channels, \lit, \linear
        iltm_slot 4, \channels, \lit, \linear
        subs r8, #4
        bge 1b
    5:
        adds r8, #4
    .endif
        beq 7f
    6:
        iltm_slot 6, \channels, \lit, \linear
        subs r8, #1
        bne 6b
    7:
        mov r0, lr
        pop {{r4-r11, pc}}
    11:
        iltm_clipped 21b
    12:
        iltm_clipped 22b
    .if \linear == 0
    13:
        iltm_clipped 23b
    14:
        iltm_clipped 24b
    .endif
    16:
        iltm_clipped 26b
    8:
        cmp r9, #32768
        it gt
        addgt lr, #0x10000
        mov pc, r12
    .size \name, . - \name
    .endm

    iltm_finish iltm_finish_1_dark, 1, 0, 0
    iltm_finish iltm_finish_1_dark_linear, 1, 0, 1
    iltm_finish iltm_finish_1_lit, 1, 1, 0
    iltm_finish iltm_finish_1_lit_linear, 1, 1, 1
    iltm_finish iltm_finish_3_dark, 3, 0, 0
    iltm_finish iltm_finish_3_dark_linear, 3, 0, 1
    iltm_finish iltm_finish_3_lit, 3, 1, 0
    iltm_finish iltm_finish_3_lit_linear, 3, 1, 1
    .text
    "#
);
