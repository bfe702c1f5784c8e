//! Assembler loops for Arm.

pub(crate) mod gather;
pub(crate) mod levels;
pub(crate) mod lines;
pub(crate) mod pixels;
