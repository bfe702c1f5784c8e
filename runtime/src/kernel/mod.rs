//! The loops that a frame's time goes into, and the only unsafe code of this crate.
//!
//! Each has a plain version, which is the definition, and one in assembler for Arm
//! processors with the DSP extension (Cortex-M4, M7 and up). Hosts use the plain
//! ones; `tests/tests/firmware.rs` compares whole frames of the two. With the
//! feature `reference-kernel` an Arm target uses the plain ones too, to measure what
//! the others bring (`docs/firmware.md`).
//!
//! | loop | what it does |
//! |---|---|
//! | [`gather`] | products of an operator's entries with input coefficients |
//! | [`levels`] | one level of the Haar transform |
//! | [`lines`] | values of cells along a row to values of pixels |
//! | [`pixels`] | 8-bit pixels to the finest level, and corrections to 8-bit pixels |

pub(crate) mod gather;
pub(crate) mod levels;
pub(crate) mod lines;
pub(crate) mod pixels;
